"""Comparison of designs with the cams of the literature: baselines, verdicts, `comparison.csv` and the figures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib.figure import Figure

from camopt.cam.families.polydyne import polydyne
from camopt.cam.families.registry import FAMILIES
from camopt.cam.lift import Lift
from camopt.cam.read import read_cam
from camopt.measure.limits import shape_excess
from camopt.optimizer.accuracy import ACCURACIES, Accuracy, accuracy_named, drawn_speeds
from camopt.optimizer.baselines.comparison_table import FAILED, NO_JERK, failed, store, stored, write_table
from camopt.optimizer.baselines.figures import draw
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.storage import run_folder, run_identity
from camopt.verifier import DRAFT
from camopt.verifier.accuracy import EFFORTS
from camopt.verifier.convergence import Tolerances
from camopt.verifier.verdict import Verdict, verdict_on

SECTIONED = ("multi-pol", "new-design")
HALVINGS = 3
"""Permitted halvings of each method's step for a baseline: enough if it bounces little, else only the range matters."""
MOST_EXCESS = 0.1
"""Relative excess over a limit on the shape, other than the jerk limit, up to which a member is shown beside the
designs. The paper's own Polydyne exceeds its acceleration limit by some per cent; on a stiff train the default exceeds
it 2.2 times."""


@dataclass(frozen=True)
class Comparison:
    """A comparison: the folder with comparison.csv and the figures, and the figures by name (matplotlib)."""

    folder: Path
    figures: Mapping[str, Figure] = field(repr=False)

    def plot(self) -> Figure:
        """Bounce and jump of the cams against speed, with their limits."""
        return self.figures["bounce_against_speed"]

    def __fspath__(self) -> str:
        return str(self.folder)


def compare(
    scene: Scene,
    designs: dict[str, Lift],
    out: Path | str,
    *,
    accuracy: str = "draft",
    baselines: str = "plain",
    progress: bool = False,
    note: Callable[[str], object] = lambda sentence: None,
) -> Comparison:
    """Compare designs with the scene's baselines in the new folder `out`: comparison.csv and figures.

    `designs` maps names to lift laws, each of which is judged at the scene's listed speeds (k) [r/min] and over its
    band. `baselines` "plain" are the literature's cams as their authors would draw them, for the largest area; "best"
    is every family's member of the largest area within the scene's bounce limit at its listed speeds, a search that
    takes minutes and with `progress` shows a bar. Both are designed under all limits of the scene, and again without
    its jerk limit. "none" means no other cams. `note` receives a sentence for each family in which "best" found no
    member that holds. Raises InputError for an unusable folder or scene, and for other words.
    """
    design = {"plain": plain_baselines, "best": lambda _: best_baselines(scene, progress, note), "none": lambda _: {}}
    if baselines not in design:
        raise InputError(f"baselines {baselines!r}: expected {', '.join(design)}")
    if baselines == "none" and not designs:
        raise InputError("compare: nothing to compare: name a design, or leave the literature's cams in")
    effort = accuracy_named(accuracy)
    named = {"design" if len(designs) == 1 else name: lift for name, lift in designs.items()}
    with run_folder(out, run_identity("compare", scene, baselines=baselines), worth=["comparison.csv"]) as folder:
        figures = compare_in(folder, scene, named, {}, effort, design[baselines](scene))
    return Comparison(folder, figures)


def plain_baselines(
    scene: Scene, *, without_jerk_limit: bool = True, designed: Mapping[str, Lift | str] | None = None
) -> dict[str, Lift | str]:
    """Polydyne, Multi-Pol and New Design by name, the latter two also without the scene's jerk limit; a sentence where
    a family has no member. Cams that are already `designed`, by name, are taken from there."""
    designed = designed or {}
    cams = {name: designed.get(name) or member_or_sentence(scene, name) for name in ("polydyne", *SECTIONED)}
    for name in SECTIONED if without_jerk_limit and _jerk_limited(scene) else ():
        cams[name + NO_JERK] = _member(scene, lambda name=name: read_cam(f"{name}:jerk=no", scene))
    return cams


def member_or_sentence(scene: Scene, family: str) -> Lift | str:
    """A family's member of the largest area under all limits of the scene, or the reason why there is none."""
    return _member(scene, lambda: polydyne(scene) if family == "polydyne" else read_cam(family, scene))


def best_baselines(
    scene: Scene, progress: bool = False, note: Callable[[str], object] = lambda sentence: None
) -> dict[str, Lift | str]:
    """Every family's member of the largest area within the scene's bounce limit, by name. If no member was found that
    holds, it is the one with the least bounce, and `note` receives a sentence. A member that holds under the jerk limit
    also holds without it, so that the search without it never ends with less area."""
    from camopt.optimizer.baselines.largest_member import Baseline, largest_area_member

    bounce_max_mm = None if scene.design is None else scene.design.bounce_max_mm
    cams: dict[str, Lift | str] = {}
    held: dict[str, Baseline] = {}

    def searched(name: str, jerk: bool) -> Lift:
        baseline = largest_area_member(scene, name, jerk=jerk, bounce_max_mm=bounce_max_mm, progress=progress)
        before = held.get(name)
        if before is not None and not (baseline.holds and baseline.area_ratio >= before.area_ratio):
            return before.lift
        if baseline.holds:
            held[name] = baseline
        else:
            note(f"{baseline.says}; shown is the nearest that was found" + NO_JERK * (not jerk))
        return baseline.lift

    for jerk in (True, False) if _jerk_limited(scene) else (True,):
        for name in FAMILIES:
            cams[name + ("" if jerk else NO_JERK)] = _member(scene, lambda name=name, jerk=jerk: searched(name, jerk))
    return cams


def _jerk_limited(scene: Scene) -> bool:
    return scene.design is not None and scene.design.jerk_max_mm_per_deg3 is not None


def _member(scene: Scene, design: Callable[[], Lift]) -> Lift | str:
    """A family's member, or the reason why there is none to compare with. Any error in a family, even a defect, costs
    only its row. A member may exceed the limits on lift, acceleration or duration by `MOST_EXCESS` at most."""
    try:
        lift = design()
    except Exception as error:
        return _sentence(error)
    without_jerk = {"jerk_max_mm_per_deg3": None}  # a table of its own shows which cams break that limit
    over = shape_excess(lift, scene.required_design.model_copy(update=without_jerk))
    if (most := max(over.values(), default=0.0)) > MOST_EXCESS:
        return (
            f"{lift.family}: no cam to compare with under the limits of this scene, because its member breaks "
            f"{', '.join(over)} by up to {most:.0%}"
        )
    return lift


def _sentence(error: Exception) -> str:
    return str(error) if isinstance(error, InputError) else f"a defect of camopt ({type(error).__name__}: {error})"


def compare_in(
    folder: Path,
    scene: Scene,
    designs: dict[str, Lift],
    verdicts: dict[str, Verdict],
    effort: Accuracy,
    baselines: Mapping[str, Lift | str],
    judged: Callable[[float], object] = lambda share: None,
) -> dict[str, Figure]:
    """Writes comparison.csv and the figures into a folder; returns the figures by name, none if there is no cam. Cams
    with a verdict are not verified again.

    `baselines` are as in `plain_baselines`; one without a member gets a row with the reason. They are judged at the
    listed speeds and, unless a given verdict has no band, over the band in the same steps as the design. `judged` is
    called with each baseline's share of the work. Cams and verdicts are stored in the folder's `cams` and `verdicts`,
    for the report and for `--cam`.
    """
    band_step = None if any(v.band is None for v in verdicts.values()) else effort.verdict.band_step_rpm
    of_designs = {
        name: verdicts[name].as_dict() if name in verdicts else _judged(scene, lift, effort, band_step)
        for name, lift in designs.items()
    }
    cams, of_baselines = dict(designs), {}
    for name, lift in sorted(baselines.items()):
        of_baselines[name] = _judged_baseline(scene, lift, effort, band_step)
        judged(1 / (len(baselines) + 1))
        if not isinstance(lift, str) and of_baselines[name]["verdict"] != FAILED:
            cams[name] = lift
    store(folder, scene, {name: cams[name] for name in of_baselines if name in cams}, of_baselines)
    return _write(folder, scene, cams, of_designs | of_baselines, drawn_speeds(scene.required_operation, effort))


def compare_again(folder: Path, scene: Scene, accuracy: object = None) -> None:
    """Writes comparison.csv and the figures of a run folder again, from the design, cams and verdicts stored in it.
    They are left as they are if it has no verdicts of baselines (an older run).

    The valve's motion is drawn at the speeds of the run's `accuracy`, or at every listed speed if that is unknown.
    Raises InputError for files that cannot be understood.
    """
    if not (folder / "verdicts").is_dir():
        return
    effort = ACCURACIES.get(accuracy) if isinstance(accuracy, str) else None
    operation = scene.required_operation
    speeds = operation.speeds_rpm if effort is None else drawn_speeds(operation, effort)
    _write(folder, scene, *stored(folder, scene), speeds)


def _write(
    folder: Path,
    scene: Scene,
    cams: Mapping[str, Lift],
    verdicts: Mapping[str, dict],
    speeds_rpm: Sequence[float],
) -> dict[str, Figure]:
    write_table(folder, scene, cams, verdicts)
    shown = {name: lift for name, lift in cams.items() if not name.endswith(NO_JERK)}
    return draw(folder, scene, shown, {name: verdicts[name] for name in shown}, speeds_rpm) if shown else {}


def _judged(scene: Scene, lift: Lift, effort: Accuracy, band_step_rpm: float | None, to_the_end: bool = True) -> dict:
    methods = EFFORTS[DRAFT].methods_of(build_train(scene))
    tolerances = Tolerances(effort.verdict.tolerances.tolerance_um, HALVINGS)
    return verdict_on(scene, lift, None, methods, band_step_rpm, tolerances, to_the_end).as_dict()


def _judged_baseline(scene: Scene, lift: Lift | str, effort: Accuracy, band_step_rpm: float | None) -> dict:
    """A baseline's verdict, computed only until it is decided; "failed" without a member, or if it cannot be judged."""
    if isinstance(lift, str):
        return failed(lift)
    try:
        return _judged(scene, lift, effort, band_step_rpm, to_the_end=False)
    except Exception as error:  # as in `_member`: a defect here must not lose the design
        return failed(_sentence(error))
