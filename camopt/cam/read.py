"""The cam that a user names: a family with parameters, a lift table, a run folder or its design.json."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from camopt.cam.design_file import read_design
from camopt.cam.families.record import EXPECTED, family_named
from camopt.cam.families.registry import FAMILIES
from camopt.cam.lift import Lift
from camopt.scene import InputError, Scene
from camopt.scene.errors import did_you_mean
from camopt.scene.text_file import excerpt, usable_path
from camopt.scene.units import MM

DESIGN_FILE = "design.json"
FILES = (".csv", ".dat", ".dvl", ".json", ".svl", ".tsv", ".txt")
"""Endings of names that mean a file and not a family."""
LIFT_SLACK = 1e-6 * MM
"""Lift [m] below the base circle or above the maximum that counts as rounding."""


def read_cam(
    spec: str | Path,
    scene: Scene,
    table_angle: str | None = None,
    table_lift: str | None = None,
    table_ratio: float | None = None,
    table_probe_mm: float | None = None,
    *,
    table_first_line: int | None = None,
    table_columns: Sequence[str | int] | None = None,
) -> Lift:
    """The lift law that `spec` names, under a scene with [operation] and [design].

    It names a family, optionally with parameters (`polydyne:exponents=2/10/18/26/34,speed_rpm=6000`), a run folder or
    its design.json, or a lift table, for which see `camopt.cam.tables.lift_table.read_lift_table`. A file with the name
    of a family is given as ./name. Raises InputError for anything else.
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
        if path.suffix.lower() in FILES or (path.parent != Path(".") and not did_you_mean(Path(name).name, FAMILIES)):
            raise InputError(f"cam {excerpt(str(spec))}: there is no such file or folder: check the path")
        if name in FAMILIES:
            raise InputError(
                f"cam {excerpt(str(spec))}: a family; expected a run folder, its design.json or a lift table"
            )
        raise InputError(
            f"cam {excerpt(str(spec))}: neither a family ({', '.join(FAMILIES)}) nor a lift table, design.json or run "
            f"folder{did_you_mean(Path(name).name, FAMILIES)}"
        )
    if path.suffix == ".json":
        return read_design(path, scene)
    from camopt.cam.tables.lift_table import read_lift_table  # loads SciPy's splines

    text = {"table_first_line": table_first_line, "table_columns": table_columns}
    return read_lift_table(path, scene, table_angle, table_lift, table_ratio, table_probe_mm, **text)


def _member(spec: str, scene: Scene) -> Lift:
    """The member of a family. Raises InputError if its lift leaves the range of the scene."""
    name, keywords = family_and_keywords(spec)
    design = family_named(name).design
    assert design is not None, "as every family of FAMILIES"
    lift = design(scene, **keywords)
    (low, high), most = lift.extremes(0), scene.required_design.max_lift_mm
    if low < -LIFT_SLACK or high > most * MM + LIFT_SLACK:
        raise InputError(
            f"cam {excerpt(str(spec))}: its lift would go from {low / MM:.4g} to {high / MM:.4g} mm and must stay "
            f"between 0 and max_lift_mm = {most:g}: give other parameters"
        )
    return lift


def family_and_keywords(spec: str) -> tuple[str, dict[str, Any]]:
    """The name of a family and its parameters as keywords of its function. Raises InputError for unusable ones."""
    name, _, text = spec.partition(":")
    if name not in FAMILIES:
        raise InputError(
            f"cam {excerpt(spec)}: not a family: expected {', '.join(FAMILIES)}{did_you_mean(name, FAMILIES)}"
        )
    family, keywords = family_named(name), {}
    for item in filter(None, text.split(",")):
        key, equals, value = item.partition("=")
        if key not in family.parameters or not equals:
            usage = ", ".join(f"{k}=..." for k in family.parameters)
            expected = f"expected {usage}" if usage else "this family has none"
            meant = did_you_mean(key, family.parameters)
            raise InputError(f"cam {name}: parameter {excerpt(item)}: {expected}{meant}")
        keyword, parse, _ = family.parameters[key]
        if keyword in keywords:
            raise InputError(f"cam {name}: parameter {key!r} is given more than once: give it once")
        try:
            keywords[keyword] = parse(value)
        except ValueError:
            raise InputError(f"cam {name}: {key}={excerpt(value)}: expected {EXPECTED[parse]}") from None
    return name, keywords
