"""A member of a sectioned family. The caller fixes its section angles and levels, or leaves them to the limits."""

from collections.abc import Mapping, Sequence

import numpy as np

from camopt.cam.families.largest_area import best_angles, best_levels
from camopt.cam.families.sections import Flank, SectionTable, closed, flank
from camopt.cam.lift import Lift
from camopt.cam.ramps import Ramp, symmetric_conditions
from camopt.scene import InputError, Scene
from camopt.scene.design import Design
from camopt.scene.units import DEG, MM

STRETCH_ROUND_OFF = 1e-8
"""A stretch of the limits up to this size counts as none."""


def member(
    scene: Scene,
    table: SectionTable,
    starts: Sequence[Sequence[float]],
    sections_deg: Sequence[float] | None,
    levels: Mapping[str, float | None],
    jerk: bool,
    **parameters,
) -> Lift:
    """The cam of a table for a scene's duration, maximum lift and ramps; levels are in mm/deg^order.

    Where `levels` gives all levels but those that the nose determines, the cam is that member, whatever the limits.
    Where it gives fewer, the others are chosen for the largest area under the limits; the jerk limit holds only with
    `jerk`. Where `sections_deg` is None, the section angles are chosen too. Raises InputError for unusable angles or
    levels, and where no member meets the limits.
    """
    design, ramp = symmetric_conditions(scene, table.family)
    given = {n: float(v) for n, v in levels.items() if v is not None}
    open_levels = [n for n in table.levels if n not in given]
    if not all(np.isfinite(v) for v in given.values()):
        raise InputError(f"{table.family}: levels {given}: finite numbers are needed")
    if len(open_levels) < len(table.closed_by):
        raise InputError(
            f"{table.family}: all of {', '.join(table.levels)} are given; the maximum lift determines one: leave it out"
        )
    if sections_deg is None:
        if given:
            raise InputError(f"{table.family}: {', '.join(given)} given without sections_deg; give the angles too")
        angles = best_angles(table, design, ramp, jerk, starts)
    else:
        angles = _checked(table, sections_deg, design.duration_deg / 2) * DEG
    one = flank(table, angles)
    units = dict(zip(table.levels, table.units(), strict=True))
    si = {n: v * units[n] for n, v in given.items()}
    if sections_deg is not None and len(open_levels) == len(table.closed_by):
        x = np.array([ramp.height, ramp.velocity, *(si.get(n, 0.0) for n in table.levels)])
        x = closed(table, one, x, design.max_lift_mm * MM, open_levels)
    else:
        x = _largest(table, one, design, ramp, jerk, si)
    return cam_of(table, one, angles, x, ramp, **parameters)


def level_names(table: SectionTable) -> list[str]:
    """The levels with their unit, as a cam's parameters and the command line name them."""
    return [f"{n}_mm_per_deg{k}" for n, k in zip(table.levels, table.orders(), strict=True)]


def cam_of(table: SectionTable, one: Flank, angles: np.ndarray, x: np.ndarray, ramp: Ramp, **parameters) -> Lift:
    """The cam with the levels x (n) on a flank with these section angles [rad]; both stand among its parameters."""
    levels = dict(zip(level_names(table), (x[2:] / table.units()).tolist(), strict=True))
    parameters = {"sections_deg": (angles / DEG).tolist(), **levels, **parameters}
    return one.lift(x, ramp, table.family, parameters)


def _largest(
    table: SectionTable, one: Flank, design: Design, ramp: Ramp, jerk: bool, given: Mapping[str, float]
) -> np.ndarray:
    """The x (n) with the largest area; raises InputError where the limits cannot be met."""
    x, stretch = best_levels(table, one, design, ramp, jerk, given)
    if stretch > STRETCH_ROUND_OFF:
        raise InputError(
            f"{table.family}: no member found within the limits of [design]; the best breaks one by "
            f"{100 * stretch:.2g} %: loosen the limits on acceleration and jerk, those of the drawing, or the maximum "
            f"lift"
        )
    return x


def _checked(table: SectionTable, sections_deg: Sequence[float], half_deg: float) -> np.ndarray:
    angles = np.array(sections_deg, dtype=float)
    if angles.shape != (len(table.sections),) or not np.all(np.isfinite(angles)) or np.any(angles <= 0):
        raise InputError(f"{table.family}: sections_deg {sections_deg}: {len(table.sections)} positive angles needed")
    if abs(angles.sum() - half_deg) > 1e-6:
        raise InputError(
            f"{table.family}: sections_deg {sections_deg} sum to {angles.sum():g} and must sum to half the duration, "
            f"{half_deg:g}"
        )
    return angles * half_deg / angles.sum()
