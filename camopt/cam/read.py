"""CAM as the user names one: a family with parameters, a lift table, a run folder or its design.json."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from camopt.cam.design_file import read_design
from camopt.cam.lift import Lift
from camopt.scene import InputError, Scene
from camopt.scene.spelling import did_you_mean
from camopt.scene.text_file import excerpt, usable_path
from camopt.scene.units import MM

DESIGN_FILE = "design.json"
LEAST, MOST = 1e-6, 1e6
"""Smallest size of a parameter but zero, and its largest, in field units: beyond them arithmetic fails, not cams."""
LIFT_SLACK = 1e-6 * MM
"""Lift [m] below the base circle or above the maximum that rounding explains."""


def number(text: str) -> float:
    """A number of a size that a cam may have."""
    value = float(text)
    if not (value == 0 or LEAST <= abs(value) <= MOST):
        raise ValueError(f"zero or a size from {LEAST:g} to {MOST:g} is needed")
    return value


def numbers(text: str) -> tuple[float, ...]:
    """Numbers between slashes, as in 2/10/18."""
    return tuple(number(part) for part in text.split("/"))


def yes_or_no(text: str) -> bool:
    """yes or no."""
    if text not in ("yes", "no"):
        raise ValueError("yes or no is needed")
    return text == "yes"


SIZE = f"of a size from {LEAST:g} to {MOST:g}, or zero"
EXPECTED = {number: f"a number {SIZE}", numbers: f"numbers like 2/10/18, each {SIZE}", yes_or_no: "yes or no"}


@dataclass(frozen=True)
class Family:
    """Where a family is designed, and its parameters: name on the command line -> (keyword, parser).

    `table` names the module's `SectionTable` where the family has one; with it, and STARTS beside it, the family is
    differentiable and searched for its best member without another line.
    """

    module: str
    function: str
    parameters: dict[str, tuple[str, Callable[[str], object]]]
    table: str = ""


FAMILIES = {
    "polydyne": Family(
        "camopt.cam.families.polydyne",
        "polydyne",
        {
            "exponents": ("exponents", numbers),
            "speed_rpm": ("design_speed_rpm", number),
            "ramp_height_mm": ("ramp_height_mm", number),
        },
    ),
    "multi-pol": Family(
        "camopt.cam.families.multi_pol",
        "multi_pol",
        {
            "sections_deg": ("sections_deg", numbers),
            "a12_mm_per_deg2": ("a12", number),
            "a45_mm_per_deg2": ("a45", number),
            "j34_mm_per_deg3": ("j34", number),
            "j45_mm_per_deg3": ("j45", number),
            "jerk": ("jerk", yes_or_no),
        },
        "TABLE_1",
    ),
    "new-design": Family(
        "camopt.cam.families.new_design",
        "new_design",
        {
            "sections_deg": ("sections_deg", numbers),
            "a12_mm_per_deg2": ("a12", number),
            "a34_mm_per_deg2": ("a34", number),
            "j34_mm_per_deg3": ("j34", number),
            "j23_mm_per_deg3": ("j23", number),
            "start_ratio": ("start_ratio", number),
            "quintic": ("quintic", yes_or_no),
            "jerk": ("jerk", yes_or_no),
        },
    ),
    "exponent": Family("camopt.cam.families.exponent", "exponent", {"exponents": ("exponents", numbers)}),
    "kurz": Family(
        "camopt.cam.families.kurz",
        "kurz",
        {"sections_deg": ("sections_deg", numbers), "a23_mm_per_deg2": ("a23", number), "jerk": ("jerk", yes_or_no)},
        "TABLE",
    ),
    "trapezoid": Family(
        "camopt.cam.families.trapezoid",
        "trapezoid",
        {"sections_deg": ("sections_deg", numbers), "jerk": ("jerk", yes_or_no)},
        "TABLE",
    ),
    "cycloidal": Family("camopt.cam.families.dwell", "cycloidal", {}),
    "3-4-5": Family("camopt.cam.families.dwell", "polynomial_345", {}),
    "4-5-6-7": Family("camopt.cam.families.dwell", "polynomial_4567", {}),
}


def read_cam(
    spec: str | Path,
    scene: Scene,
    table_angle: str | None = None,
    table_lift: str | None = None,
    table_ratio: float | None = None,
) -> Lift:
    """The lift law that `spec` names, under a scene with [operation] and [design].

    A family name, optionally with parameters (`polydyne:exponents=2/10/18/26/34,speed_rpm=6000`); a run folder or its
    design.json; or a lift table, for which see `camopt.cam.tables.lift_table.read_lift_table`. A file whose name is a
    family's is reached as ./name. Raises InputError for anything else.
    """
    name = str(spec).partition(":")[0]
    if name in FAMILIES and not isinstance(spec, Path):
        return _member(str(spec), scene)
    path = usable_path(spec, "cam")
    if str(spec) and path.is_dir():
        if not (path / DESIGN_FILE).is_file():
            raise InputError(f"cam {excerpt(str(spec))}: the folder holds no {DESIGN_FILE}; give a camopt run folder")
        return read_design(path / DESIGN_FILE, scene)
    if not path.is_file():
        raise InputError(
            f"cam {excerpt(str(spec))}: neither a family ({', '.join(FAMILIES)}) nor a lift table, design.json or run "
            f"folder{did_you_mean(name, FAMILIES)}"
        )
    if path.suffix == ".json":
        return read_design(path, scene)
    from camopt.cam.tables.lift_table import read_lift_table  # brings SciPy's splines, which nothing else here needs

    return read_lift_table(path, scene, table_angle, table_lift, table_ratio)


def _member(spec: str, scene: Scene) -> Lift:
    """The member of a family; InputError where its parameters lead out of the scene's lift."""
    name, keywords = family_and_keywords(spec)
    family = FAMILIES[name]  # its module is imported only now
    lift: Lift = getattr(import_module(family.module), family.function)(scene, **keywords)
    assert scene.design is not None, "load_scene(..., need='design') guarantees it"
    low, high = lift.extremes(0)
    if low < -LIFT_SLACK or high > scene.design.max_lift_mm * MM + LIFT_SLACK:
        raise InputError(
            f"cam {excerpt(str(spec))}: its lift would go from {low / MM:.4g} to {high / MM:.4g} mm and must stay "
            f"between 0 and max_lift_mm = {scene.design.max_lift_mm:g}: give other parameters"
        )
    return lift


def family_and_keywords(spec: str) -> tuple[str, dict[str, Any]]:
    """The name of a family and its parameters as keywords of its function; InputError for unknown or unusable ones."""
    name, _, text = spec.partition(":")
    if name not in FAMILIES:
        raise InputError(
            f"cam {excerpt(spec)}: not a family: expected {', '.join(FAMILIES)}{did_you_mean(name, FAMILIES)}"
        )
    family, keywords = FAMILIES[name], {}
    for item in filter(None, text.split(",")):
        key, equals, value = item.partition("=")
        if key not in family.parameters or not equals:
            known = ", ".join(f"{k}=..." for k in family.parameters)
            expected = f"expected {known}" if known else "this family has none"
            meant = did_you_mean(key, family.parameters)
            raise InputError(f"cam {name}: parameter {excerpt(item)}: {expected}{meant}")
        keyword, parse = family.parameters[key]
        if keyword in keywords:
            raise InputError(f"cam {name}: parameter {key!r} is given more than once")
        try:
            keywords[keyword] = parse(value)
        except ValueError:
            raise InputError(f"cam {name}: {key}={excerpt(value)}: expected {EXPECTED[parse]}") from None
    return name, keywords
