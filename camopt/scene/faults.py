"""All faults of a scene file at once: of the schema, of the names, and of the train at rest, each with its key.

No kind of fault hides another. Names are checked in the file's own tables, even where these violate the schema, and the
train is built as soon as its masses and elements have no fault, whatever faults the other tables have.
"""

import re
from collections import Counter
from copy import deepcopy
from typing import Any, get_args

import numpy as np
from pydantic import ValidationError

from camopt.scene.as_built import tolerance_faults
from camopt.scene.errors import InputError, did_you_mean
from camopt.scene.rest import static_forces
from camopt.scene.schema import MOST_ROWS, Part, Scene
from camopt.scene.table import Table
from camopt.scene.text_file import excerpt
from camopt.scene.train import Train, build_train

NAMED = ("mass", "element")
"""Tables whose rows have names."""
TRAIN = (*NAMED, "force")
"""Tables that make up the train."""
MOST_LISTED = 100
"""Largest number of faults listed; the number of further ones is stated."""

PLAIN = {
    "string_pattern_mismatch": "must match the pattern of a name: a letter, then letters, digits, - or _, at most 64",
    "model_type": "must be a table",
    "tuple_type": "must be an array",
}
"""Sentences that replace those of the schema that an engineer would not understand, by pydantic's type of error."""


def checked(data: dict, need: tuple[Part, ...]) -> tuple[Scene | None, list[str]]:
    """The scene of a file's tables, or None, and one sentence per fault; `need` is as for `load_scene`."""
    crowded = {kind: len(_rows(data, kind)) for kind, most in MOST_ROWS.items() if len(_rows(data, kind)) > most}
    if crowded:  # checking them all would take long and could list thousands of faults
        return None, [f"{kind}: {n} rows, and a scene has at most {MOST_ROWS[kind]}" for kind, n in crowded.items()]
    scene, errors = _validated(data)
    faulty = {error["loc"][0] for error in errors if error["loc"]}
    names = _name_faults(data)
    faults = [f"{_key(e['loc'])}: {_sentence(e)}" for e in errors] + names
    faults += [f"{part}: missing; this command needs it" for part in need if data.get(part) is None]
    if not names and not faulty & {*TRAIN, "valve", "seat"} and "seat" in data:
        faults += _dynamics_faults(_scene_of(data, *TRAIN))
    if not names and not faulty & {*TRAIN, "tolerance"} and "tolerance" in data:
        faults += tolerance_faults(_scene_of(data, *TRAIN, "tolerance"))
    faults = [fault + _name_of_row(fault, data) for fault in faults]
    if len(faults) > MOST_LISTED:
        faults = [*faults[:MOST_LISTED], f"and {len(faults) - MOST_LISTED} more faults"]
    return scene, faults


def _validated(data: dict) -> tuple[Scene | None, list[dict[str, Any]]]:
    """The scene, or None, and the schema's errors. pydantic skips the check of a whole table while one of its keys is
    faulty, so the tables are validated a second time without these keys."""
    scene, errors = _validated_once(data)
    if not errors:
        return scene, []
    faulty = {error["loc"] for error in errors}
    _, further = _validated_once(_without_keys(data, faulty))
    left_out = {_place(loc) for loc in faulty}
    return None, errors + [e for e in further if e["loc"] not in faulty and e["loc"] not in left_out]


def _validated_once(data: dict) -> tuple[Scene | None, list[Any]]:
    try:
        return Scene.model_validate(data), []
    except ValidationError as error:
        errors = error.errors(include_url=False)
    inner = {e["loc"][0] for e in errors if len(e["loc"]) > 1}
    # a row with faults does not count as a row, which pydantic then reports as a second fault
    return None, [e for e in errors if not (e["type"] == "too_short" and len(e["loc"]) == 1 and e["loc"][0] in inner)]


def _place(loc: tuple) -> tuple:
    """Place of the faulty key: (key), (table, key) or (table, row, key)."""
    return loc[: 3 if len(loc) > 1 and isinstance(loc[1], int) else 2]


def _without_keys(data: dict, places: set[tuple]) -> dict:
    """The tables without the keys at these places. No row is removed."""
    remaining = deepcopy(data)
    for place in map(_place, places):
        table: Any = remaining
        for part in place[:-1]:
            table = table[part]
        if isinstance(table, dict) and not isinstance(table.get(place[-1]), dict):
            table.pop(place[-1], None)
    return remaining


def _key(loc: tuple) -> str:
    parts = (str(part + 1) if isinstance(part, int) else part for part in loc)
    return ".".join(part if len(part) <= 80 else excerpt(part) for part in parts) or "file"


def _name_of_row(fault: str, data: dict) -> str:
    """The name of the mass or element to whose row number a fault refers, as the end of its sentence."""
    match = re.match(rf"({'|'.join(NAMED)})\.(\d+)\.(?!name\b)", fault)
    name = _rows(data, match[1])[int(match[2]) - 1].get("name") if match else None
    return f" ({match[1]} {excerpt(name)})" if match and isinstance(name, str) else ""


def _sentence(error: dict[str, Any]) -> str:
    """A fault of the schema in plain words."""
    kind, value = error["type"], error["input"]
    if kind == "extra_forbidden":
        return _unknown_key(error["loc"])
    if kind == "missing":
        return "missing"
    whole = isinstance(value, int) and not isinstance(value, bool)
    if whole and kind == "float_type":
        return "must be a number of usual size: this integer is larger than any quantity of a scene"
    text = PLAIN.get(kind) or error["msg"].removeprefix("Value error, ").replace(" after validation", "")
    text = text.replace("Input should be", "must be").replace("Tuple should have", "must have")
    if isinstance(value, str):
        text += f" (given: {excerpt(value)})"
    elif isinstance(value, int | float):
        text += f" (given: {value!r})"
    if kind == "literal_error" and isinstance(value, str):
        text += did_you_mean(value, re.findall(r"'([^']*)'", str(error["ctx"]["expected"])))
    return text


def tables() -> dict[str, type[Table]]:
    """The tables of a scene by key: [design] as "design", the rows [[mass]] as "mass"."""
    inside = {key: _tables_in(field.annotation) for key, field in Scene.model_fields.items()}
    return {key: tables[0] for key, tables in inside.items() if tables}


def _tables_in(annotation: Any) -> list[type[Table]]:
    """The table classes in the type of a key."""
    if isinstance(annotation, type):
        return [annotation] if issubclass(annotation, Table) else []
    return [table for part in get_args(annotation) for table in _tables_in(part)]


def _unknown_key(loc: tuple) -> str:
    """The sentence on an unknown key, with the similar known key, or the table to which it belongs."""
    key, by_name = loc[-1], tables()
    keys = by_name[loc[0]].model_fields if len(loc) > 1 else Scene.model_fields
    if len(loc) > 2 and isinstance(loc[1], str):  # a table within a table
        keys = _tables_in(keys[loc[1]].annotation)[0].model_fields
    homes = [name for name, table in by_name.items() if key in table.model_fields]
    if homes:
        headings = [f"[[{name}]]" if name in MOST_ROWS else f"[{name}]" for name in homes]
        return f"unknown key; it belongs in {' or '.join(headings)}"
    return "unknown key" + (did_you_mean(key, keys) or "; check the spelling against `camopt scenes kodama`")


def _rows(data: dict, table: str) -> list[dict]:
    """The rows of a table, with an empty row for anything that is no table, so that the rows keep their numbers."""
    rows = data.get(table)
    return [row if isinstance(row, dict) else {} for row in rows] if isinstance(rows, tuple) else []


def _texts(row: dict, key: str) -> tuple[str, ...]:
    """The texts in an array of a row; empty if the key holds no array."""
    value = row.get(key)
    return tuple(text for text in value if isinstance(text, str)) if isinstance(value, tuple) else ()


def _name_faults(data: dict) -> list[str]:
    """Sentences on names used twice, on references to names that do not exist, and on masses that nothing holds."""
    faults, names, all_named = [], {}, {}
    for kind in NAMED:
        stated = [row.get("name") for row in _rows(data, kind)]
        names[kind] = [name for name in stated if isinstance(name, str)]
        all_named[kind] = len(names[kind]) == len(stated) > 0  # else a reference may mean a row with a faulty name
        for name, count in sorted(Counter(names[kind]).items()):
            if count > 1:
                faults.append(f"{kind}: the name {excerpt(name)} is used more than once")
    if "ground" in names["mass"]:
        faults.append("mass: 'ground' is the name of the ground and cannot be a mass")
    ends = _ends_faults(data, names["mass"]) if all_named["mass"] else []
    faults += ends or (_unheld(data, names["mass"]) if all_named["mass"] else [])
    for i, row in enumerate(_rows(data, "force"), 1):
        on = row.get("on")
        if isinstance(on, str) and all_named["mass"] and on not in names["mass"]:
            faults.append(f"force.{i}.on: no mass is named {excerpt(on)}{did_you_mean(on, names['mass'])}")
    for kind in (kind for kind, table in tables().items() if "assumed" in table.model_fields):
        rows = [(f"{kind}.{i}", row) for i, row in enumerate(_rows(data, kind), 1)]
        single = data.get(kind)
        for place, row in [(kind, single)] if isinstance(single, dict) else rows:
            keys = tables()[kind].model_fields
            for key in (key for key in _texts(row, "assumed") if key not in keys):
                faults.append(f"{place}.assumed: {excerpt(key)} is no key of this table{did_you_mean(key, keys)}")
    for key, kind in (("valve", "mass"), ("seat", "element")):
        reference = data.get(key)
        if isinstance(reference, str) and all_named[kind] and reference not in names[kind]:
            faults.append(f"{key}: no {kind} is named {excerpt(reference)}{did_you_mean(reference, names[kind])}")
    if ("valve" in data) != ("seat" in data):
        faults.append("valve and seat: give both or neither")
    return faults


def _ends_faults(data: dict, masses: list[str]) -> list[str]:
    permitted = {*masses, "ground"}
    faults = []
    for i, row in enumerate(_rows(data, "element"), 1):
        ends = _texts(row, "between")
        for end in dict.fromkeys(end for end in ends if end not in permitted):
            faults.append(f"element.{i}.between: no mass is named {excerpt(end)}{did_you_mean(end, permitted)}")
        if len(ends) == 2 and ends[0] == ends[1]:
            faults.append(f"element.{i}.between: both ends are {excerpt(ends[0])}")
    return faults


def _unheld(data: dict, masses: list[str]) -> list[str]:
    """Sentences on masses of a train with a seat that no chain of elements joins to the ground."""
    pairs = [_texts(row, "between") for row in _rows(data, "element")]
    if "seat" not in data or any(len(pair) != 2 for pair in pairs):
        return []
    held, joined = set(), {"ground"}
    while joined:
        held |= joined
        joined = {end for pair in pairs if held & set(pair) for end in pair} - held
    return [
        f"mass.{i}: no element joins {name!r} to the ground, not even by way of other masses: nothing would hold it"
        for i, name in enumerate(masses, 1)
        if name not in held
    ]


def _scene_of(data: dict, *kinds: str) -> Scene:
    """The scene of these tables alone, which are known to be without fault, with its valve and its seat."""
    classes = tables()
    rows: dict[str, Any] = {kind: tuple(classes[kind].model_validate(r) for r in data.get(kind, ())) for kind in kinds}
    return Scene.model_construct(valve=data.get("valve"), seat=data.get("seat"), **rows)


def _dynamics_faults(scene: Scene) -> list[str]:
    """Faults of a train that is to be simulated: its seat, cam drive, direction of contacts, and rest state."""
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
        faults.append(
            "element: the cam-driven element must be a contact with a way to the valve, and every contact on it must "
            "push that way: between = [the cam's side, the valve's side], in this order"
        )
    if not faults:
        try:
            faults += _friction_faults(scene, train)
        except InputError as error:
            faults.append(str(error))
    return faults


def _friction_faults(scene: Scene, train: Train) -> list[str]:
    """The sentence on friction that could hold the valve off its seat. Raises InputError if there is no rest state."""
    pressed = static_forces(train, np.zeros(1))[0, train.seat]
    rubbing = [e for e in scene.element if e.slip_N is not None and scene.valve in e.between]
    slip = sum(e.slip_N for e in rubbing if e.slip_N is not None)
    if not rubbing or slip < pressed:
        return []
    names = " and ".join(repr(e.name) for e in rubbing)
    return [
        f"element: the friction of {names} ({slip:g} N) could hold the valve off its seat, which the spring presses on "
        f"with {pressed:.3g} N at rest: expected less slip_N than that, or more preload"
    ]
