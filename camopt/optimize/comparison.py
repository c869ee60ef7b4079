"""Designs beside the cams of the literature: `comparison.csv` and the figures of a run folder."""

import json
from pathlib import Path

import numpy as np

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift, lift_table
from camopt.exact.engine import prepare
from camopt.optimize.accuracy import Accuracy, accuracy_named
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
from camopt.scene.errors import MotionRefused
from camopt.scene.rest import rest_position
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.scene.units import DEG, MM
from camopt.storage import create_run_folder, write_csv
from camopt.verify.effort import EFFORTS
from camopt.verify.limits import broken_by_shape
from camopt.verify.settle import settle
from camopt.verify.sweep import at_speeds
from camopt.verify.verdict import Verdict, verify

FIGURE_SPEEDS = 61
BEYOND_BAND = 0.1
"""How far, relative to its width, the figure shows speeds outside the band."""
TABLE_STEP_DEG = 0.1
MOTION_COLUMNS = ("jump_mm", "contact_force_min_N", "seating_velocity_m_per_s", "impact_velocity_m_per_s")


def compare(scene: Scene, designs: dict[str, Lift], out: Path | str, accuracy: str = "draft") -> Path:
    """Compare designs with the scene's baselines in the new folder `out`; returns it.

    `designs`: name -> lift law. Writes comparison.csv and figures.
    """
    build_train(scene).require_linear("the comparison", "verify each cam on this scene with `camopt verify`")
    folder = create_run_folder(out)
    named = {"design" if len(designs) == 1 else name: lift for name, lift in designs.items()}
    compare_in(folder, scene, named, {}, accuracy_named(accuracy))
    return folder


def baselines(scene: Scene) -> dict[str, Lift]:
    """The cams of the literature that a design is compared with, by name."""
    return {"polydyne": polydyne(scene)}


def compare_in(
    folder: Path, scene: Scene, designs: dict[str, Lift], verdicts: dict[str, Verdict], effort: Accuracy
) -> None:
    """comparison.csv and figures into a folder; cams with a verdict at the listed speeds are not verified again."""
    cams = designs | baselines(scene)
    rows: list[dict] = []
    for name, lift in cams.items():
        verdict = verdicts.get(name) or verify(
            scene, lift, None, EFFORTS["draft"].methods, None, effort.verdict.tolerance_um
        )
        rows += comparison_rows(scene, name, lift, verdict)
    write_csv(folder / "comparison.csv", {key: [row[key] for row in rows] for key in rows[0]})
    draw(folder, scene, cams)


def comparison_rows(scene: Scene, name: str, lift: Lift, verdict: Verdict) -> list[dict]:
    """One row per speed of a cam: its shape, its motion, its verdict."""
    design = scene.design
    assert design is not None, "load_scene(..., need='design') guarantees it"
    half = lift.half_duration
    low, high = (a / MM * DEG**2 for a in lift.extremes(2, -half, half))
    jerk = float(np.abs(lift.extremes(3, -half, half)).max()) / MM * DEG**3
    shape = broken_by_shape(lift, design)
    rows = []
    for found in verdict.speeds:
        figures = found.as_dict()
        rows.append(
            {
                "cam": name,
                "limits": "no-jerk" if "jerk_max_mm_per_deg3" in shape else "all",
                "speed_rpm": found.speed_rpm,
                "area_ratio": lift.area_ratio(design.max_lift_mm * MM),
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
