"""A scene with some of its numbers replaced, and checked as a file would be."""

from collections.abc import Mapping
from functools import lru_cache

import tomli_w

from camopt.scene import Scene
from camopt.scene.element import Element
from camopt.scene.errors import InputError
from camopt.scene.load import parse_scene
from camopt.scene.schema import Mass
from camopt.scene.spelling import did_you_mean
from camopt.scene.text_file import excerpt
from camopt.tasks.task import NEEDED, scene_of_text

ROWS = {"mass": Mass, "element": Element}
TABLES = ("operation", "design", "geometry")


def scene_with(scene: Scene, numbers: Mapping[str, float]) -> Scene:
    """The scene with the numbers by NAME.KEY; NAME is a mass, an element, or operation, design or geometry.

    Raises InputError for a name or a key that the scene does not have, and for numbers that make it faulty.
    """
    if not numbers:
        return scene
    data = scene.model_dump(exclude_none=True, exclude_defaults=True)
    for text, number in numbers.items():
        name, _, key = text.rpartition(".")
        _place(data, name, key, text)[key] = number
    return parse_scene(tomli_w.dumps(data), f"scene {scene.name} with {_said(numbers)}", NEEDED)


@lru_cache(maxsize=64)
def varied_scene(text: str, numbers: tuple[tuple[str, float], ...]) -> Scene:
    """The scene of a task: `text` as it says it, and its `numbers` as pairs."""
    return scene_with(scene_of_text(text), dict(numbers))


def _place(data: dict, name: str, key: str, text: str) -> dict:
    """The table of a scene's data in which the number stands."""
    rows = [(row, ROWS[kind]) for kind in ROWS for row in data.get(kind, ()) if row["name"] == name]
    for row, kind in rows:
        if key in kind.model_fields:
            return row
    if not rows and name in TABLES and name in data:
        return data[name]
    known = [row["name"] for kind in ROWS for row in data.get(kind, ())] + [t for t in TABLES if t in data]
    if name not in known:
        raise InputError(f"vary {excerpt(text)}: the scene has no {excerpt(name)}{did_you_mean(name, known)}")
    keys = [key for _, kind in rows for key in kind.model_fields]
    raise InputError(f"vary {excerpt(text)}: {excerpt(name)} has no such number{did_you_mean(key, keys)}")


def _said(numbers: Mapping[str, float]) -> str:
    return ", ".join(f"{text} = {number:g}" for text, number in numbers.items())
