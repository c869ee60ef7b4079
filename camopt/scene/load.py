"""Reading scene files: every fault is reported at once, with file and key; files are untrusted."""

from functools import cache
from importlib import resources
from pathlib import Path

from camopt.scene.errors import InputError
from camopt.scene.faults import checked
from camopt.scene.schema import Scene
from camopt.scene.spelling import did_you_mean
from camopt.scene.text_file import excerpt, read_text, usable_path
from camopt.scene.toml_text import toml_data

MAX_FILE_BYTES = 1_000_000


@cache
def builtin_scenes() -> dict[str, str]:
    """Names and TOML texts of the built-in scenes."""
    folder = resources.files("camopt.scene") / "library"
    files = {f.name.removesuffix(".toml"): f for f in folder.iterdir() if f.name.endswith(".toml")}
    return {name: files[name].read_text(encoding="utf-8") for name in sorted(files)}


def scene_text(source: str | Path) -> str:
    """TOML text of a built-in scene, a file, or the scene of a run folder. Raises InputError where none is there."""
    known = builtin_scenes()
    if str(source) in known:
        return known[str(source)]
    path = usable_path(source, "scene")
    if path.is_dir():
        path = path / "scene.toml"
    if not path.is_file():
        raise InputError(
            f"scene {excerpt(str(source))}: neither a built-in scene ({', '.join(known)}) nor a file"
            f"{did_you_mean(str(source), known) or '; `camopt scenes` lists the built-in ones'}"
        )
    return read_text(path, MAX_FILE_BYTES, "scene file")


def load_scene(source: str | Path, need: tuple[str, ...] = ()) -> Scene:
    """The scene of a built-in name or TOML file, fully checked.

    `need` names optional parts that the caller cannot do without, out of "valve", "seat", "operation", "design",
    "geometry". Numbers keep the units of their keys (`_mm`, `_deg`, `_rpm`). Raises InputError with one line per fault.
    """
    return parse_scene(scene_text(source), str(source), need)


def parse_scene(text: str, where: str, need: tuple[str, ...] = ()) -> Scene:
    """The scene of a TOML text; `where` names its source in the messages. `need` and errors are as for `load_scene`."""
    scene, faults = checked({key: _tuples(value) for key, value in toml_data(text, where).items()}, need)
    if scene is None or faults:
        raise InputError("\n".join(f"{where}: {fault}" for fault in faults))
    return scene


def _tuples(value):
    """Turns TOML arrays into tuples, which is what the frozen schema holds."""
    if isinstance(value, list):
        return tuple(_tuples(v) for v in value)
    if isinstance(value, dict):
        return {k: _tuples(v) for k, v in value.items()}
    return value
