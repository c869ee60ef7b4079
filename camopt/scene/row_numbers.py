"""The numbers of a scene's masses and elements by key: those that a row states, and those that its table holds.

A spring with a measured table has a preload and a rate too, the force and the stiffness of its table where the valve is
closed. They are read, scattered, freed and dragged by the keys of other springs: another preload moves all forces of
the table by as much, another rate multiplies what they differ from the preload by.
"""

from typing import TypeVar

import numpy as np

from camopt.scene.element import Element
from camopt.scene.table import Table
from camopt.scene.units import MM

Row = TypeVar("Row", bound=Table)
RATE, PRELOAD = "stiffness_N_per_m", "preload_N"


def number_of(row: Table, key: str) -> float | None:
    """The number of a row under a key, in the key's unit; None where it has none."""
    if isinstance(row, Element) and key in (RATE, PRELOAD) and row.force_table:
        rate, force = _installed(row)
        return force if key == PRELOAD else rate
    if isinstance(row, Element) and key == RATE and row.stiffness_table:
        return float(np.interp(0.0, *np.array(row.stiffness_table).T))
    return getattr(row, key)


def with_number(row: Row, key: str, value: float) -> Row:
    """The row with another number under a key that it has by `number_of`."""
    if isinstance(row, Element) and key in (RATE, PRELOAD) and row.force_table:
        rate, preload = _installed(row)
        moved = preload if key == RATE else value
        factor = value / rate if key == RATE else 1.0
        table = tuple((at, moved + factor * (force - preload)) for at, force in row.force_table)
        return row.model_copy(update={"force_table": table})
    if isinstance(row, Element) and key == RATE and row.stiffness_table:
        factor = value / float(np.interp(0.0, *np.array(row.stiffness_table).T))
        return row.model_copy(update={"stiffness_table": tuple((at, factor * k) for at, k in row.stiffness_table)})
    return row.model_copy(update={key: value})


def _installed(spring: Element) -> tuple[float, float]:
    """Stiffness [N/m] and force [N] of a force table where the valve is closed; the lines at its ends go on."""
    assert spring.force_table, "the callers ask"
    at, force = np.array(spring.force_table).T
    line = int(np.clip(np.searchsorted(at, spring.installed_mm, "right") - 1, 0, len(at) - 2))
    rate = (force[line + 1] - force[line]) / (at[line + 1] - at[line])
    return float(rate / MM), float(force[line] + rate * (spring.installed_mm - at[line]))
