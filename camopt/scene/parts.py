"""The elements of a train in SI: one for each element of the scene, and a plunger and an oil column for an adjuster."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from camopt.scene.element import Element
from camopt.scene.laws import CONTACT_LAWS, KINDS, Laws
from camopt.scene.units import MM

OIL_OF = "{}-oil"
"""Name of the oil column of an adjuster."""


@dataclass(frozen=True, eq=False)
class Part:
    """One element of a train; lengths [m], forces [N], stiffnesses in the unit of its law."""

    name: str
    law: str  # a key of `laws.KINDS`
    contact: bool
    between: tuple[str, str]
    cam_driven: bool = False
    stiffness: float = 0.0
    damping: float = 0.0
    preload: float = 0.0
    gap: float = 0.0
    own_number: float = 1.0
    dissipation: float = 0.0
    table: tuple[tuple[float, float], ...] = ()  # rows of compression and stiffness, or force
    leak: float = 0.0
    travel: float = 0.0
    slip: float = 0.0
    plunger: bool = False


def parts_of(elements: Sequence[Element]) -> tuple[Part, ...]:
    """The parts of a train: one for each element, in their order, then the oil columns of the adjusters."""
    adjusters = [e for e in elements if e.kind == "adjuster"]
    of_kind = {"adjuster": _plunger, "friction": _friction}
    parts = [of_kind.get(e.kind, _spring_or_contact)(e) for e in elements]
    return tuple([*parts, *(_oil(e) for e in adjusters)])


def _spring_or_contact(e: Element) -> Part:
    """The part of a spring or a contact."""
    rows = e.stiffness_table or e.force_table
    return Part(
        name=e.name,
        law=e.law,
        contact=e.kind == "contact",
        between=e.between,
        cam_driven=e.cam_driven,
        stiffness=e.stiffness_N_per_m or 0.0,
        damping=e.damping_N_s_per_m,
        preload=e.preload_N,
        gap=e.gap_mm * MM,
        own_number=own_number(e),
        dissipation=e.dissipation_s_per_m or 0.0,
        table=tuple(((at - e.installed_mm) * MM, value) for at, value in rows or ()),
    )


def own_number(e: Element) -> float:
    """Second parameter of an element's contact law, in SI; 1 for other laws."""
    if e.law not in CONTACT_LAWS:
        return 1.0
    law = CONTACT_LAWS[e.law]
    return (getattr(e, law.key) or law.usual or 0.0) * law.unit  # the schema requires it unless there is a usual value


def _friction(e: Element) -> Part:
    assert e.stiffness_N_per_m and e.slip_N, "the schema asks for both"
    return Part(e.name, "friction", False, e.between, stiffness=e.stiffness_N_per_m, slip=e.slip_N)


def _plunger(e: Element) -> Part:
    """The plunger spring of an adjuster between its stops: a contact whose force consists of three straight lines."""
    assert e.stiffness_N_per_m and e.spring_N_per_m and e.stroke_mm, "the schema asks for all"
    half, stop = e.stroke_mm * MM / 2, e.stiffness_N_per_m
    low, high = e.preload_N - half * e.spring_N_per_m, e.preload_N + half * e.spring_N_per_m
    rows = ((-half - low / stop, 0.0), (-half, low), (half, high), (half + MM, high + stop * MM))
    return Part(e.name, "table", True, e.between, table=rows, plunger=True)


def _oil(e: Element) -> Part:
    assert e.stiffness_N_per_m and e.leak_N_s_per_m, "the schema asks for both"
    travel = (e.check_travel_mm or 0.0) * MM
    stiffness, leak = e.stiffness_N_per_m, e.leak_N_s_per_m
    return Part(OIL_OF.format(e.name), "oil", False, e.between, stiffness=stiffness, leak=leak, travel=travel)


def laws_of(parts: Sequence[Part]) -> Laws:
    """The laws of the parts of a train."""
    laws = Laws(
        kind=np.array([KINDS[p.law] for p in parts]),
        coefficient=np.array([p.stiffness for p in parts]),
        own_number=np.array([p.own_number for p in parts]),
        dissipation=np.array([p.dissipation for p in parts]),
        table=_padded_tables(parts),
        leak=np.array([p.leak for p in parts]),
        travel=np.array([p.travel for p in parts]),
        slip=np.array([p.slip for p in parts]),
        rows=np.array([max(1, len(p.table)) for p in parts]),
    )
    tables = np.array([len(p.table) > 0 for p in parts])
    laws.coefficient[tables] = laws.stand_in()[tables]
    return laws


def _padded_tables(parts: Sequence[Part]) -> np.ndarray:
    """The tables of all parts as one array (e, q, 2); shorter ones get rows, a metre apart, that extrapolate them."""
    tables = [np.array(part.table or [(0.0, part.stiffness)]) for part in parts]
    rows = max(map(len, tables))
    slopes = [last_slope(table) if part.law == "table" else 0.0 for part, table in zip(parts, tables, strict=True)]
    return np.stack([lengthened(table, rows, slope) for table, slope in zip(tables, slopes, strict=True)])


def last_slope(rows: np.ndarray):
    """Slope [N/m] of the last line of a table (k, 2); zero for a single row."""
    (x, y), (x_next, y_next) = rows[-2:] if len(rows) > 1 else ((0.0, 0.0), (1.0, 0.0))
    return (y_next - y) / (x_next - x)


def lengthened(rows: np.ndarray, count: int, slope) -> np.ndarray:
    """A table (k, 2) extended to `count` rows; the new ones, a metre apart, continue with a slope [N/m]."""
    more = np.arange(1.0, count - len(rows) + 1.0)[:, None]
    return np.concatenate([rows, rows[-1] + more * np.array([1.0, slope])])
