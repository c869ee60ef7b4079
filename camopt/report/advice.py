"""Next steps after a run, derived from its outcome, for the report and for the last line of the command line.

A command with the options of this run is never advised again: the accuracy is raised first, then the requested yield is
lowered to what was reached, and finally the limits or the tolerances have to change.

The numbers that the scene assumes are to be measured first. They are ranked by their influence on the verdict: each
assumed number of a mass or an element is raised and lowered by `MOVED`, event-exact computes the settled motion at the
highest listed speed, and the rank follows from the largest increase of the used share of a limit on the motion.
"""

import shlex
from collections.abc import Sequence
from functools import lru_cache

from camopt.cam.lift import Lift
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import motion_limits
from camopt.measure.yield_words import ADVISED, ENOUGH, HELD, MISSED, NOT_ASKED, estimated_words, standing
from camopt.report.folder import RunFolder
from camopt.scene import Scene, build_train
from camopt.scene.parameters import KEYS, SceneNumber, with_numbers
from camopt.scene.quantities import is_number, label_and_unit
from camopt.verifier import ACCURACY_NAMES, FINE

MOVED = 0.1
"""Relative change of each assumed number: a usual error of a guess."""
MOST_SHOWN = 2
"""Largest number of names in the sentence on what to measure first."""


def assumed_numbers(scene: Scene) -> list[SceneNumber]:
    """Numbers of masses and elements that the scene marks as assumed, except those that are zero."""
    numbers = [
        SceneNumber(table, i, key)
        for table, keys in KEYS.items()
        for i, row in enumerate(getattr(scene, table))
        for key in row.assumed
        if key in keys
    ]
    return [number for number in numbers if number.of(scene)]


@lru_cache(maxsize=4)  # a run writes its report twice: before the comparison and after it
def ranked(scene: Scene, lift: Lift) -> tuple[dict, ...]:
    """The assumed numbers, the most influential first; empty where the scene has no limit on the motion, or where
    event-exact cannot compute it. Each has its `name`, its `value`, the `limit` that its change affects most, the used
    `share` of that limit, and the worst share after the change, `moved_to`, which is infinite where the motion does not
    settle or the valve does not seat."""
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
        used = {"limit": key, "share": float(shares[key][0]), "moved_to": float(both[key])}
        rows.append({"name": number.named(scene), "value": number.of(scene)} | used)
    return tuple(sorted(rows, key=lambda row: row["share"] - row["moved_to"]))


def first_to_measure(ranking: Sequence[dict]) -> str:
    """Names of the most influential numbers, as part of a sentence; empty where no number is assumed."""
    names = [row["name"] for row in ranking[:MOST_SHOWN]]
    more = len(ranking) - len(names)
    return ", ".join(names) + (f" and {more} more, ranked in the valve train's section" if more else "")


LOWER_YIELDS = (0.99, 0.97, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5)
"""Yields that may be requested where a larger one was missed at the finest accuracy."""
FEW_TRAINS = 200
NAMED = 2
"""Largest number of assumed numbers of the geometry that a sentence names; the others are counted."""


def advice(run: RunFolder, scene: str, cam: str, assumed: Sequence[dict] = ()) -> list[dict[str, str]]:
    """Next steps for this run, the most important first, each with a sentence (`words`) and a `command`.

    `scene` and `cam` are the commands' arguments: a scene's name or file, and the run folder's path. `assumed` are the
    train's assumed numbers, the most influential first.
    """
    verdict, steps = run.verdict, _Commands(run, scene, cam)
    move = steps.step("Move the limits and watch the cam.", "design", scene)
    if verdict == "confirmed":
        first = max(run.worth, key=lambda key: run.worth[key], default=None)
        words = (
            f"Move the limits; {label_and_unit(first)[0]} has the largest effect on the area."
            if first
            else "Move the limits."
        )
        return [*_steps_if_confirmed(run, steps, assumed), steps.step(words, "design", scene)]
    if verdict == "rejected":
        return [*steps.further("Search further: the verdict broke a limit."), move]
    if verdict == "sensitive":
        return [*steps.further("Search further: a limit is straddled; or lower it by a tenth in the scene."), move]
    if verdict == "not converged":
        words = "Judge it with more methods and finer steps."
        return [steps.step(words, "verify", scene, "--cam", cam, "--accuracy", FINE)]
    if "design.json" in run.missing or "scene.toml" in run.missing:
        return []
    return [steps.step("Have the cam judged.", "verify", scene, "--cam", cam), move]


def further(run: RunFolder, scene: str, cam: str) -> dict[str, str]:
    """The step that repeats the search at the next finer accuracy; after the finest, the step that moves the limits."""
    steps = _Commands(run, scene, cam)
    next_steps = steps.further("Search further.")
    return next_steps[0] if next_steps else steps.step("Move the limits and watch the cam.", "design", scene)


def _steps_if_confirmed(run: RunFolder, steps: "_Commands", assumed: Sequence[dict]) -> list[dict[str, str]]:
    """Steps that remain for a confirmed cam before it is ground."""
    record = run.built
    stands = standing(record)
    share = f"{100 * record['share']:.3g} % of those as built hold" if stands else ""
    if stands == MISSED:
        return _steps_if_yield_missed(record, share, steps)
    if stands == NOT_ASKED:
        estimate = estimated_words(record)
        words = (
            f"Before it is ground, design the cam that {100 * ADVISED:g} % of the trains hold{estimate}; here {share}."
        )
        return [steps.again(words, max(steps.accuracy, 1), ADVISED), steps.halved()]
    if steps.accuracy == 0:
        return [steps.again("This was a draft: design once more before it is ground.", 1, steps.wanted)]
    words = _grinding_sentence(run, share if stands in (HELD, ENOUGH) else "", assumed)
    table = steps.step(words, "cam", steps.scene, "--cam", steps.cam, "--csv", "lift.csv", "--digits", 5)
    if not stands and run.scene.get("tolerance"):
        command = ("yield", steps.scene, "--cam", steps.cam, "--trains", FEW_TRAINS)
        return [steps.step("Ask how many trains as built hold.", *command), table]
    return [table]


def _steps_if_yield_missed(record: dict, share: str, steps: "_Commands") -> list[dict[str, str]]:
    """Steps where the yield is missed: a finer accuracy, then a lower yield, then narrower tolerances."""
    words = f"Only {share}, and {100 * record['wanted']:g} % were asked"
    if finer := steps.further(f"{words}: search further."):
        return [*finer, steps.halved()]
    if lower := [share for share in LOWER_YIELDS if share <= record["low"] and share < record["wanted"]]:
        sentence = f"{words}: ask for what can be held, or narrow the tolerances."
        return [steps.again(sentence, steps.accuracy, lower[0]), steps.halved()]
    return [steps.halved(f"{words}: see which tolerance spoils most, and narrow it.")]


def _grinding_sentence(run: RunFolder, share: str, assumed: Sequence[dict]) -> str:
    """The sentence on grinding the cam, after the assumed numbers of its train and its geometry have been measured."""
    geometry = run.scene.get("geometry")
    guessed = geometry.get("assumed") if isinstance(geometry, dict) else None
    names = [label_and_unit(str(key))[0] for key in guessed] if isinstance(guessed, list) else []
    parts = [f"of the train first {first_to_measure(assumed)}"] if assumed else []
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    parts += [f"of the geometry {', '.join(names[:NAMED])}{more}"] if names else []
    held = f"; {share}" if share else "" if run.scatters else "; the scene does not say how trains differ"
    if not parts:
        return f"Take the cam to the grinder{held}."
    return f"Measure what the scene assumes ({'; '.join(parts)}), then take the cam to the grinder{held}."


class _Commands:
    """Steps and their commands, with the options of the run."""

    def __init__(self, run: RunFolder, scene: str, cam: str):
        named, wanted, free = (run.settings.get(key) for key in ("accuracy", "yield", "free"))
        self.scene, self.cam = scene, cam
        self.accuracy = ACCURACY_NAMES.index(named) if named in ACCURACY_NAMES else 1
        self.wanted = wanted if is_number(wanted) else None
        self._nominal = run.settings.get("speeds") == "nominal"
        ranges = free.items() if isinstance(free, dict) else ()
        ends = [(name, *ends) for name, ends in ranges if isinstance(ends, list) and all(map(is_number, ends))]
        self._free = [word for name, low, high in ends for word in ("--free", f"{name}={low:g}:{high:g}")]

    def step(self, words: str, *command: object) -> dict[str, str]:
        """A step: its sentence and its command."""
        return {"words": words, "command": shlex.join(["camopt", *map(str, command)])}

    def again(self, words: str, accuracy: int, wanted: float | None) -> dict[str, str]:
        """The step that designs at an accuracy, for a yield if one is wanted, with the run's other options."""
        command: list[object] = ["optimize", self.scene, *self._free, "--accuracy", ACCURACY_NAMES[accuracy]]
        command += ["--speeds", "nominal"] if self._nominal and wanted is None else []  # a yield is that of the band
        return self.step(words, *command, *([] if wanted is None else ["--yield", f"{wanted:g}"]))

    def further(self, words: str) -> list[dict[str, str]]:
        """The step that designs at the next finer accuracy for the same yield; empty after the finest."""
        finer = self.accuracy + 1
        return [self.again(words, finer, self.wanted)] if finer < len(ACCURACY_NAMES) else []

    def halved(self, words: str = "Or see what narrower tolerances would buy.") -> dict[str, str]:
        """The step that computes the yield with each tolerance halved."""
        return self.step(words, "yield", self.scene, "--cam", self.cam, "--trains", FEW_TRAINS, "--halve")
