"""The metrics of a motion, each declared once: name, label, unit, limit. Tables, axes and tests read this list.

Each formula is implemented twice (`camopt.measure.metrics` in NumPy, `camopt.smooth.metrics` in JAX), and a test
evaluates both for the same response.
"""

import math
from dataclasses import dataclass
from typing import TypeGuard


@dataclass(frozen=True)
class Quantity:
    """A metric with its unit, and the key of the scene's design that limits it, if any."""

    name: str  # as in verification.json, the unit in the name
    label: str
    unit: str
    limit: str | None = None
    less_is_worse: bool = False  # the limit is then the least value permitted


QUANTITIES = {
    q.name: q
    for q in (
        Quantity("bounce_mm", "bounce", "mm", "bounce_max_mm"),
        Quantity("jump_mm", "jump", "mm", "jump_max_mm"),
        Quantity("jump_deg", "jump angle", "deg", "jump_max_deg"),
        Quantity("contact_force_min_N", "least contact force", "N", "contact_force_min_N", less_is_worse=True),
        Quantity("contact_force_max_N", "peak contact force", "N", "contact_force_max_N"),
        Quantity("seating_velocity_m_per_s", "seating velocity", "m/s", "seating_velocity_max_m_per_s"),
        Quantity("impact_velocity_m_per_s", "impact velocity", "m/s"),
        Quantity("dynamic_area_mm_deg", "dynamic area", "mm deg", less_is_worse=True),
        Quantity("excess_lift_mm", "excess lift", "mm"),
    )
}
"""docs/model.md defines each metric and the window over which it is taken."""
LESS_IS_WORSE = frozenset(q.name for q in QUANTITIES.values() if q.less_is_worse)
"""Metrics whose worst value is the smallest one."""

UNITS = (
    ("_mm_per_deg4", "mm/deg⁴"),
    ("_mm_per_deg3", "mm/deg³"),
    ("_mm_per_deg2", "mm/deg²"),
    ("_mm_per_deg", "mm/deg"),
    ("_mm_deg", "mm deg"),
    ("_m_per_s", "m/s"),
    ("_N_per_m", "N/m"),
    ("_percent", "%"),
    ("_rpm", "r/min"),
    ("_deg", "deg"),
    ("_mm", "mm"),
    ("_um", "µm"),
    ("_kg", "kg"),
    ("_Hz", "Hz"),
    ("_N", "N"),
    ("_s", "s"),
)
"""Suffixes of keys and their units, longer suffixes first."""


def label_and_unit(key: str) -> tuple[str, str]:
    """`worst_bounce_mm` -> ("worst bounce", "mm"); the metrics keep their declared labels."""
    stem = key.removeprefix("worst_")
    worst = "worst " if stem != key else ""
    if stem in QUANTITIES:
        return worst + QUANTITIES[stem].label, QUANTITIES[stem].unit
    for ending, unit in UNITS:
        if key.endswith(ending):
            return key.removesuffix(ending).replace("_", " "), unit
    return key.replace("_", " "), ""


def is_number(value: object) -> TypeGuard[float]:
    """True for a real, finite number; False for everything else that a file may hold."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
