"""Scenes drawn for `never_nothing`: trains with every element, of any size and speed, with the limits of a design.

A built-in train, or one of `near_limit_scenes`, is made larger or smaller, heavier or lighter and faster or slower as a
whole, which alone changes no motion but its scale. Then contacts, dampers, spring, gas, speeds and limits move on their
own, so that some trains are calm, some follow no cam at all, and most lie between.
"""

import numpy as np
import tomli_w

from camopt.cam.families.registry import FAMILIES
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.baselines.comparison import member_or_sentence
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.program_cam import program_cam
from camopt.scene import InputError, Scene, build_train, load_scene, parse_scene
from camopt.verifier.convergence import first_steps
from experiments.support.drawn_scenes import LARGEST, between
from experiments.support.near_limit_scenes import KINDS, drawn_scene

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
"""Powers of mass, length and speed in a number, by the unit at the end of its key: cam angles have no scale."""
TABLES = {"stiffness_table": ("_mm", "_N_per_m"), "force_table": ("_mm", "_N"), "table": ("", "_N")}
LEFT_OUT = ("tolerance", "grinding", "geometry", "title", "reference")


def drawn_design(number: int) -> Scene:
    """The scene of a number. Draws that do not load, that no method could begin, or whose limits on the shape let no
    cam through, are drawn again."""
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
    """Whether any cam, free or of a family, holds the limits on the shape."""
    design = scene.required_design
    try:
        return kinematic_optimum(design, program_cam(design, ACCURACIES["draft"].knot_deg)).area_ratio > 0
    except InputError:
        cams = (member_or_sentence(scene, name) for name in FAMILIES)
        return any(not isinstance(cam, str) and not broken_by_shape(cam, design) for cam in cams)


def base(rng: np.random.Generator) -> dict:
    """A train to begin with, as the plain data of its file, without what only says how trains differ."""
    number = int(rng.integers(len(BUILT_IN) + len(KINDS)))
    scene = load_scene(BUILT_IN[number]) if number < len(BUILT_IN) else drawn_scene(number - len(BUILT_IN))
    data = scene.model_dump(exclude_none=True, mode="json")
    return {key: value for key, value in data.items() if key not in LEFT_OUT}


def scaled(data: dict, rng: np.random.Generator) -> dict:
    """The same train in another size, of other masses, at other speeds."""
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
    """The train with contacts, dampers, preload, gas, speeds and limits changed on their own."""
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
    """Makes the contact at the cam a point contact (Hertz) that is as stiff as before under the seat's preload."""
    preload = next(e["preload_N"] for e in data["element"] if e["name"] == data["seat"])
    for element in data["element"]:
        if element["cam_driven"] and element["kind"] == "contact":
            element |= {"law": "hertz", "stiffness_N_per_m": element["stiffness_N_per_m"] ** 1.5 / preload**0.5}


def limits_moved(design: dict, rng: np.random.Generator) -> None:
    """Other limits and ramps, unequal ones in three scenes of ten; some limits on the shape are left out."""
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
