"""The members of a sectioned family and its record, whose construction and search space follow from its table.

A sectioned family is searched over its section angles and over the share of each limit that it may use. At each such
point its levels have the largest area under the limits tightened to these shares. A cam that uses less than its limits
permit bounces less, and this way of leaving a margin costs the least area.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from camopt.cam.families.largest_area import POPULATION, angle_shares, best_angles, best_levels, section_angles
from camopt.cam.families.record import BuildEvent, Family, Parameter, Parameters, Space, number, numbers, yes_or_no
from camopt.cam.families.sections import Flank, SectionTable, close_flank, opening_flank
from camopt.cam.lift import Lift
from camopt.cam.ramps import Ramp, symmetric_conditions
from camopt.scene import InputError, Scene
from camopt.scene.design import Design
from camopt.scene.units import DEG, MM

LEAST_USE = 0.3
"""Least share of a limit that a searched member may use."""
TIGHTENED = ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3")
"""Limits of which a searched member uses a share."""

TableOf = Callable[[Mapping[str, Any]], SectionTable]
"""Function from a mapping with parameters to the table of a family whose table depends on them."""
STRETCH_ROUND_OFF = 1e-8
"""Relaxation of the limits up to which it counts as none."""


def sectioned_family(
    design: Callable[..., Lift],
    table: SectionTable,
    starts: Sequence[Sequence[float]],
    levels: Sequence[str] = (),
    line: tuple[str, Any] | None = None,
) -> Family:
    """The record of a family that has a single table.

    `design` takes the scene and, as keywords, `sections_deg`, `jerk`, and the `levels` that its user may give, which
    have their unit in their name here (`a23_mm_per_deg2`). `starts` are as for `best_angles`.
    """
    return Family(
        table.family,
        design,
        section_parameters(levels),
        lambda _, cam: sections_construction(cam, lambda _: table),
        space=lambda scene, jerk: sections_space(scene, jerk, lambda _: table, starts),
        line=line,
    )


def section_parameters(levels: Sequence[str]) -> dict[str, Parameter]:
    """Section angles, levels and the switch for the jerk limit, by their names on the command line."""
    by_level = {level: Parameter(level.partition("_")[0], number) for level in levels}
    return {"sections_deg": Parameter("sections_deg", numbers)} | by_level | {"jerk": Parameter("jerk", yes_or_no)}


def sections_construction(cam: Lift, table_of: TableOf, settings: Sequence[str] = ()) -> tuple[Parameters, BuildEvent]:
    """The free parameters of a sectioned cam and its event; `settings` are those on which its table depends."""
    values = cam.parameters
    table = table_of(values)
    names = level_names(table)
    free = {name: values[name] for name, level in zip(names, table.levels, strict=True) if level not in table.closed_by}
    if len(table.sections) > 1:
        free["sections_deg"] = np.array(values["sections_deg"][:-1])
    free |= {name: values[name] for name in settings}

    def event(p: Parameters, ramp: Ramp, _: Ramp):
        moved_table = table_of(values | p)
        xp = p["duration_deg"].__array_namespace__()
        first = p.get("sections_deg", xp.zeros(0)) * DEG
        angles = xp.append(first, p["duration_deg"] * DEG / 2 - first.sum())
        flank = opening_flank(moved_table, angles)
        levels = [p.get(name, 0.0) * unit for name, unit in zip(names, moved_table.units(), strict=True)]
        x = xp.asarray([ramp.height, ramp.velocity, *levels])
        return flank.event(close_flank(moved_table, flank, x, p["max_lift_mm"] * MM, moved_table.closed_by))

    return free, event


def sections_space(
    scene: Scene,
    jerk: bool,
    table_of: TableOf,
    starts: Sequence[Sequence[float]],
    reading: Mapping[str, Any] | None = None,
    free_settings: Mapping[str, tuple[float, float]] | None = None,
) -> Space:
    """The search space, over `free_settings` in their bounds, shares of half the duration, and used shares of limits.

    `reading` has the parameters on which the table depends; those in `free_settings` take their values from the vector.
    """
    reading, free_settings = reading or {}, free_settings or {}
    at_most = np.array([high for _, high in free_settings.values()])  # the largest start ratio has the largest area
    table = table_of({**reading, **dict(zip(free_settings, at_most, strict=True))})
    design, ramp = symmetric_conditions(scene, table.family)
    half = design.duration_deg * DEG / 2
    cuts = len(free_settings) + len(table.sections) - 1
    names = [n for n in TIGHTENED if getattr(design, n) is not None and (jerk or "jerk" not in n)]

    def cam(x: np.ndarray, angles: np.ndarray, limits: Design) -> Lift:
        settings = {**reading, **{name: float(value) for name, value in zip(free_settings, x, strict=False)}}
        table = table_of(settings)
        flank = opening_flank(table, angles)
        levels, _ = best_levels(table, flank, limits, ramp, jerk, {})
        return cam_of(table, flank, angles, levels, ramp, **settings)

    def member(x: np.ndarray) -> Lift:
        used = {n: float(u) * getattr(design, n) for n, u in zip(names, x[cuts:], strict=True)}
        return cam(x, section_angles(x[len(free_settings) : cuts], half), design.model_copy(update=used))

    def largest(members: int, seed: int) -> Lift:
        generations = max(1, members // POPULATION - 1)
        return cam(at_most, best_angles(table, design, ramp, jerk, starts, generations, seed), design)

    bounds = [*free_settings.values(), *[(0.0, 1.0)] * (len(table.sections) - 1), *[(LEAST_USE, 1.0)] * len(names)]
    known = [[*at_most, *angle_shares(np.array(start) * half, half), *[1.0] * len(names)] for start in starts]
    return Space(bounds, member, known, largest)


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

    If `levels` gives all levels except those that the nose determines, the cam is that member, whatever the limits.
    Otherwise the remaining levels, and the section angles if they are None, are chosen for the largest area under the
    limits; the jerk limit applies only with `jerk`. Raises InputError for unusable angles or levels, and if no member
    satisfies them.
    """
    design, ramp = symmetric_conditions(scene, table.family)
    stated = {n: float(v) for n, v in levels.items() if v is not None}
    open_levels = [n for n in table.levels if n not in stated]
    if not all(np.isfinite(v) for v in stated.values()):
        raise InputError(f"{table.family}: levels {stated}: finite numbers are needed")
    if len(open_levels) < len(table.closed_by):
        raise InputError(
            f"{table.family}: all of {', '.join(table.levels)} are given; the maximum lift determines one: leave it out"
        )
    if sections_deg is None:
        if stated:
            raise InputError(f"{table.family}: {', '.join(stated)} given without sections_deg; give the angles too")
        angles = best_angles(table, design, ramp, jerk, starts)
    else:
        angles = _checked(table, sections_deg, design.duration_deg / 2) * DEG
    flank = opening_flank(table, angles)
    units = dict(zip(table.levels, table.units(), strict=True))
    si = {n: v * units[n] for n, v in stated.items()}
    if sections_deg is not None and len(open_levels) == len(table.closed_by):
        x = np.array([ramp.height, ramp.velocity, *(si.get(n, 0.0) for n in table.levels)])
        x = close_flank(table, flank, x, design.max_lift_mm * MM, open_levels)
    else:
        x, stretch = best_levels(table, flank, design, ramp, jerk, si)
        if stretch > STRETCH_ROUND_OFF:
            raise InputError(
                f"{table.family}: no member found within the limits of [design]; the best breaks one by "
                f"{100 * stretch:.2g} %: loosen the limits on acceleration and jerk, those of the drawing, or the "
                f"maximum lift"
            )
    return cam_of(table, flank, angles, x, ramp, **parameters)


def level_names(table: SectionTable) -> list[str]:
    """The levels with their units, as they are named in a cam's parameters and on the command line."""
    return [f"{n}_mm_per_deg{k}" for n, k in zip(table.levels, table.orders(), strict=True)]


def cam_of(table: SectionTable, flank: Flank, angles: np.ndarray, x: np.ndarray, ramp: Ramp, **parameters) -> Lift:
    """The cam with the levels x (n) on a flank with these section angles [rad], which become parameters of the cam."""
    levels = dict(zip(level_names(table), (x[2:] / table.units()).tolist(), strict=True))
    parameters = {"sections_deg": (angles / DEG).tolist(), **levels, **parameters}
    return flank.lift(x, ramp, table.family, parameters)


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
