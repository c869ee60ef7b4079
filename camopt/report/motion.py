"""The simulated motion behind the report's animation: settled revolutions of the run's cams, as plain numbers."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from camopt.cam.design_file import read_design
from camopt.cam.geometry import contact
from camopt.cam.lift import Lift
from camopt.measure.settling import Settled
from camopt.optimizer.baselines.comparison_table import FAILED, verdicts_in
from camopt.optimizer.baselines.figures import settled_motion, stated_periodic
from camopt.plots.style import DESIGN, family_of, page_line
from camopt.report.drawing import BASE_MM, drawing, drawn_follower, room_for
from camopt.report.folder import RunFolder
from camopt.report.wording import as_number, shown
from camopt.scene import InputError, MotionRefused, Scene, Train, build_train, load_scene
from camopt.scene.quantities import is_number
from camopt.scene.schema import SIMULATED
from camopt.scene.units import DEG, MM, UM
from camopt.study.simulate.dataset import resampled

STEPS_DEG = (0.5, 1.0, 2.0, 5.0)
MOST_NUMBERS = 400_000
"""Largest number of values in the page's motions, about 2 MB; the finest step of `STEPS_DEG` within it is used."""
SAME_AREA = 1e-6
"""Largest difference of area ratios that still counts as the same cam; comparison.csv holds all digits."""


@dataclass(frozen=True)
class RunCams:
    """The scene of a run folder, its cams that can be rebuilt, and a sentence for each cam that cannot."""

    scene: Scene | None
    lifts: dict[str, Lift]
    left_out: list[str]
    verdicts: dict[str, dict] = field(default_factory=dict)  # by cam, in the form of verification.json


def cams_of(folder: Path, run: RunFolder) -> RunCams:
    """The design, and the cams of the comparison that the folder holds as `cams/<name>.json`, in the form of
    design.json, and whose area ratio is the recorded one."""
    if "scene.toml" in run.missing or "design.json" in run.missing:
        return RunCams(None, {}, ["Without scene.toml and design.json no cam can be simulated."])
    try:
        scene = load_scene(folder / "scene.toml", need=SIMULATED)
    except InputError as error:
        return RunCams(None, {}, [f"The scene cannot be simulated: {error}"])
    recorded, left_out = {DESIGN: run.design.get("area_ratio")}, []
    for row in run.comparison:
        if row.get("verdict") == FAILED:
            left_out.append(f"{row['cam']} has no member within the limits.")
        elif family_of(row["cam"]) != DESIGN:
            recorded.setdefault(row["cam"], as_number(row.get("area_ratio", "")))
    stored = {path.stem: path for path in (folder / "cams").glob("*.json")} | {DESIGN: folder / "design.json"}
    lifts = {}
    for name, area in recorded.items():
        try:
            if name not in stored:
                raise InputError(f"the run folder does not hold its lift, cams/{name}.json")
            lift = read_design(stored[name], scene)
            ratio = lift.area_ratio_in(scene.required_design)
            if not is_number(area) or abs(ratio - area) > SAME_AREA:
                raise InputError(f"its area ratio comes out as {shown(ratio, 6)}, the run recorded {shown(area, 6)}")
            lifts[name] = lift
        except InputError as error:
            left_out.append(f"{name} is not simulated here: {error}")
            if name == DESIGN:
                break  # other cams alone would be mistaken for the run's result
    verdicts = {DESIGN: run.verification} | verdicts_in(folder)
    return RunCams(scene, lifts, left_out, verdicts)


def animation(cams: RunCams) -> tuple[dict | None, list[str]]:
    """The data that the page's script draws (None without a motion), and sentences on the motions that are left out.

    `drawing` is the layout of the train; `cams` holds contour, lift and motions of each cam. A motion has position_um
    (mass by angle), valve_mm_per_s (by angle), force_N and separation_um (contact by angle), from -180 to 180 deg.
    Event-exact computes it: the settled revolution or, where `periodic` is False, the last one that was computed.
    """
    scene, left_out = cams.scene, list(cams.left_out)
    if scene is None or not cams.lifts:
        return None, left_out
    train, speeds = build_train(scene), scene.operation.speeds_rpm if scene.operation else ()
    per_sample = (len(train.mass) + 1 + 2 * int(train.contact.sum())) * len(cams.lifts) * len(speeds)
    step = next((s for s in STEPS_DEG if per_sample * 360 / s <= MOST_NUMBERS), STEPS_DEG[-1])
    entries = []
    for name, lift in cams.lifts.items():
        try:
            cam = cam_entry(name, lift, scene, step)
        except InputError as error:
            left_out.append(f"{name} is not shown: {error}")
            continue
        motions, stated = [], stated_periodic(cams.verdicts.get(name, {}))
        for speed in speeds:
            try:
                settled = settled_motion(train, lift, scene.cam_speed(speed), stated.get(speed), round(360 / step))
                motions.append({"speed_rpm": speed, **last_revolution_numbers(settled, step)})
            except (MotionRefused, InputError) as error:
                left_out.append(f"{name} at {shown(speed)} r/min is not shown: {error}")
        if motions:
            entries.append({"name": name, **cam, "motions": motions})
    return (animated(scene, train, entries, step) if entries else None), left_out


def animated(scene: Scene, train: Train, entries: list[dict], step_deg: float) -> dict:
    """The data that `animation.js` draws for `entries`, which are cams with motions; see `animation`."""
    contacts = np.flatnonzero(train.contact).tolist()
    x = np.concatenate([np.array(m["position_um"]).T for c in entries for m in c["motions"]]) * UM / MM
    radius = max(np.hypot(*np.array(c["contour_mm"]).T).max() for c in entries)
    follower = drawn_follower(scene.geometry)
    return {
        "step_deg": step_deg,
        "drawing": drawing(train, x, room_for(follower, float(radius))),
        **follower,
        "contacts": contacts,
        "seat": contacts.index(train.seat),
        "cams": entries,
    }


def last_revolution_numbers(settled: Settled, step_deg: float) -> dict:
    """The last revolution of a motion, sampled every `step_deg`; its numbers are rounded to what a drawing resolves."""
    steps, contacts = round(360 / step_deg), np.flatnonzero(settled.response.train.contact).tolist()
    record = resampled(settled.response, steps * settled.response.revolutions)
    last = slice(-steps - 1, None)
    return {
        "periodic": settled.periodic,
        "position_um": _rounded(record.x[last].T / UM, 0),
        "valve_mm_per_s": _rounded(record.v[last, record.train.valve] / MM, 0),
        "force_N": _rounded(record.force[last][:, contacts].T, 1),
        "separation_um": _rounded(np.array([record.separation(e)[last] for e in contacts]) / UM, 1),
    }


def cam_entry(name: str, lift: Lift, scene: Scene, step_deg: float) -> dict:
    """A cam's line style, its lift [um] by angle and its contour [mm]. The nose points towards +y and the cam angle
    increases to the right of it (mirrored where `turn` of `drawn_follower` is -1). Without [geometry] the contour is
    that of a pointed follower on a base circle of BASE_MM."""
    theta = np.linspace(-180, 180, round(360 / step_deg) + 1) * DEG
    if scene.geometry is None:
        angle = np.linspace(-np.pi, np.pi, 361)
        radius = BASE_MM + lift(angle) / MM
        contour = np.stack([radius * np.sin(angle), radius * np.cos(angle)], axis=1)
    else:
        contour = contact(lift, scene.geometry, np.linspace(-np.pi, np.pi, 721)).contour[:, ::-1] / MM
        contour[:, 0] *= drawn_follower(scene.geometry)["turn"]
    return {
        **page_line(name),
        "lift_um": _rounded(lift(theta) / UM, 0),
        "contour_mm": _rounded(contour, 3),
    }


def _rounded(values: np.ndarray, digits: int) -> list:
    """Nested lists of rounded numbers; integers where `digits` is 0."""
    rounded = np.round(values, digits) + 0.0  # no negative zeros
    return (rounded if digits else rounded.astype(int)).tolist()
