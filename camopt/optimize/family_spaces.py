"""What may be searched in a cam family: the vector of its free parameters, and the member that belongs to it.

A sectioned family is searched over its section angles and over how much of each limit it may use; for each such
point its levels solve a linear program, the largest area under limits so tightened. A cam that uses less than its
limits allow bounces less, and this way of leaving room costs the least area. Polydyne and the exponent polynomial
are searched over their exponents, Polydyne over its design speed too. A family without free parameters is one point.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np

from camopt.cam.families import new_design
from camopt.cam.families.exponent import exponent
from camopt.cam.families.largest_area import POPULATION, angle_shares, best_angles, best_levels, section_angles
from camopt.cam.families.member import cam_of
from camopt.cam.families.polydyne import polydyne
from camopt.cam.families.sections import SectionTable, flank
from camopt.cam.lift import Lift
from camopt.cam.ramps import symmetric_conditions
from camopt.cam.read import FAMILIES, family_and_keywords, read_cam
from camopt.scene import InputError, Scene
from camopt.scene.schema import Design
from camopt.scene.units import DEG

GAPS = [(2.0, 24.0), (1.0, 24.0), (1.0, 24.0), (1.0, 24.0)]
"""From one exponent to the next, the first being 2: none comes out above 98."""
PLAIN_GAPS = (8.0, 8.0, 8.0, 8.0)
DESIGN_SPEEDS = 0.4, 1.1
"""Polydyne's design speed over the highest listed speed."""
LEAST_USE = 0.3
"""Part of a limit that a searched member may use at least."""
TIGHTENED = ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3")
START_RATIOS = 0.5, 0.95
"""Table 2's range of a12* / a12."""


@dataclass(frozen=True)
class Space:
    """Bounds of a family's search vector and its member there; no bounds where the family is one cam.

    `known` vectors join the first population of a search.
    `largest` designs the largest area within the limits on the shape alone, from (number of members, seed), where the
    family has a method of its own for that. `member` raises InputError where there is none.
    """

    bounds: list[tuple[float, float]]
    member: Callable[[np.ndarray], Lift]
    known: Sequence[Sequence[float]] = ()
    largest: Callable[[int, int], Lift] | None = None


def family_space(scene: Scene, family: str, jerk: bool) -> Space:
    """The search space of a family under a scene's limits, the jerk limit only with `jerk`.

    `family` is a name as of the command line, optionally with what tells its readings apart
    (`new-design:start_ratio=0,quintic=yes`). Raises InputError for an unknown family, for a parameter that the search
    chooses, and for a scene whose two ramps differ.
    """
    name, given = family_and_keywords(family)
    searched = {"exponents", "design_speed_rpm", "sections_deg", "jerk"}
    searched |= {f"{order}{i}{i + 1}" for order in "aj" for i in range(1, 5)}
    if chosen := sorted(searched & given.keys()):
        raise InputError(f"baseline {family!r}: the search chooses {', '.join(chosen)}: leave it out")
    if name in ("polydyne", "exponent"):
        return _exponents(scene, name, given)
    if name == "new-design":
        return _new_design(scene, jerk, **given)
    if FAMILIES[name].table:
        module = import_module(FAMILIES[name].module)
        table = getattr(module, FAMILIES[name].table)
        return _sections(scene, lambda _: (table, {}), module.STARTS, [], jerk)
    return Space([], lambda _: read_cam(family, scene))


def _exponents(scene: Scene, name: str, given: dict) -> Space:
    """Gaps between the exponents; below 8 they are rounded, as only integers are smooth enough at the nose there."""
    assert scene.operation is not None, "load_scene(..., need='operation') guarantees it"
    top = scene.operation.speeds_rpm[-1]

    def member(x: np.ndarray) -> Lift:
        found = [2.0]
        for gap in x[:4]:
            power = found[-1] + float(gap)
            found.append(power if power >= 8 else float(round(power)))
        if name == "exponent":
            return exponent(scene, tuple(found), **given)
        return polydyne(scene, tuple(found), float(x[4]), **given)

    speeds = [] if name == "exponent" else [(DESIGN_SPEEDS[0] * top, DESIGN_SPEEDS[1] * top)]
    return Space([*GAPS, *speeds], member, [[*PLAIN_GAPS, *([top] if speeds else [])]])


def _new_design(scene: Scene, jerk: bool, start_ratio: float | None = None, quintic: bool = False) -> Space:
    """Table 2's start ratio is free in its range; under a jerk limit only the repaired reading, 0, is possible."""
    limited = jerk and scene.design is not None and scene.design.jerk_max_mm_per_deg3 is not None
    if start_ratio is None and limited:
        start_ratio = 0.0

    def table_of(x: np.ndarray) -> tuple[SectionTable, dict]:
        ratio = float(x[0]) if start_ratio is None else start_ratio
        reading = {"start_ratio": ratio, "section_II": "quintic" if quintic else "quartic"}
        return new_design.table_2(quintic, ratio), reading

    return _sections(scene, table_of, new_design.STARTS, [START_RATIOS] if start_ratio is None else [], jerk)


def _sections(scene: Scene, table_of: Callable, starts, own: list[tuple[float, float]], jerk: bool) -> Space:
    """The vector: `own` parameters that change the table, shares of the half duration, used parts of the limits."""
    at_most = np.array([high for _, high in own])  # the largest start ratio has the largest area
    table, _ = table_of(at_most)
    design, ramp = symmetric_conditions(scene, table.family)
    half = design.duration_deg * DEG / 2
    cuts = len(own) + len(table.sections) - 1
    names = [n for n in TIGHTENED if getattr(design, n) is not None and (jerk or "jerk" not in n)]

    def cam(x: np.ndarray, angles: np.ndarray, limits: Design) -> Lift:
        table, reading = table_of(x)
        one = flank(table, angles)
        levels, _ = best_levels(table, one, limits, ramp, jerk, {})
        return cam_of(table, one, angles, levels, ramp, **reading)

    def member(x: np.ndarray) -> Lift:
        used = {n: float(u) * getattr(design, n) for n, u in zip(names, x[cuts:], strict=True)}
        return cam(x, section_angles(x[len(own) : cuts], half), design.model_copy(update=used))

    def largest(members: int, seed: int) -> Lift:
        generations = max(1, members // POPULATION - 1)
        return cam(at_most, best_angles(table, design, ramp, jerk, starts, generations, seed), design)

    bounds = [*own, *[(0.0, 1.0)] * (len(table.sections) - 1), *[(LEAST_USE, 1.0)] * len(names)]
    known = [[*at_most, *angle_shares(np.array(start) * half, half), *[1.0] * len(names)] for start in starts]
    return Space(bounds, member, known, largest)
