"""The reference of the tables and keys of a scene file, generated from the schema."""

import re
import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from camopt.scene.design import Piston
from camopt.scene.notes import KEYS, USUAL
from camopt.scene.schema import Scene
from docs.generators.tables import markdown

TOP = {"mass", "element", "force", "tolerance", "operation", "design", "geometry", "grinding"}


def scene_keys(content: str) -> str:
    """A section for each table of a scene: its docstring, and its keys with meaning, type, default and usual range."""
    sections = [_section("The top of the file", Scene, "", skip=TOP)]
    for name in Scene.model_fields:
        if name in TOP:
            model, repeats = _model(Scene.model_fields[name].annotation)
            title = f"`[[{name}]]`" if repeats else f"`[{name}]`"
            sections.append(_section(title, model, name))
            if name == "design":
                sections.append(_section("`[design.piston]`", Piston, "piston"))
    return "\n".join(sections)


def _model(annotation: Any) -> tuple[type[BaseModel], bool]:
    """The model inside an annotation, and whether the scene may have several such tables."""
    for part in _parts(annotation):
        if isinstance(part, type) and issubclass(part, BaseModel):
            return part, "tuple" in str(annotation)
    raise TypeError(f"no table in {annotation}")


def _parts(annotation: Any) -> Iterator[Any]:
    yield annotation
    for part in get_args(annotation):
        yield from _parts(part)


def _section(title: str, model: type[BaseModel], table: str, skip: frozenset | set = frozenset()) -> str:
    entries = KEYS.get(table or "scene", {})
    meaning = {key: entry if isinstance(entry, str) else entry["meaning"] for key, entry in entries.items()}
    rows = [
        (f"`{key}`", meaning.get(key, ""), _type(field.annotation), _default(field), _usual(f"{table}.{key}"))
        for key, field in model.model_fields.items()
        if key not in skip
    ]
    anchor = f"(scene-{table})=\n" if table else ""
    words = re.sub(r"^ {4}", "", model.__doc__ or "", flags=re.MULTILINE)
    return f"{anchor}## {title}\n\n{words}\n\n" + markdown(("key", "meaning", "type", "default", "usual"), rows)


def _type(annotation: Any) -> str:
    origin = get_origin(annotation)
    if origin is Annotated:
        return _type(get_args(annotation)[0])
    if origin is Literal:
        return ", ".join(f"`{value!r}`".replace("'", '"') for value in get_args(annotation))
    if origin in (Union, types.UnionType):
        return " or ".join(_type(part) for part in get_args(annotation) if part is not types.NoneType)
    if origin is tuple:
        inside = get_args(annotation)
        if inside[-1] is Ellipsis:
            return f"list of {_plural(_type(inside[0]))}"
        return f"[{', '.join(_type(part) for part in inside)}]"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "table"
    return {float: "number", int: "whole number", str: "text", bool: "true or false"}[annotation]


def _plural(words: str) -> str:
    return f"{words}s" if re.fullmatch(r"[a-z ]+", words) else words


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.default
    if value is None or value in ("", ()):
        return "–"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _usual(path: str) -> str:
    usual = USUAL.get(path)
    return f"{usual.low:g} to {usual.high:g}" if usual else ""
