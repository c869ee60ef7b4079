"""Reading of scene files. All faults are reported together, with file and key, and no file is trusted."""

from collections.abc import Callable, Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from camopt.scene.design import FROM_DURATION_AT, Design
from camopt.scene.errors import InputError, did_you_mean
from camopt.scene.faults import checked
from camopt.scene.parameters import TABLES, no_such_number, settable, with_numbers
from camopt.scene.schema import Part, Scene
from camopt.scene.text_file import excerpt, read_text, toml_data, usable_path

MAX_FILE_BYTES = 1_000_000


@cache
def builtin_scenes() -> dict[str, str]:
    """Names of the built-in scenes and their TOML texts."""
    folder = resources.files("camopt.scene") / "library"
    files = {f.name.removesuffix(".toml"): f for f in folder.iterdir() if f.name.endswith(".toml")}
    return {name: files[name].read_text(encoding="utf-8") for name in sorted(files)}


def scene_text(source: str | Path) -> str:
    """TOML text of a built-in scene, a file, or the scene of a run folder. Raises InputError if there is none."""
    builtin = builtin_scenes()
    if str(source) in builtin:
        return builtin[str(source)]
    path = usable_path(source, "scene")
    if path.is_dir():
        path = path / "scene.toml"
    if not path.is_file():
        if path.suffix == ".toml" or path.parent != Path("."):
            raise InputError(f"scene {excerpt(str(source))}: there is no such file: check the path")
        raise InputError(
            f"scene {excerpt(str(source))}: neither a built-in scene ({', '.join(builtin)}) nor a file"
            f"{did_you_mean(str(source), builtin) or '; `camopt scenes` lists the built-in ones'}"
        )
    return read_text(path, MAX_FILE_BYTES, "scene file")


def no_duration(design: Design) -> float:
    """Raises InputError for a design that leaves its duration open, because choosing it takes a linear program."""
    raise InputError(
        f'design.duration_deg: "{FROM_DURATION_AT}" needs the command line or camopt.load_scene: read the '
        "scene there, or give a number"
    )


def load_scene(
    source: str | Path, need: tuple[Part, ...] = (), duration_of: Callable[[Design], float] = no_duration
) -> Scene:
    """The scene of a built-in name or TOML file, fully checked, in the units of its keys (`_mm`, `_deg`, `_rpm`).

    `need` names optional tables that the caller requires. `duration_of` returns the duration [deg] of a design that
    leaves it to its duration_at. Raises InputError with one line per fault.
    """
    return parse_scene(scene_text(source), str(source), need, duration_of)


def parse_scene(
    text: str, where: str, need: tuple[Part, ...] = (), duration_of: Callable[[Design], float] = no_duration
) -> Scene:
    """The scene of a TOML text; `where` names its source in messages. Everything else is as for `load_scene`."""
    data: dict[str, Any] = {key: tuples(value) for key, value in toml_data(text, where).items()}
    design = data.get("design")
    design = design if isinstance(design, dict) else {}
    left_open = design.get("duration_deg") == FROM_DURATION_AT
    if left_open:
        data["design"] = design | {"duration_deg": _provisional_duration(design.get("duration_at"))}
    scene = _without_fault(data, where, need)
    if not left_open:
        return scene
    try:
        design = scene.required_design
        return scene.model_copy(update={"design": design.of_duration(duration_of(design))})
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def checked_scene(scene: Scene, where: str, need: tuple[Part, ...] = ()) -> Scene:
    """A scene whose numbers were changed, checked like a file; `where`, `need` and errors are as for `parse_scene`."""
    return _without_fault(scene.model_dump(exclude_none=True, exclude_defaults=True), where, need)


def _without_fault(data: dict[str, Any], where: str, need: tuple[Part, ...]) -> Scene:
    scene, faults = checked(data, need)
    if scene is None or faults:
        raise InputError("\n".join(f"{where}: {fault}" for fault in faults))
    return scene


def scene_with(scene: Scene, numbers: Mapping[str, float], asked_by: str = "set", need: tuple[Part, ...] = ()) -> Scene:
    """The scene with other values of the numbers named NAME.KEY (`camopt.scene.parameters`). Raises InputError for
    values that make it faulty, and, begun by `asked_by`, for a name that refers to no number of the scene."""
    changed = scene
    for text, value in numbers.items():
        if not (places := settable(scene, text)):
            raise no_such_number(scene, text, asked_by, [f"{table}.KEY" for table in TABLES])
        changed = with_numbers(changed, dict.fromkeys(places, value))
    changes = ", ".join(f"{text} = {value:g}" for text, value in numbers.items())
    return checked_scene(changed, f"scene {scene.name} with {changes}", need) if numbers else scene


def _provisional_duration(rows: Any) -> float:
    """A duration [deg] with which the rest of a scene can be checked before the final one is chosen."""
    windows = rows if isinstance(rows, tuple) else ()
    least = [row[1] for row in windows if isinstance(row, tuple) and len(row) == 3 and isinstance(row[1], int | float)]
    return min(1.1 * (max(least, default=0.0) or 130.0), 290.0)


def tuples(value: Any) -> Any:
    """Converts arrays of TOML or JSON into tuples, which the frozen schema requires."""
    if isinstance(value, list | tuple):
        return tuple(tuples(v) for v in value)
    return {k: tuples(v) for k, v in value.items()} if isinstance(value, dict) else value
