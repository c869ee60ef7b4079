"""The free cam of the programs, with its nonlinear limits linearised where they permit the largest area.

A duration at a lift is linear for a given centre of the interval. The centres are optimised one after another, each by
bounded scalar minimisation (Brent 1973, ch. 5), on a coarse spline. A centre is moved from the middle of the event only
if this increases the area, so that a symmetric design stays symmetric.

The limit on the number of sign changes of the jerk is linear for given angles of these changes. The search starts from
the sign changes of the cam without that limit, of which the smallest ripples are removed until there are few enough.
Then the angles are moved one after another by decreasing steps, as long as the area increases (Hooke and Jeeves 1961,
without their pattern moves).

The radii under a roller or pad are replaced near a cam by linear limits that are slightly stricter
(`camopt.cam.families.radius_planes`). A program may violate these, or miss margins, at a penalty, so that it has a
solution from any cam. Once the limits hold, the neighbourhood is halved, down to a width at which they are as good as
the radii themselves (sequential linear programs in a trust region: Nocedal and Wright, Numerical Optimization, 2006,
ch. 18).

The resulting cam keeps these limits at every angle, but it is not proven to be the largest; the bound omits them.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from camopt.cam.families.free import FreeCam, free_cam
from camopt.cam.families.radius_planes import Neighbourhood
from camopt.cam.families.shape_rows import LinearisationPoint, cells, sign_rows
from camopt.cam.geometry import sign_changes
from camopt.cam.lift import Lift
from camopt.cam.linear_limits import radii_held_near
from camopt.highs import Infeasible
from camopt.optimizer.program.kinematic import elastic_shape, kinematic_optimum
from camopt.optimizer.program.linear_program import ElasticProgram
from camopt.optimizer.program.no_jump import NoJumpProgram
from camopt.scene.design import RADII, Design
from camopt.scene.units import DEG, MM_PER_DEG2, MM_PER_DEG3

WIDTHS = (1 / 4, 1 / 8, 1 / 16)
"""Widths of the neighbourhood: relative change of lift and velocity from the last cam. With the smallest width the
linear limits are stricter than the radii by less than a thousandth of these."""
CAM_CONVERGED = 1e-5
"""Change of the area ratio below which the cam has converged."""
MOST_NARROWINGS = 20
"""Largest number of programs for the radii."""
PROGRESS = 0.9
"""Largest ratio of one program's violation to that of the previous one for which the width is kept: a program that
reduces the violation by more makes progress at this width."""
SHORT_OF_RADIUS = 10.0 / (1e-3 * MM_PER_DEG2)
"""Penalty in area ratio per missing acceleration [1/(m/rad^2)] of a violated radius: more than any cam gains by it."""
TYPICAL_SHORT = 0.01 * MM_PER_DEG2
"""Typical size of a missing acceleration [m/rad^2], for the solver's scaling."""


def near(cam: FreeCam, lift: Lift, share: float = WIDTHS[-1]) -> FreeCam:
    """The free cam with its radii linearised near a cam."""
    return replace(cam, about=replace(cam.about, near=Neighbourhood(lift, share)))


def linearised_at_best(design: Design, cam: FreeCam) -> FreeCam:
    """The free cam with its radii linearised near the cam of largest area that keeps them, or violates them least. It
    is unchanged for a design without such radii, and where the limits contradict each other even without the radii."""
    if not radii_held_near(design):
        return cam
    try:
        lift = kinematic_optimum(design.model_copy(update=dict.fromkeys(RADII)), cam, explain=False).lift
    except Infeasible:
        return cam
    keys = radii_held_near(design)
    return _converged_radii(lambda held: elastic_shape(design, held, keys, SHORT_OF_RADIUS, TYPICAL_SHORT), cam, lift)


def with_radii_near(program: NoJumpProgram, lift: Lift) -> NoJumpProgram:
    """The program with its radii, if it limits any, linearised near a cam."""
    return program if program.cam.about.near is None else replace(program, cam=near(program.cam, lift))


def with_radii(program: NoJumpProgram, margin_N: float) -> NoJumpProgram:
    """The program with any radii linearised near the cam of largest area that keeps a margin or misses it least."""
    held = program.cam.about.near
    if held is None:
        return program
    cam = _converged_radii(lambda cam: replace(program, cam=cam).elastic(margin_N), program.cam, held.lift)
    return replace(program, cam=cam)


def _converged_radii(program_of: Callable[[FreeCam], ElasticProgram], cam: FreeCam, lift: Lift) -> FreeCam:
    """The free cam with its radii linearised near the cam to which successive programs converge from `lift`."""
    width, reached, last_violation = 0, -np.inf, np.inf
    for _ in range(MOST_NARROWINGS):
        try:
            optimum = program_of(near(cam, lift, WIDTHS[width])).solve()
        except (Infeasible, ArithmeticError):  # the latter if the solver does not decide the program
            break
        lift, violation = cam.lift(optimum.z[:-1]), float(optimum.z[-1])
        if WIDTHS[width] == WIDTHS[-1] and optimum.value - reached < CAM_CONVERGED:
            break
        if violation <= 0 or violation > PROGRESS * last_violation:
            width = min(width + 1, len(WIDTHS) - 1)
        reached, last_violation = optimum.value, violation
    return near(cam, lift)


FEW = 5
"""Number of sign changes of a cam with one ripple. The search also starts from such a pattern, because from a pattern
with many changes it may end at a smaller area."""
STEPS = (6, 3, 1)
"""Successive step sizes, in cells, by which the angles are moved."""
LEAST_GAIN = 1e-6
"""Gain in area ratio below which an angle or a centre is not moved."""
SHORT_OF_JERK = 10.0 / (1e-3 * MM_PER_DEG3)
"""Penalty in area ratio on a jerk of the wrong sign during the search [1/(m/rad^3)]: more than any cam gains by it."""

Switches = tuple[float, ...]


def kinematic_switches(design: Design, cam: FreeCam) -> Switches:
    """The angles [rad] of the jerk's sign changes that give the largest area under the limits on the shape; none where
    these contradict each other even without a limit on the sign changes."""
    assert design.waves_max is not None, "only such designs have switches"
    try:
        unlimited = kinematic_optimum(design, _with_switches(cam, ()), explain=False).lift
    except Infeasible:
        return ()
    starts = {_without_ripples(unlimited, cam, most) for most in (design.waves_max, min(design.waves_max, FEW))}
    first = _with_switches(cam, next(iter(starts)))
    jerk = (design.jerk_max_mm_per_deg3 or 1e-3) * MM_PER_DEG3
    program = elastic_shape(design, first, ["waves_max"], SHORT_OF_JERK, jerk)
    value = _value(program, cam, first.limits(design).rows("waves_max"))
    return max((_pattern_search(value, start, cells(cam)) for start in sorted(starts)), key=value)


def with_switches(program: NoJumpProgram, margin_N: float) -> NoJumpProgram:
    """The program with those angles of the jerk's sign changes, if their number is limited, that give the largest area
    for a common margin. The margin may be missed at a penalty where no cam with so few changes keeps it."""
    design, cam = program.design, program.cam
    if design.waves_max is None or not cam.about.switches:
        return program
    value = _value(program.elastic(margin_N), cam, program.limits.rows("waves_max"))
    starts = [cam.about.switches]
    try:
        unlimited = replace(program, cam=_with_switches(cam, ())).solve(margin_N, explain=False)
        starts.append(_without_ripples(unlimited.lift, cam, design.waves_max))
    except Infeasible:
        pass
    return replace(program, cam=_with_switches(cam, _pattern_search(value, max(starts, key=value), cells(cam))))


def _value(program: ElasticProgram, cam: FreeCam, signed: np.ndarray) -> Callable[[Switches], float]:
    """The program's value as a function of the switches, which change the right-hand sides of the rows `signed`."""

    def value(switches: Switches) -> float:
        bound = program.bound.copy()
        bound[signed] = sign_rows(cam, switches)[1]
        try:
            return program.solve(bound).value
        except (Infeasible, ArithmeticError):  # the latter if the solver does not decide the program
            return -np.inf

    return value


def _with_switches(cam: FreeCam, switches: Switches) -> FreeCam:
    return replace(cam, about=replace(cam.about, switches=switches))


def _without_ripples(lift: Lift, cam: FreeCam, most: int) -> Switches:
    """At most `most` angles of a cam's sign changes of the jerk, at cell borders, without its smallest ripples."""
    marks, angles = cells(cam), sign_changes(lift)
    while len(angles) > most:
        ends = lift(angles, 2)
        smallest = int(np.argmin(np.abs(np.diff(ends))))  # the smallest change of acceleration between two sign changes
        angles = np.delete(angles, [smallest, smallest + 1])
    nearest = np.clip(np.round((angles - marks[0]) / (marks[1] - marks[0])).astype(int), 1, len(marks) - 2)
    return tuple(float(marks[i]) for i in np.unique(nearest))


def _pattern_search(value: Callable[[Switches], float], start: Switches, marks: np.ndarray) -> Switches:
    """The angles reached from `start` by steps along `marks` that increase the value, until none does."""
    best, indices = value(start), np.searchsorted(marks, np.array(start) - 1e-9)
    for step in STEPS:
        moving = True
        while moving:
            moving = False
            for i in range(len(indices)):
                for shift in (-step, step):
                    trial = indices.copy()
                    trial[i] += shift
                    if np.any(np.diff(np.concatenate([[0], trial, [len(marks) - 1]])) < 1):
                        continue
                    reached = value(tuple(marks[trial]))
                    if reached > best + LEAST_GAIN:
                        indices, best, moving = trial, reached, True
    return tuple(float(x) for x in marks[indices])


COARSE_DEG = 4.0
"""Knot interval of the coarse cam in the search for centres and sign changes."""
FARTHEST_DEG = 12.0
"""Largest distance of a centre from the middle of the event that is tried; valve events are less asymmetric."""
RESOLUTION_DEG = 0.05
ROUNDS = 2


def program_cam(design: Design, knot_deg: float) -> FreeCam:
    """The free cam of a design with knots about every `knot_deg`, for the programs."""
    cam = free_cam(design, knot_deg)
    if not design.duration_at and design.waves_max is None and not radii_held_near(design):
        return cam
    return replace(cam, about=_about(design))


@lru_cache(maxsize=64)
def _about(design: Design) -> LinearisationPoint:
    """The linearisation of the nonlinear limits: centres of the durations, sign changes of the waves, and radii."""
    plain = design.model_copy(update={"waves_max": None})
    about = LinearisationPoint(centres(plain) if design.duration_at else ())
    cam = replace(free_cam(design, COARSE_DEG), about=about)
    if design.waves_max is not None:
        cam = replace(cam, about=replace(about, switches=kinematic_switches(design, cam)))
    return linearised_at_best(design, cam).about


def centres(design: Design) -> tuple[float, ...]:
    """The centres [rad] of the design's durations that give the largest area; zeros where no centre has a cam."""
    cam, count = free_cam(design, COARSE_DEG), len(design.duration_at)

    def area(at: tuple[float, ...]) -> float:
        try:
            return kinematic_optimum(design, replace(cam, about=LinearisationPoint(at)), explain=False).optimum.value
        except Infeasible:
            return -1.0

    best = (0.0,) * count
    reached = area(best)
    for _ in range(ROUNDS if count > 1 else 1):
        for i in range(count):
            trial = [_with(best, i, x) for x in np.linspace(-1, 1, 9) * FARTHEST_DEG * DEG]
            start = max(trial, key=area)
            width = FARTHEST_DEG * DEG / 4
            result: Any = minimize_scalar(
                lambda x, i=i, best=best: -area(_with(best, i, x)),
                bounds=(start[i] - width, start[i] + width),
                method="bounded",
                options={"xatol": RESOLUTION_DEG * DEG},
            )
            moved = _with(best, i, float(result.x))
            if -float(result.fun) > reached + LEAST_GAIN:
                best, reached = moved, -float(result.fun)
    return best


def _with(values: tuple[float, ...], i: int, value: float) -> tuple[float, ...]:
    return (*values[:i], float(value), *values[i + 1 :])
