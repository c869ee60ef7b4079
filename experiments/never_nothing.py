"""Is there a scene on which `camopt optimize` ends without a cam although a plain cam of the literature keeps all
limits?

The 100 random scenes have elements of every kind, cams of 1 to 60 mm of lift, soft and stiff contacts, unequal ramps,
two-stroke timing, and low and high speeds. A built-in train, or one of `near_limit_scenes`, is scaled as a whole in
size, mass and speed, which alone changes only the scale of its motion. Then contacts, dampers, spring, gas force,
speeds and limits are varied independently, so that some trains are calm, some cannot follow any cam, and most are in
between.

In each scene the largest cams of the families are verified by `camopt.verify` at draft, the largest first, until one is
confirmed; cams that exceed a limit tenfold by event-exact are skipped. Then the command
`camopt optimize --accuracy draft --no-compare` runs, and its exit code, verdict and area are recorded. A loss is a
scene in which a family's cam is confirmed and the command ends without a confirmed cam, or with a smaller area.

It runs on `camopt.sweep`, with a store in the folder of the results, so that an interrupted run resumes.
"""

import contextlib
import io
import json
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
import tomli_w

import camopt
from camopt.cam.families.registry import FAMILIES
from camopt.cam.lift import Lift
from camopt.cam.read import read_cam
from camopt.cli.parser import main as camopt_command
from camopt.exact import settled_metrics
from camopt.measure.limits import broken_by_shape, motion_limits
from camopt.measure.sweep import at_speeds
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.baselines.comparison import member_or_sentence
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.program_cam import program_cam
from camopt.scene import InputError, MotionRefused, Scene, build_train, load_scene, parse_scene
from camopt.scene.text_file import scene_toml
from camopt.verifier.convergence import first_steps
from experiments.random_scenes import LARGEST, between
from experiments.support.near_limit_scenes import KINDS, drawn_scene
from experiments.support.record import RESULTS, called, run_script, write_result

BUILT_IN = ("exhaust-gas", "finger-hydraulic", "kodama", "motori-1", "motori-2", "pushrod-5mass", "pushrod-hydraulic",
            "race-nested")  # fmt: skip
SEED = 34
CURVED = 0.1
"""Share of the scenes whose contact at the cam is curved."""
LIFT_MM = 1.0, 60.0
TOP_RPM = 60.0, 15_000.0
DIMENSIONS = {
    "_kg": (1, 0, 0), "_N": (1, 1, 2), "_N_per_m": (1, 0, 2), "_N_s_per_m": (1, 0, 1), "_rpm": (0, 0, 1),
    "_m_per_s": (0, 1, 1), "_mm": (0, 1, 0), "_mm_per_deg": (0, 1, 0), "_mm_per_deg2": (0, 1, 0),
    "_mm_per_deg3": (0, 1, 0), "_mm_per_deg4": (0, 1, 0),
}  # fmt: skip
"""Powers of mass, length and speed in a number, by the unit at the end of its key; cam angles are not scaled."""
TABLES = {"stiffness_table": ("_mm", "_N_per_m"), "force_table": ("_mm", "_N"), "table": ("", "_N")}
LEFT_OUT = ("tolerance", "grinding", "geometry", "title", "reference")


def drawn_design(number: int) -> Scene:
    """The scene of a number; drawn again if it does not load, needs too many steps, or has no cam within its limits."""
    rng = np.random.default_rng([SEED, number])
    while True:
        data = moved(scaled(base(rng), rng), rng)
        try:
            scene = parse_scene(tomli_w.dumps({**data, "name": f"{data['name']}-{number}"}), data["name"], ("design",))
        except InputError:
            continue
        top = max(scene.required_operation.band_rpm)
        if first_steps(build_train(scene), scene.cam_speed(top)) <= LARGEST and has_a_shape(scene):
            return scene


def has_a_shape(scene: Scene) -> bool:
    """Whether any cam, free or of a family, keeps the limits on the shape."""
    design = scene.required_design
    try:
        return kinematic_optimum(design, program_cam(design, ACCURACIES["draft"].knot_deg)).area_ratio > 0
    except InputError:
        cams = (member_or_sentence(scene, name) for name in FAMILIES)
        return any(not isinstance(cam, str) and not broken_by_shape(cam, design) for cam in cams)


def base(rng: np.random.Generator) -> dict:
    """A train to start from, as the plain data of its file, without the entries LEFT_OUT."""
    number = int(rng.integers(len(BUILT_IN) + len(KINDS)))
    scene = load_scene(BUILT_IN[number]) if number < len(BUILT_IN) else drawn_scene(number - len(BUILT_IN))
    data = scene.model_dump(exclude_none=True, mode="json")
    return {key: value for key, value in data.items() if key not in LEFT_OUT}


def scaled(data: dict, rng: np.random.Generator) -> dict:
    """The same train scaled in size, mass and speed."""
    length = between(rng, LIFT_MM) / data["design"]["max_lift_mm"]
    top = max(data["operation"]["band_rpm"])
    speed = float(np.clip(top / length * between(rng, (0.3, 1.5)), *TOP_RPM)) / top
    factors = np.array([length**3 * between(rng, (0.3, 3.0)), length, speed])

    def factor(unit: str) -> float:
        return float(np.prod(factors ** np.array(DIMENSIONS[unit]))) if unit else 1.0

    def one(key: str, value):
        if key in TABLES:
            return [[part * factor(unit) for part, unit in zip(row, TABLES[key], strict=True)] for row in value]
        if isinstance(value, dict):
            return {name: one(name, inside) for name, inside in value.items()}
        if isinstance(value, list):
            return [one(key, inside) for inside in value]
        unit = max((unit for unit in DIMENSIONS if key.endswith(unit)), key=len, default="")
        return value * factor(unit) if unit and not isinstance(value, bool | str) else value

    return one("", data)


def moved(data: dict, rng: np.random.Generator) -> dict:
    """The train with contacts, dampers, gas force, speeds and limits varied independently."""
    stiff = max(e.get("stiffness_N_per_m", 0.0) for e in data["element"] if e["law"] == "linear")
    contact, damper, gas = between(rng, (0.2, 5.0)), between(rng, (0.3, 3.0)), between(rng, (0.3, 1.5))
    for element in data["element"]:
        element["damping_N_s_per_m"] *= damper
        if element["kind"] == "contact" and element.get("stiffness_N_per_m", 0.0) > 1e-2 * stiff:
            element["stiffness_N_per_m"] *= contact
    if rng.random() < CURVED:
        with_hertz_contact(data)
    for force in data["force"]:
        force["table"] = [[angle, gas * value] for angle, value in force["table"]]
    operation, design = data["operation"], data["design"]
    two_stroke = rng.random() < 0.2
    faster = between(rng, (0.5, 1.15)) * (0.5 if two_stroke else 1.0)
    operation["cam_per_crank"] *= 2.0 if two_stroke else 1.0
    for key in ("speeds_rpm", "band_rpm"):
        operation[key] = [faster * speed for speed in operation[key]]
    limits_moved(design, rng)
    return data


def with_hertz_contact(data: dict) -> None:
    """Replaces the contact at the cam by a Hertz point contact of the same stiffness under the seat's preload."""
    preload = next(e["preload_N"] for e in data["element"] if e["name"] == data["seat"])
    for element in data["element"]:
        if element["cam_driven"] and element["kind"] == "contact":
            element |= {"law": "hertz", "stiffness_N_per_m": element["stiffness_N_per_m"] ** 1.5 / preload**0.5}


def limits_moved(design: dict, rng: np.random.Generator) -> None:
    """Varies limits and ramps, with unequal ramps in three scenes of ten; some limits on the shape are removed."""
    for key, ends in (
        ("acceleration_max_mm_per_deg2", (0.8, 1.8)),
        ("acceleration_min_mm_per_deg2", (0.85, 1.6)),
        ("jerk_max_mm_per_deg3", (0.7, 2.5)),
    ):
        if key in design:
            design[key] *= between(rng, ends)
            if rng.random() < 0.15:
                del design[key]
    for key in ("bounce_max_mm", "jump_max_mm", "seating_velocity_max_m_per_s"):
        if key in design:
            design[key] *= between(rng, (0.6, 2.0))
    design["reach_max_lift"] = bool(rng.random() < 0.15)
    for key in ("closing_ramp_height_mm", "closing_ramp_velocity_mm_per_deg"):
        design.pop(key, None)
    if rng.random() < 0.3:
        design["closing_ramp_height_mm"] = design["ramp_height_mm"] * between(rng, (1.05, 1.5))
        design["closing_ramp_velocity_mm_per_deg"] = design["ramp_velocity_mm_per_deg"] * between(rng, (0.7, 1.0))


SCENES = {"small": (87,), "full": tuple(range(100))}
FAR = 10.0
"""Ratio to a limit above which a family's cam is rejected by event-exact's settled motion alone."""
SAME_AREA = 1e-9
"""Area ratio by which the delivered cam, read from its file, may differ from the same cam as it was designed."""


def main(size: str, folder: Path = RESULTS) -> dict:
    """Draws the scenes, verifies and optimises, counts, prints and writes `never_nothing.json`."""
    store = folder / "never_nothing.sqlite"
    folder.mkdir(parents=True, exist_ok=True)
    cases = ({"number": number} for number in SCENES[size])
    rows = called("experiments.never_nothing:outcome", cases, size, store)
    content = counted(rows) | {"rows": rows}
    return write_result("never_nothing", size, content, {}, folder)


def outcome(number: int) -> dict:
    """The row of a drawn scene: the best cam of the families, and the outcome of the command."""
    scene = drawn_design(number)
    design, operation = scene.required_design, scene.required_operation
    return {
        "scene": scene.name,
        "masses": len(scene.mass),
        "max_lift_mm": design.max_lift_mm,
        "top_rpm": max(operation.band_rpm),
        "unequal_ramps": design.closing_ramp_height_mm is not None,
        "two_stroke": operation.cam_per_crank == 1.0,
        **best_of_the_families(scene),
        **optimised(scene),
    }


def best_of_the_families(scene: Scene) -> dict:
    """The largest confirmed cam among the families' own, by `camopt.verify`."""
    design, cams, begin = scene.required_design, {}, time.process_time()
    for name in FAMILIES:
        with contextlib.suppress(InputError):  # a family without a member for this scene
            cams[name] = read_cam(name, scene)
    within = {name: cam for name, cam in cams.items() if not broken_by_shape(cam, design)}
    verdicts, best = {}, None
    for name in sorted(within, key=lambda name: -within[name].area_ratio_in(design)):
        far = largest_share(scene, within[name]) > FAR
        verdicts[name] = "far beyond" if far else camopt.verify(scene, within[name], accuracy="draft").verdict
        if verdicts[name] == "confirmed":
            best = name
            break
    area = within[best].area_ratio_in(design) if best else None
    spent = time.process_time() - begin
    return {"best_family": best, "family_area_ratio": area, "families": verdicts, "families_s": round(spent, 1)}


def largest_share(scene: Scene, cam: Lift) -> float:
    """The largest ratio of a metric to its limit of event-exact's settled motion from rest at the listed speeds."""
    design, operation = scene.required_design, scene.required_operation
    try:
        rows = at_speeds(settled_metrics, scene, cam, operation.speeds_rpm)
    except MotionRefused:
        return float("inf")
    limits = motion_limits(design).values()
    return max(float(limit.share(np.array([row[limit.metric] for row in rows])).max()) for limit in limits)


def optimised(scene: Scene) -> dict:
    """Exit code, verdict, family and area of `camopt optimize`; its last line where it found no cam."""
    begin, output = time.process_time(), io.StringIO()
    with tempfile.TemporaryDirectory() as work:
        file, folder = Path(work) / "scene.toml", Path(work) / "run"
        file.write_text(scene_toml(scene), encoding="utf-8")
        words = ["optimize", str(file), "--accuracy", "draft", "--no-compare", "--quiet", "--out", str(folder)]
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
            code = camopt_command(words)
        record, verdict = ({}, {}) if not (folder / "design.json").exists() else (
            json.loads((folder / name).read_text(encoding="utf-8")) for name in ("design.json", "verification.json")
        )  # fmt: skip
    return {
        "exit_code": code,
        "verdict": verdict.get("verdict"),
        "delivered_family": record.get("family"),
        "area_ratio": record.get("area_ratio"),
        "bound": record.get("area_ratio_bound"),
        "says": record.get("why_a_family") or ("" if record else output.getvalue().strip().splitlines()[-1]),
        "optimize_s": round(time.process_time() - begin, 1),
    }


def is_loss(row: dict) -> bool:
    """Whether a family's cam is confirmed and the command ends without a confirmed cam, or with a smaller one."""
    if row["best_family"] is None:
        return False
    return row["verdict"] != "confirmed" or row["area_ratio"] < row["family_area_ratio"] - SAME_AREA


def counted(rows: list[dict]) -> dict:
    """Numbers of scenes by outcome, and the losses."""
    confirmed = [row for row in rows if row["verdict"] == "confirmed"]
    return {
        "scenes": len(rows),
        "exit_codes": {str(code): count for code, count in sorted(Counter(r["exit_code"] for r in rows).items())},
        "a_family_holds": sum(row["best_family"] is not None for row in rows),
        "confirmed": len(confirmed),
        "by_the_search": sum(row["delivered_family"] == "free" for row in confirmed),
        "by_a_family": sum(row["delivered_family"] != "free" for row in confirmed),
        "of_the_search_alone": sum(row["best_family"] is None for row in confirmed),
        "neither": sum(row["best_family"] is None and row["verdict"] != "confirmed" for row in rows),
        "losses": [row for row in rows if is_loss(row)],
    }


if __name__ == "__main__":
    run_script(main, __doc__)
