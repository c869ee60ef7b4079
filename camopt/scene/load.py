"""Reading scene files: every fault is reported at once, with file and key; files are untrusted."""

import tomllib
from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from camopt.scene.errors import InputError
from camopt.scene.rest import rest_position
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

MAX_FILE_BYTES = 1_000_000


@cache
def builtin_scenes() -> dict[str, str]:
    """Names and TOML texts of the built-in scenes."""
    folder = resources.files("camopt.scene") / "library"
    files = {f.name.removesuffix(".toml"): f for f in folder.iterdir() if f.name.endswith(".toml")}
    return {name: files[name].read_text(encoding="utf-8") for name in sorted(files)}


def scene_text(source: str | Path) -> str:
    """TOML text of a built-in scene or of a file. Raises InputError where neither is there."""
    known = builtin_scenes()
    if str(source) in known:
        return known[str(source)]
    path = Path(source)
    if not path.is_file():
        raise InputError(
            f"scene {str(source)!r}: neither a built-in scene ({', '.join(known)}) nor a file; "
            f"`camopt scenes` lists the built-in ones"
        )
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise InputError(f"{path}: larger than {MAX_FILE_BYTES} bytes, which no scene file needs")
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as UTF-8 text ({error})") from error


def load_scene(source: str | Path, need: tuple[str, ...] = ()) -> Scene:
    """The scene of a built-in name or TOML file, fully checked.

    `need` names optional parts that the caller cannot do without, out of "valve", "seat", "operation", "design",
    "geometry". Numbers keep the units of their keys (`_mm`, `_deg`, `_rpm`). Raises InputError with one line per fault.
    """
    return parse_scene(scene_text(source), str(source), need)


def parse_scene(text: str, where: str, need: tuple[str, ...] = ()) -> Scene:
    """The scene of a TOML text; `where` names its source in the messages. `need` and errors are as for `load_scene`."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: not valid TOML: {error}") from error
    try:
        scene = Scene.model_validate(_tuples(data))
    except ValidationError as error:
        errors = error.errors()
        inner = {e["loc"][0] for e in errors if len(e["loc"]) > 1}
        # a row with faults does not count as a row, which pydantic then reports as a second fault
        kept = [e for e in errors if not (e["type"] == "too_short" and len(e["loc"]) == 1 and e["loc"][0] in inner)]
        faults = [f"{where}: {_key(e['loc'])}: {_sentence(e)}" for e in kept]
        raise InputError("\n".join(faults)) from None
    faults = [f"{where}: {fault}" for fault in _name_faults(scene)]
    for part in need:
        if getattr(scene, part) is None:
            faults.append(f"{where}: {part}: missing; this command needs it")
    if not faults and scene.seat:
        faults += [f"{where}: {fault}" for fault in _dynamics_faults(scene)]
    if faults:
        raise InputError("\n".join(faults))
    return scene


def _tuples(value):
    """Turns TOML arrays into tuples, which is what the frozen schema holds."""
    if isinstance(value, list):
        return tuple(_tuples(v) for v in value)
    if isinstance(value, dict):
        return {k: _tuples(v) for k, v in value.items()}
    return value


def _key(loc) -> str:
    return ".".join(str(part + 1) if isinstance(part, int) else part for part in loc) or "file"


def _sentence(error) -> str:
    if error["type"] == "extra_forbidden":
        return "unknown key; check the spelling against `camopt scenes kodama`"
    if error["type"] == "missing":
        return "missing"
    given = error["input"]
    shown = f" (given: {given!r})" if isinstance(given, str | int | float | bool) else ""
    return error["msg"].removeprefix("Value error, ") + shown


def _name_faults(scene: Scene) -> list[str]:
    faults = []
    masses = [m.name for m in scene.mass]
    elements = [e.name for e in scene.element]
    for kind, names in (("mass", masses), ("element", elements)):
        for name in sorted({n for n in names if names.count(n) > 1}):
            faults.append(f"{kind}: the name {name!r} is used more than once")
    if "ground" in masses:
        faults.append("mass: 'ground' is the name of the ground and cannot be a mass")
    for i, e in enumerate(scene.element, 1):
        for end in e.between:
            if end not in masses and end != "ground":
                faults.append(f"element.{i}.between: no mass is named {end!r}")
        if e.between[0] == e.between[1]:
            faults.append(f"element.{i}.between: both ends are {e.between[0]!r}")
    for table, rows in (("mass", scene.mass), ("element", scene.element)):
        for i, row in enumerate(rows, 1):
            for key in row.assumed:
                if key not in type(row).model_fields:
                    faults.append(f"{table}.{i}.assumed: {key!r} is no key of this table")
    if scene.geometry is not None:
        unknown = [key for key in scene.geometry.assumed if key not in type(scene.geometry).model_fields]
        faults += [f"geometry.assumed: {key!r} is no key of this table" for key in unknown]
    if scene.valve is not None and scene.valve not in masses:
        faults.append(f"valve: no mass is named {scene.valve!r}")
    if scene.seat is not None and scene.seat not in elements:
        faults.append(f"seat: no element is named {scene.seat!r}")
    if (scene.valve is None) != (scene.seat is None):
        faults.append("valve and seat: give both or neither")
    return faults


def _dynamics_faults(scene: Scene) -> list[str]:
    """Faults of a scene that is to be simulated: seat, cam drive, rest."""
    train = build_train(scene)
    seat = scene.element[train.seat]
    faults = []
    if seat.kind != "contact" or tuple(seat.between) != ("ground", scene.valve):
        faults.append(
            f'seat: element {seat.name!r} must be a contact between ["ground", {scene.valve!r}], '
            f"in this order, so that it pushes the valve open"
        )
    if np.count_nonzero(train.cam_driven) != 1:
        faults.append("element: exactly one element must have cam_driven = true")
    elif not train.cam_side or not train.cam_driven[train.cam_side[0]]:
        faults.append("element: the cam-driven element must be a contact with a way to the valve")
    if not faults:
        try:
            rest_position(train)
        except InputError as error:
            faults.append(str(error))
    return faults
