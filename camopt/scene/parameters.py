"""The numbers of a scene by name, NAME.KEY: finding, reading, setting and scaling them, singly or together.

NAME is a mass or an element, or "design", "operation" or "geometry". A NAME with wildcards, as in `*.damping_N_s_per_m`
or `coil_*.mass_kg`, refers to every matching mass and element whose number is not zero.

A spring with a measured force table also has a preload and a rate, under the keys of other springs: the force and the
stiffness of its table with the valve closed. A new preload shifts all forces of the table by the same amount; a new
rate scales their differences from the preload. A spring with a stiffness table has the stiffness at zero compression as
its rate, and a new rate scales the whole table.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, NamedTuple, TypeVar

import numpy as np

from camopt.scene.element import Element
from camopt.scene.errors import InputError, did_you_mean
from camopt.scene.schema import Scene
from camopt.scene.table import Table
from camopt.scene.text_file import excerpt
from camopt.scene.units import MM

RATE, PRELOAD = "stiffness_N_per_m", "preload_N"
KEYS = {
    "mass": ("mass_kg", "damping_N_s_per_m", "force_N"),
    "element": (
        *(RATE, "damping_N_s_per_m", PRELOAD, "installed_mm", "gap_mm"),
        *("dissipation_s_per_m", "spring_N_per_m", "leak_N_s_per_m", "check_travel_mm", "slip_N"),
    ),
}
"""Numbers of a train that may scatter, be optimised and be identified, by the table that holds them."""
TABLES = ("design", "operation", "geometry")
"""Tables that occur once in a scene; their numbers may be set too."""
WILDCARDS = frozenset("*?[")
Row = TypeVar("Row", bound=Table)


class SceneNumber(NamedTuple):
    """A number of a scene: its table, its row there (0 in one of `TABLES`), and its key."""

    table: str
    row: int
    key: str

    def of(self, scene: Scene) -> float:
        """Its value in the key's unit; None if the scene has none."""
        return number_of(self._row(scene), self.key)  # pyright: ignore[reportReturnType]

    def named(self, scene: Scene) -> str:
        """NAME.KEY."""
        return f"{self.table if self.table in TABLES else self._row(scene).name}.{self.key}"

    def _row(self, scene: Scene) -> Any:
        return getattr(scene, self.table) if self.table in TABLES else getattr(scene, self.table)[self.row]


@dataclass(frozen=True)
class Tied:
    """Numbers of a scene that change in proportion; the value of the first represents them all."""

    name: str
    numbers: tuple[SceneNumber, ...]

    def of(self, scene: Scene) -> float:
        """The value of the first in a scene, in its key's unit."""
        return self.numbers[0].of(scene)

    def named(self, scene: Scene) -> str:
        """NAME.KEY of the first."""
        return self.numbers[0].named(scene)

    def put(self, scene: Scene, value: float) -> Scene:
        """The scene with a new value of the first number, and the others scaled in proportion."""
        first, *others = self.numbers
        factor = value / first.of(scene) if others else 0.0
        return with_numbers(scene, {first: value} | {number: number.of(scene) * factor for number in others})

    def scaled(self, scene: Scene, factor: float) -> Scene:
        """The scene with each of the numbers multiplied by the factor."""
        return with_numbers(scene, {number: number.of(scene) * factor for number in self.numbers})


def matching(scene: Scene, text: str) -> list[SceneNumber]:
    """The numbers of the train to which a text NAME.KEY refers; an empty list if there is none."""
    name, _, key = text.rpartition(".")
    several = has_wildcards(name)
    return [
        SceneNumber(table, i, key)
        for table, keys in KEYS.items()
        for i, row in enumerate(getattr(scene, table) if key in keys else ())
        if fnmatchcase(row.name, name) and (not several or number_of(row, key))
    ]


def has_wildcards(name: str) -> bool:
    """Whether a NAME may refer to several masses and elements."""
    return not WILDCARDS.isdisjoint(name)


def settable(scene: Scene, text: str) -> list[SceneNumber]:
    """The numbers to which a text NAME.KEY refers, including those of `TABLES` and those that the scene leaves out."""
    name, _, key = text.rpartition(".")
    if name in TABLES:
        return [SceneNumber(name, 0, key)] if _has(getattr(scene, name), key) else []
    rows = [(table, i, row) for table in KEYS for i, row in enumerate(getattr(scene, table)) if row.name == name]
    return [SceneNumber(table, i, key) for table, i, row in rows if _has(row, key)] or matching(scene, text)


def _has(table: Table | None, key: str) -> bool:
    """Whether a table has a field for a number under the key."""
    number = table is not None and key in type(table).model_fields and isinstance(getattr(table, key), float | None)
    return number and key not in ("force_table", "stiffness_table")


def no_such_number(scene: Scene, text: str, asked_by: str, more: Sequence[str] = ()) -> InputError:
    """The error for a text NAME.KEY that refers to no number of the scene; `more` are other permitted names."""
    names = [f"{row.name}.{key}" for table, keys in KEYS.items() for row in getattr(scene, table) for key in keys]
    expected = ", ".join(["NAME.KEY of a mass or an element", *more])
    return InputError(
        f"{asked_by} {excerpt(text)}: {scene.name} has no such number: expected {expected}"
        f"{did_you_mean(text, [*names, *more])}"
    )


def with_numbers(scene: Scene, values: Mapping[SceneNumber, float]) -> Scene:
    """The scene with new values of some of its numbers, in their keys' units, not validated by the schema again."""
    tables: dict[str, Any] = {}
    for number, value in values.items():
        table = tables.get(number.table, getattr(scene, number.table))
        if number.table in TABLES:
            tables[number.table] = table.model_copy(update={number.key: value})
            continue
        row = with_number(table[number.row], number.key, value)
        tables[number.table] = (*table[: number.row], row, *table[number.row + 1 :])
    return scene.model_copy(update=tables)


def number_of(row: Table, key: str) -> float | None:
    """The number of a row under a key, in the key's unit; None if it has none."""
    if isinstance(row, Element) and key in (RATE, PRELOAD) and (row.force_table or row.stiffness_table):
        rate, preload = _installed(row)
        return preload if key == PRELOAD else rate
    return getattr(row, key)


def with_number(row: Row, key: str, value: float) -> Row:
    """The row with a new number under a key for which `number_of` has one."""
    if isinstance(row, Element) and key in (RATE, PRELOAD) and row.force_table:
        rate, preload = _installed(row)
        new_preload = preload if key == RATE else value
        factor = value / rate if key == RATE else 1.0
        table = tuple((at, new_preload + factor * (force - preload)) for at, force in row.force_table)
        return row.model_copy(update={"force_table": table})
    if isinstance(row, Element) and key == RATE and row.stiffness_table:
        factor = value / _installed(row)[0]
        return row.model_copy(update={"stiffness_table": tuple((at, factor * k) for at, k in row.stiffness_table)})
    return row.model_copy(update={key: value})


def _installed(spring: Element) -> tuple[float, float]:
    """Stiffness [N/m] and force [N] of a spring with a table where the valve is closed, extrapolated from forces."""
    if spring.stiffness_table:
        return float(np.interp(0.0, *np.array(spring.stiffness_table).T)), spring.preload_N
    assert spring.force_table, "one of both by the callers"
    at, force = np.array(spring.force_table).T
    line = int(np.clip(np.searchsorted(at, spring.installed_mm, "right") - 1, 0, len(at) - 2))
    rate = (force[line + 1] - force[line]) / (at[line + 1] - at[line])
    return float(rate / MM), float(force[line] + rate * (spring.installed_mm - at[line]))


def valve_spring(scene: Scene) -> list[str]:
    """Names of the elements that make up the valve spring: all preloaded elements except the seat."""
    names = [e.name for e in scene.element if (number_of(e, PRELOAD) or 0.0) > 0 and e.name != scene.seat]
    if not names:
        raise InputError(
            f"{scene.name}: no element but the seat pushes with the valve closed, so no valve spring is known: give "
            "one a preload_N, or the one with a force_table its installed_mm"
        )
    return names


def with_spring(scene: Scene, rate: float = 1.0, preload: float = 1.0) -> Scene:
    """The scene with the rate and the preload of its valve spring multiplied by one factor each. The preload of the
    seat, which balances that of the spring in the installed position, is multiplied by the same factor."""
    spring = valve_spring(scene)
    factors = {f"{name}.{RATE}": rate for name in spring}
    factors |= {f"{name}.{PRELOAD}": preload for name in (*spring, scene.seat)}
    numbers = {number: factor for name, factor in factors.items() for number in matching(scene, name)}
    moved = {number: factor for number, factor in numbers.items() if factor != 1.0 and number.of(scene) is not None}
    return with_numbers(scene, {number: number.of(scene) * factor for number, factor in moved.items()})
