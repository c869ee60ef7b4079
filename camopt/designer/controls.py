"""The numbers of a scene that the designer's user can change, and the changed scene, checked like a scene file."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import floor, log10
from typing import Any

from camopt.scene import InputError, Scene, build_train
from camopt.scene.design import Design
from camopt.scene.faults import checked
from camopt.scene.parameters import RATE, SceneNumber, number_of, valve_spring, with_numbers, with_spring
from camopt.scene.schema import SIMULATED
from camopt.scene.table import LARGEST
from camopt.scene.text_file import excerpt

NO_JUMP, KINEMATIC = "no-jump", "kinematic"
PROGRAMS = (NO_JUMP, KINEMATIC)
"""The linear programs by which the cam can be designed."""
STEPS = 200
"""Smallest number of steps of a slider."""
LONGEST_KEY = 80
"""Largest number of characters of an unknown key that the answer repeats."""
BAND, ERROR = ("band_low_rpm", "band_high_rpm"), "grinding_error_um"


class Refused(InputError):
    """Numbers that are not a valid scene; `faults` holds sentences by the key of their control, "" for several ones."""

    def __init__(self, faults: Mapping[str, str]):
        super().__init__("; ".join(f"{key}: {sentence}" if key else sentence for key, sentence in faults.items()))
        self.faults = dict(faults)


@dataclass(frozen=True)
class Control:
    """One number that may be changed: `key` is its name, and `value` that of the scene, None where it sets none."""

    key: str
    label: str
    unit: str
    group: str
    value: Any
    low: float = 0.0
    high: float = 0.0
    step: float = 0.0
    optional: bool = False
    usual: float | None = None  # start value of an optional number when it is switched on
    choices: tuple[str, ...] = ()


DESIGN = {
    "duration_deg": ("Duration", "deg", "Cam", 144.0),
    "max_lift_mm": ("Maximum lift", "mm", "Cam", 9.4),
    "ramp_height_mm": ("Ramp height", "mm", "Ramps", 0.25),
    "ramp_velocity_mm_per_deg": ("Ramp velocity", "mm/deg", "Ramps", 0.011),
    "ramp_foot_deg": ("Ramp foot", "deg", "Ramps", 10.0),
    "closing_ramp_height_mm": ("Closing ramp height", "mm", "Ramps", 0.25),
    "closing_ramp_velocity_mm_per_deg": ("Closing ramp velocity", "mm/deg", "Ramps", 0.011),
    "acceleration_max_mm_per_deg2": ("Acceleration, largest", "mm/deg²", "Limits on the cam", 0.015),
    "acceleration_min_mm_per_deg2": ("Acceleration, smallest", "mm/deg²", "Limits on the cam", -0.008),
    "jerk_max_mm_per_deg3": ("Jerk", "mm/deg³", "Limits on the cam", 0.003),
    "snap_max_mm_per_deg4": ("Snap", "mm/deg⁴", "Limits on the cam", 0.001),
    "nose_deg": ("Nose without positive acceleration", "± deg", "Limits on the cam", 40.0),
    "bounce_max_mm": ("Bounce", "mm", "Limits on the motion", 0.05),
    "jump_max_mm": ("Jump", "mm", "Limits on the motion", 0.05),
    "jump_max_deg": ("Jump angle", "deg", "Limits on the motion", 10.0),
    "seating_velocity_max_m_per_s": ("Seating velocity", "m/s", "Limits on the motion", 0.8),
    "contact_force_min_N": ("Contact force, least", "N", "Limits on the motion", 20.0),
    "contact_force_max_N": ("Contact force, largest", "N", "Limits on the motion", 4000.0),
}
"""By key of the design: label, unit, group, and a usual value for a scene that sets none."""


def controls(scene: Scene) -> tuple[Control, ...]:
    """The controls of a scene, in the order of the page."""
    design, operation = scene.required_design, scene.required_operation
    low, high = operation.band_rpm
    middle = float(sorted(operation.speeds_rpm)[len(operation.speeds_rpm) // 2])
    view = [
        Control("program", "Linear program", "", "Cam", NO_JUMP, choices=PROGRAMS),
        Control("margin_N", "Contact force that the program keeps", "N", "Cam", 0.0, -200.0, 200.0, 1.0),
    ]
    shape = []
    for key, (label, unit, group, usual) in DESIGN.items():
        value = getattr(design, key)
        optional = not Design.model_fields[key].is_required() and key != "ramp_foot_deg"
        number = usual if value is None else value
        shape.append(Control(key, label, unit, group, value, *_about(number or usual), optional=optional, usual=number))
    reach = Control("reach_max_lift", "Maximum lift must be reached", "", "Cam", design.reach_max_lift)
    speeds = [
        Control("speed_rpm", "Speed shown", "r/min", "Speed", middle, *_ranged(low * 0.5, high * 1.2)),
        Control("band_low_rpm", "Band from", "r/min", "Speed", float(low), *_about(low)),
        Control("band_high_rpm", "Band to", "r/min", "Speed", float(high), *_about(high)),
    ]
    scatter = [
        Control(key, label, unit, "Tolerances", width, *_about(width), optional=True, usual=width)
        for key, (label, unit, width) in _widths(scene).items()
    ]
    return (*view, *shape[:2], reach, *shape[2:], *speeds, *_of_train(scene), *scatter)


def _of_train(scene: Scene) -> list[Control]:
    """Controls of the rate and preload of the valve spring, in per cent of the scene's, and of the lash."""
    listed = []
    try:
        spring = valve_spring(scene)
    except InputError:
        spring = []
    if any(number_of(e, RATE) for e in scene.element if e.name in spring):
        listed.append(Control("spring_rate_percent", "Spring rate", "% of the scene's", "Train", 100.0, *_about(100.0)))
    if spring:
        label = "Spring preload, with the seat's"
        listed.append(Control("spring_preload_percent", label, "% of the scene's", "Train", 100.0, *_about(100.0)))
    gap = scene.element[lash_element(scene)].gap_mm
    if gap > 0:
        listed.append(Control("lash_mm", "Lash", "mm", "Train", gap, *_about(gap)))
    return listed


def lash_element(scene: Scene) -> int:
    """Index of the element with the lash: the largest gap among the contacts between cam and valve."""
    return max(build_train(scene).cam_side, key=lambda e: scene.element[e].gap_mm)


def _widths(scene: Scene) -> dict[str, tuple[str, str, float]]:
    """Label, unit and width of every tolerance and of the grinding error, by the key of its control."""
    widths = {}
    for row in scene.tolerance:
        unit, width = ("in its unit", row.plus_minus) if row.relative is None else ("of the number", row.relative)
        widths[f"tolerance.{row.label}"] = f"Tolerance: {row.label}", unit, width
    return widths | ({} if scene.grinding is None else {ERROR: ("Grinding error", "µm", scene.grinding.error_um)})


def _about(value: float) -> tuple[float, float, float]:
    """Lower end, upper end and step of a slider about a number: from half to double its value."""
    return _ranged(*sorted((0.5 * value, 2.0 * value)))


def _ranged(low: float, high: float) -> tuple[float, float, float]:
    """The range widened to whole steps, and a step of 1, 2 or 5 of some power of ten."""
    rough = (high - low) / STEPS
    power = 10.0 ** floor(log10(rough))
    step = next(power * digit for digit in (5.0, 2.0, 1.0) if power * digit <= rough * (1 + 1e-9))
    first, last = floor(low / step + 1e-9), -floor(-high / step + 1e-9)
    return float(f"{first * step:.12g}"), float(f"{last * step:.12g}"), float(f"{step:.12g}")


def read_values(controls: Mapping[str, Control], values: Mapping[str, Any]) -> dict[str, Any]:
    """Every control's value by key: the given one, else the scene's. Raises Refused with a sentence by key."""
    faults = {str(key)[:LONGEST_KEY]: "unknown key" for key in values if key not in controls}
    numbers = {}
    for key, control in controls.items():
        value = values.get(key, control.value)
        sentence = _fault(control, value)
        if sentence:
            faults[key] = sentence
        else:
            numbers[key] = float(value) if isinstance(value, int) and not isinstance(value, bool) else value
    if not faults and not numbers["speed_rpm"] > 0:
        faults["speed_rpm"] = "a speed above 0 r/min is needed"
    if faults:
        raise Refused(faults)
    return numbers


def _fault(control: Control, value: Any) -> str:
    """The reason why a value is invalid for this control; empty where it is valid."""
    if control.choices:
        return "" if value in control.choices else f"expected one of {', '.join(control.choices)}"
    if isinstance(control.value, bool):
        return "" if isinstance(value, bool) else "expected true or false"
    if value is None:
        return "" if control.optional else "a number is needed"
    usable = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST
    return "" if usable else f"expected a number (given: {excerpt(str(value))})"


def edited_scene(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """The scene with the values of `read_values`; raises Refused where the schema refuses them."""
    for key, least in (("spring_rate_percent", 1.0), ("spring_preload_percent", 0.0), ("lash_mm", 0.0)):
        if values.get(key, least) < least:
            raise Refused({key: f"must be at least {least:g}"})
    edited = _with_train(scene, values)
    design = edited.required_design.model_copy(update={key: values[key] for key in (*DESIGN, "reach_max_lift")})
    operation = edited.required_operation.model_copy(update={"band_rpm": tuple(values[key] for key in BAND)})
    edited = edited.model_copy(update={"design": design, "operation": operation, **_as_built(scene, values)})
    data = edited.model_dump(exclude_none=True, exclude_defaults=True)
    checked_scene, faults = checked(data, SIMULATED)
    if checked_scene is None or faults:
        raise Refused(_by_key(faults))
    return checked_scene


def _with_train(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """The scene with the spring and the lash of the values."""
    factors = [values.get(f"spring_{number}_percent", 100.0) / 100.0 for number in ("rate", "preload")]
    if factors != [1.0, 1.0]:
        scene = with_spring(scene, *factors)
    lash = SceneNumber("element", lash_element(scene), "gap_mm")
    if values.get("lash_mm", lash.of(scene)) == lash.of(scene):
        return scene
    return with_numbers(scene, {lash: values["lash_mm"]})


def _as_built(scene: Scene, values: Mapping[str, Any]) -> dict[str, Any]:
    """Tolerances and grinding error of the values; those that are switched off are left out."""
    tolerances = []
    for row in scene.tolerance:
        if (width := values[f"tolerance.{row.label}"]) is not None:
            key = "plus_minus" if row.relative is None else "relative"
            tolerances.append(row.model_copy(update={key: width}))
    error = values.get(ERROR)
    ground = None if scene.grinding is None or error is None else scene.grinding.model_copy(update={"error_um": error})
    return {"tolerance": tuple(tolerances), "grinding": ground}


def _by_key(faults: list[str]) -> dict[str, str]:
    """The schema's sentences by the key of their control; those of several controls share the empty key."""
    by_key: dict[str, list[str]] = {}
    for fault in faults:
        place, _, sentence = fault.partition(": ")
        table, _, key = place.partition(".")
        control = key if table == "design" and key in DESIGN else BAND[1] if place == "operation.band_rpm" else ""
        by_key.setdefault(control, []).append(sentence if control else fault)
    return {key: "; ".join(sentences) for key, sentences in by_key.items()}
