"""Designs beside the cams of the literature: `comparison.csv` and the figures of a run folder."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from camopt.cam.design_file import write_design
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift, lift_table
from camopt.cam.read import FAMILIES, read_cam
from camopt.exact.engine import prepare
from camopt.measure.limits import broken_by_shape
from camopt.measure.settling import settle
from camopt.measure.sweep import at_speeds
from camopt.optimizer.accuracy import Accuracy, accuracy_named
from camopt.optimizer.baselines.largest_member import excess
from camopt.plots import (
    History,
    Motion,
    Sweep,
    bounce_against_speed,
    convergence,
    last_revolution,
    profiles,
    save,
    valve_motion,
)
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.rest import rest_position
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.scene.units import DEG, MM
from camopt.storage import run_folder, run_identity, write_csv
from camopt.verifier.accuracy import EFFORTS
from camopt.verifier.verdict import Verdict, verdict_on

FIGURE_SPEEDS = 61
BEYOND_BAND = 0.1
"""How far, relative to its width, the figure shows speeds outside the band."""
TABLE_STEP_DEG = 0.1
SECTIONED = ("multi-pol", "new-design")
NO_JERK = " (no jerk limit)"
"""Ending of the name of a baseline that was designed without the scene's jerk limit."""
HALVINGS = 3
"""Of the step of each method for a baseline: enough where it bounces little, and where it bounces much only the range
matters."""
MOST_EXCESS = 0.1
"""Relative excess over a limit on the shape, the jerk's apart, up to which a member is shown beside the designs. The
paper's own Polydyne exceeds its acceleration limit by some per cent; on a stiff train the default exceeds it 2.2 times.
"""
MOTION_COLUMNS = ("jump_mm", "contact_force_min_N", "seating_velocity_m_per_s", "impact_velocity_m_per_s")


COLUMNS = (
    "cam",
    "limits",
    "speed_rpm",
    "area_ratio",
    "acceleration_max_mm_per_deg2",
    "acceleration_min_mm_per_deg2",
    "jerk_max_mm_per_deg3",
    "bounce_mm",
    "bounce_low_mm",
    "bounce_high_mm",
    *MOTION_COLUMNS,
    "verdict",
    "broken",
)


def compare(
    scene: Scene,
    designs: dict[str, Lift],
    out: Path | str,
    accuracy: str = "draft",
    baselines: str = "plain",
    progress: bool = False,
) -> Path:
    """Compare designs with the scene's baselines in the new folder `out`; returns it.

    `designs`: name -> lift law, each judged at the scene's listed speeds (k) [r/min]. `baselines` "plain": the
    literature's cams as their authors would draw them, for the largest area; "best": every family searched for the
    largest area within the scene's bounce limit at its listed speeds, which takes minutes and with `progress` draws a
    bar. Either under all limits of the scene and without its jerk limit. Writes comparison.csv and figures. Raises
    InputError for an unusable folder or scene, and for other words.
    """
    build_train(scene).require_linear("the comparison", "verify each cam on this scene with `camopt verify`")
    if baselines not in BASELINES:
        raise InputError(f"baselines {baselines!r}: expected {' or '.join(BASELINES)}")
    effort = accuracy_named(accuracy)
    named = {"design" if len(designs) == 1 else name: lift for name, lift in designs.items()}
    with run_folder(out, run_identity("compare", scene, baselines=baselines), worth=["comparison.csv"]) as folder:
        compare_in(folder, scene, named, {}, effort, BASELINES[baselines](scene, progress))
    return folder


def plain_baselines(scene: Scene, progress: bool = False) -> dict[str, Lift | str]:
    """Polydyne, Multi-Pol and New Design by name; a sentence where a family has no member."""
    cams: dict[str, Lift | str] = {"polydyne": _member(scene, lambda: polydyne(scene))}
    for name in SECTIONED:
        cams[name] = _member(scene, lambda name=name: read_cam(name, scene))
        if _jerk_limited(scene):
            cams[name + NO_JERK] = _member(scene, lambda name=name: read_cam(f"{name}:jerk=no", scene))
    return cams


def best_baselines(scene: Scene, progress: bool = False) -> dict[str, Lift | str]:
    """Every family's largest area within the scene's bounce limit, by name; where none holds it, the least bounce."""
    from camopt.optimizer.baselines.largest_member import largest_area_member

    limit = None if scene.design is None else scene.design.bounce_max_mm
    cams: dict[str, Lift | str] = {}
    for jerk in (True, False) if _jerk_limited(scene) else (True,):
        for name in FAMILIES:
            cams[name + ("" if jerk else NO_JERK)] = _member(
                scene,
                lambda name=name, jerk=jerk: largest_area_member(scene, name, jerk, limit, progress=progress).lift,
            )
    return cams


BASELINES = {"plain": plain_baselines, "best": best_baselines}


def _jerk_limited(scene: Scene) -> bool:
    return scene.design is not None and scene.design.jerk_max_mm_per_deg3 is not None


def _member(scene: Scene, design: Callable[[], Lift]) -> Lift | str:
    """A family's member, or why it is none to compare with: the comparison says so and goes on with the others.

    Whatever goes wrong in a family, be it a defect, costs its row alone. A member that exceeds the limits on lift,
    acceleration or duration by more than `MOST_EXCESS` is no baseline under the scene's limits.
    """
    try:
        lift = design()
    except Exception as error:
        return _sentence(error)
    assert scene.design is not None, "load_scene(..., need='design') guarantees it"
    without_jerk = scene.design.model_copy(update={"jerk_max_mm_per_deg3": None})  # its own table says what breaks it
    over, broken = excess(lift, without_jerk), broken_by_shape(lift, without_jerk)
    if over > MOST_EXCESS:
        return (
            f"{lift.family}: no cam to compare with under the limits of this scene, because its member breaks "
            f"{', '.join(broken)} by up to {over:.0%}"
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
    baselines: Mapping[str, Lift | str] | None = None,
) -> None:
    """comparison.csv and figures into a folder; cams with a verdict at the listed speeds are not verified again.

    `baselines` as `plain_baselines`, which is the default, gives them; one that has no member, or fails, gets a row
    "failed" that says why.
    The others are kept in the folder's `cams`, for the report and for `--cam`.
    """
    baselines = plain_baselines(scene) if baselines is None else baselines
    cams = designs | {name: lift for name, lift in baselines.items() if not isinstance(lift, str)}
    failed = {name: why for name, why in baselines.items() if isinstance(why, str)}
    assert scene.design is not None, "load_scene(..., need='design') guarantees it"
    rows: list[dict] = []
    for name, lift in tuple(cams.items()):
        try:
            verdict = verdicts.get(name) or verdict_on(
                scene, lift, None, EFFORTS["draft"].methods, None, effort.verdict.tolerance_um, HALVINGS
            )
        except Exception as error:
            if name in designs:
                raise
            failed[name] = _sentence(error)
            del cams[name]
            continue
        rows += comparison_rows(scene, name, lift, verdict)
    for name in cams.keys() - designs.keys():
        (folder / "cams").mkdir(exist_ok=True)
        write_design(folder / "cams" / f"{name}.json", cams[name], scene.design.max_lift_mm * MM)
    rows += [failed_row(name, why) for name, why in failed.items()]
    write_csv(folder / "comparison.csv", {key: [row[key] for row in rows] for key in COLUMNS})
    draw(folder, scene, {name: lift for name, lift in cams.items() if not name.endswith(NO_JERK)})


def failed_row(name: str, why: str) -> dict:
    """The row of a family without a cam to compare with, and its sentence."""
    limits = "no-jerk" if name.endswith(NO_JERK) else "all"
    return dict.fromkeys(COLUMNS) | {"cam": name, "limits": limits, "verdict": "failed", "broken": why}


def comparison_rows(scene: Scene, name: str, lift: Lift, verdict: Verdict) -> list[dict]:
    """One row per speed of a cam: its shape, its motion, its verdict."""
    design = scene.design
    assert design is not None, "load_scene(..., need='design') guarantees it"
    half = lift.half_duration
    low, high = (a / MM * DEG**2 for a in lift.extremes(2, -half, half))
    jerk = float(np.abs(lift.extremes(3, -half, half)).max()) / MM * DEG**3
    shape = broken_by_shape(lift, design)
    limits = "no-jerk" if "jerk_max_mm_per_deg3" in shape else "all"
    shape = [name for name in shape if name != "jerk_max_mm_per_deg3"]  # no limit in the table it is in
    rows = []
    for found in verdict.speeds:
        figures = found.as_dict()
        rows.append(
            {
                "cam": name,
                "limits": limits,
                "speed_rpm": found.speed_rpm,
                "area_ratio": lift.area_ratio_in(design),
                "acceleration_max_mm_per_deg2": high,
                "acceleration_min_mm_per_deg2": low,
                "jerk_max_mm_per_deg3": jerk,
                "bounce_mm": figures["bounce_mm"],
                "bounce_low_mm": figures["bounce_range_mm"][0],
                "bounce_high_mm": figures["bounce_range_mm"][1],
                **{key: figures[key] for key in MOTION_COLUMNS},
                "verdict": found.verdict if not shape else "rejected",
                "broken": "; ".join([*shape, *found.broken]),
            }
        )
    return rows


def draw(folder: Path, scene: Scene, cams: dict[str, Lift]) -> None:
    """The figures of a run folder, into its folder `figures`."""
    design, operation = scene.design, scene.operation
    assert design is not None and operation is not None, "load_scene(..., need=...) guarantees both"
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    tables = [(name, lift_table(lift, TABLE_STEP_DEG)) for name, lift in cams.items()]
    save(profiles(tables, design), figures, "profiles")
    motions = [m for name, lift in cams.items() for m in settled_motions(scene, name, lift)]
    if motions:
        save(valve_motion(motions, design), figures, "valve_motion")
    low, high = operation.band_rpm
    more = BEYOND_BAND * (high - low)
    speeds = np.linspace(low - more, high + more, FIGURE_SPEEDS)
    sweeps = [swept(scene, name, lift, speeds) for name, lift in cams.items()]
    save(
        bounce_against_speed(sweeps, design, operation.band_rpm, operation.speeds_rpm), figures, "bounce_against_speed"
    )
    if (folder / "history.jsonl").exists() and (folder / "design.json").exists():
        record = json.loads((folder / "design.json").read_text(encoding="utf-8"))
        history = read_history(folder)
        bound, no_jump = record["area_ratio_bound"], record["area_ratio_no_jump"]
        save(convergence(history, bound, no_jump, design.bounce_max_mm), figures, "convergence")


def settled_motions(scene: Scene, name: str, lift: Lift) -> list[Motion]:
    """A settled revolution at each listed speed; a speed at which the motion is refused is left out."""
    train = build_train(scene)
    rest = np.concatenate([rest_position(train), np.zeros(len(train.mass))])
    motions = []
    for speed in scene.operation.speeds_rpm if scene.operation else ():
        try:
            response = settle(prepare(train, lift, scene.cam_speed(speed)), rest).response
        except MotionRefused:
            continue
        motions.append(last_revolution(name, speed, response))
    return motions


def swept(scene: Scene, name: str, lift: Lift, speeds_rpm: np.ndarray) -> Sweep:
    """Bounce and jump against speed, by event-exact."""
    rows = at_speeds(prepare, scene, lift, speeds_rpm)
    bounce, jump = (np.array([row[key] for row in rows]) for key in ("bounce_mm", "jump_mm"))
    return Sweep(name, speeds_rpm, bounce, jump)


def read_history(folder: Path) -> History:
    """The steps of `history.jsonl`."""
    lines = [json.loads(line) for line in (folder / "history.jsonl").read_text(encoding="utf-8").splitlines()]
    bounce = [np.nan if line["worst_bounce_mm"] is None else line["worst_bounce_mm"] for line in lines]
    return History(
        [line["stage"] for line in lines],
        np.array([line["area_ratio"] for line in lines]),
        np.array(bounce),
        np.array([line["confirmed"] for line in lines]),
    )
