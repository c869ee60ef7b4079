"""The numbers that a scene assumes, ranked by their influence on the verdict.

Every assumed number of a mass or an element is raised and lowered by `MOVED`, and event-exact computes the settled
motion at the highest listed speed: a number ranks by how much it raises the used share of a limit on the motion.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from camopt.cam.lift import Lift
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import motion_limits
from camopt.scene import Scene, build_train
from camopt.scene.parameters import KEYS, SceneNumber, with_numbers

MOVED = 0.1
"""Share by which each number is moved: a usual error of a guess."""
MOST_SHOWN = 2
"""Names in the sentence on what to measure first."""


@dataclass(frozen=True)
class AssumedNumber:
    """An assumed number, its value, and the limit that a change of it affects most: its used share `share` with that
    value and `moved_to` at the worst, infinite where the valve never seats or no motion settles."""

    name: str
    value: float
    limit: str
    share: float
    moved_to: float


def assumed_numbers(scene: Scene) -> list[SceneNumber]:
    """The numbers of masses and elements that the scene marks as assumed and that are not zero."""
    numbers = [
        SceneNumber(table, i, key)
        for table, keys in KEYS.items()
        for i, row in enumerate(getattr(scene, table))
        for key in row.assumed
        if key in keys
    ]
    return [number for number in numbers if number.of(scene)]


@lru_cache(maxsize=4)  # a run writes its page before the comparison, and after it once more
def ranked(scene: Scene, lift: Lift) -> tuple[AssumedNumber, ...]:
    """The assumed numbers, the most influential first; empty where the scene limits no motion, and where event-exact
    cannot compute it."""
    limits, numbers, train = motion_limits(scene.design), assumed_numbers(scene), build_train(scene)
    if not limits or not numbers or scene.operation is None or not train.straight:
        return ()
    moved = [with_numbers(scene, {n: n.of(scene) * f}) for n in numbers for f in (1 - MOVED, 1 + MOVED)]
    speeds = [scene.cam_speed(scene.operation.speeds_rpm[-1])]
    metrics = settled_metrics([train, *map(build_train, moved)], [lift], speeds)
    shares = {key: limit.share(metrics.worst(limit.metric)[:, 0]).max(axis=1) for key, limit in limits.items()}
    rows = []
    for i, number in enumerate(numbers):
        both = {key: share[1 + 2 * i : 3 + 2 * i].max() for key, share in shares.items()}
        key = max(both, key=lambda key: both[key] - shares[key][0])
        rows.append(AssumedNumber(number.named(scene), number.of(scene), key, float(shares[key][0]), float(both[key])))
    return tuple(sorted(rows, key=lambda row: row.share - row.moved_to))


def first_to_measure(ranking: Sequence[AssumedNumber]) -> str:
    """The names of the most influential numbers, for a sentence; empty where none is assumed."""
    names = [row.name for row in ranking[:MOST_SHOWN]]
    more = len(ranking) - len(names)
    return ", ".join(names) + (f" and {more} more, ranked in the valve train's section" if more else "")
