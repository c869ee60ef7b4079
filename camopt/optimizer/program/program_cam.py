"""The free cam on which the programs work, with the limits that are not linear taken where they allow most area.

A duration at a lift is held about a centre, and for a given centre it is linear. The centres are searched one after
another, about each by bounded scalar minimisation (Brent 1973, ch. 5), on a coarse spline. A centre leaves the middle
of the event only where that brings area, so that a symmetric design stays symmetric. Where the jerk may change its sign
is searched after them (`camopt.optimizer.program.waves`), and last near which cam radii under a circle are held
(`camopt.optimizer.program.radii`).
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from camopt.cam.families.free import FreeCam, free_cam
from camopt.cam.families.shape_rows import LinearisationPoint
from camopt.cam.linear_limits import radii_held_near
from camopt.highs import Infeasible
from camopt.optimizer.program.kinematic import area_ratio_row, first_working, solve_over_peak_angles, spline_rows
from camopt.optimizer.program.radii import near_its_best
from camopt.optimizer.program.waves import kinematic_switches
from camopt.scene.design import Design
from camopt.scene.units import DEG

COARSE_DEG = 4.0
"""Knot interval of the search for centres."""
FARTHEST_DEG = 12.0
"""Farthest centre from the middle that is tried: valve events lean by less."""
RESOLUTION_DEG = 0.05
WORTH = 1e-6
"""Gain in area ratio below which a centre stays."""
ROUNDS = 2


def program_cam(design: Design, knot_deg: float) -> FreeCam:
    """The free cam of a design with knots about every `knot_deg`, for the programs."""
    cam = free_cam(design, knot_deg)
    if not design.duration_at and design.waves_max is None and not radii_held_near(design):
        return cam
    return replace(cam, about=_about(design))


@lru_cache(maxsize=64)
def _about(design: Design) -> LinearisationPoint:
    """Where the limits that are not linear are taken: the durations' centres, the waves' sign changes, the radii."""
    plain = design.model_copy(update={"waves_max": None})
    about = LinearisationPoint(centres(plain) if design.duration_at else ())
    cam = replace(free_cam(design, COARSE_DEG), about=about)
    if design.waves_max is not None:
        cam = replace(cam, about=replace(about, switches=kinematic_switches(design, cam)))
    return near_its_best(design, cam).about


def centres(design: Design) -> tuple[float, ...]:
    """The middle [rad] of each of the design's durations with the largest area; zeros where none has a cam."""
    cam, count = free_cam(design, COARSE_DEG), len(design.duration_at)

    def area(at: tuple[float, ...]) -> float:
        tried = replace(cam, about=LinearisationPoint(at))
        limits, (row, _) = tried.limits(design), area_ratio_row(design, tried)
        try:
            return solve_over_peak_angles(
                tried, design, row, spline_rows(limits.matrix), limits.bound, first_working(limits)
            ).value
        except Infeasible:
            return -1.0

    best = (0.0,) * count
    reached = area(best)
    for _ in range(ROUNDS if count > 1 else 1):
        for i in range(count):
            trial = [_with(best, i, x) for x in np.linspace(-1, 1, 9) * FARTHEST_DEG * DEG]
            start = max(trial, key=area)
            width = FARTHEST_DEG * DEG / 4
            found: Any = minimize_scalar(
                lambda x, i=i, best=best: -area(_with(best, i, x)),
                bounds=(start[i] - width, start[i] + width),
                method="bounded",
                options={"xatol": RESOLUTION_DEG * DEG},
            )
            moved = _with(best, i, float(found.x))
            if -float(found.fun) > reached + WORTH:
                best, reached = moved, -float(found.fun)
    return best


def _with(values: tuple[float, ...], i: int, value: float) -> tuple[float, ...]:
    return (*values[:i], float(value), *values[i + 1 :])
