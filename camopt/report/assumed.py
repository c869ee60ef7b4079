"""What the scene assumes, ranked by how much the verdict hangs on it.

Every assumed number of a mass or an element is moved by `MOVED` either way, and event-exact looks at the settled motion
at the highest listed speed: a number counts by how much it moves the used share of a limit on the motion, at the worst.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import motion_limits
from camopt.plots.style import DESIGN
from camopt.report.motion import RunCams
from camopt.report.wording import shown
from camopt.scene.parameters import KEYS, SceneNumber, with_numbers
from camopt.scene.quantities import QUANTITIES
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

MOVED = 0.1
"""Share by which each number is moved: what a guess may well be off by."""
MOST_SHOWN = 2
"""Names in the sentence on what to measure first."""


@dataclass(frozen=True)
class Hanging:
    """An assumed number, its value, and what a tenth of it moves most: a limit, the used share as it is and as it is at
    the worst, infinite where the valve never seats or nothing settles."""

    name: str
    value: float
    limit: str
    share: float
    moved_to: float


def assumed_numbers(scene: Scene) -> list[SceneNumber]:
    """The numbers of masses and elements that the scene marks as assumed and that are not zero."""
    found = [
        SceneNumber(table, i, key)
        for table, keys in KEYS.items()
        for i, row in enumerate(getattr(scene, table))
        for key in row.assumed
        if key in keys
    ]
    return [number for number in found if number.of(scene)]


def ranked(scene: Scene, lift: Lift) -> list[Hanging]:
    """The assumed numbers, those on which the verdict hangs most first; empty where the scene limits no motion."""
    limits, numbers = motion_limits(scene.design), assumed_numbers(scene)
    if not limits or not numbers or scene.operation is None:
        return []
    moved = [with_numbers(scene, {n: n.of(scene) * f}) for n in numbers for f in (1 - MOVED, 1 + MOVED)]
    speeds = [scene.cam_speed(scene.operation.speeds_rpm[-1])]
    found = settled_metrics([build_train(one) for one in (scene, *moved)], [lift], speeds)
    shares = {key: _worst(limit.share(found.worst(limit.metric)[:, 0])) for key, limit in limits.items()}
    rows = []
    for i, number in enumerate(numbers):
        both = {key: share[1 + 2 * i : 3 + 2 * i].max() for key, share in shares.items()}
        key = max(both, key=lambda key: both[key] - shares[key][0])
        rows.append(Hanging(number.named(scene), number.of(scene), key, float(shares[key][0]), float(both[key])))
    return sorted(rows, key=lambda row: row.share - row.moved_to)


def _worst(shares: np.ndarray) -> np.ndarray:
    """The largest used share over the speeds (t, s); infinite where a motion has no figure."""
    return np.where(np.isnan(shares), np.inf, shares).max(axis=1)


def of_the_run(cams: RunCams) -> list[Hanging]:
    """The ranking of a run's scene with its design; empty where event-exact cannot look at it."""
    lift = cams.lifts.get(DESIGN)
    if cams.scene is None or lift is None or not build_train(cams.scene).straight:
        return []
    return ranked(cams.scene, lift)


def assumed_rows(found: Sequence[Hanging]) -> list[list[str]]:
    """Rows of the report: number, value, limit, its used share in per cent, and at the worst within a tenth."""
    labels = {quantity.limit: quantity.label for quantity in QUANTITIES.values()}
    return [
        [row.name, shown(row.value, 4), labels[row.limit], _per_cent(row.share), _per_cent(row.moved_to)]
        for row in found
    ]


def first_to_measure(found: Sequence[Hanging]) -> str:
    """The names of the numbers on which most hangs, to stand in a sentence; empty where none is assumed."""
    names = [row.name for row in found[:MOST_SHOWN]]
    more = len(found) - len(names)
    return ", ".join(names) + (f" and {more} more, ranked in the valve train's section" if more else "")


def _per_cent(share: float) -> str:
    return f"{100 * share:.0f} %" if share < 10 else "no motion that counts" if np.isinf(share) else "over 1000 %"
