"""The free cam on which the programs work, with the limits that are not linear taken where they allow most area.

A duration at a lift is linear about a given centre. The centres are searched one after another, each by bounded scalar
minimisation (Brent 1973, ch. 5), on a coarse spline. A centre leaves the middle of the event only where that brings
area, so that a symmetric design stays symmetric.

The limit on how often the jerk changes its sign is linear at given angles of change. The pattern of the cam without
that limit loses its smallest ripples until it has few enough changes; then one angle after another is moved by steps
that shrink, as long as that helps (Hooke and Jeeves 1961, without their pattern moves).

The radii under a roller or pad are replaced near a cam by linear limits that are a little stricter
(`camopt.cam.families.radius_planes`). A program may break them, or be short of margins, at a price, so that it has a
solution from any cam. Once they hold, its neighbourhood is halved, down to a width at which the limits are as good as
the radii themselves (sequential linear programs in a trust region: Nocedal and Wright, Numerical Optimization, 2006,
ch. 18).

What a search finds holds its limit at every angle, and is no proof that no cam is larger; the bound leaves these limits
out.
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
"""Shares of lift and velocity by which a cam may differ from the last one: with the smallest one the limits are
stricter than the radii by less than a thousandth of them."""
CAM_STANDS = 1e-5
"""Change of the area ratio below which a cam stands."""
MOST_NARROWINGS = 20
BETTER = 0.9
"""Share of what the cam was short of that is left where the next program is near enough to go on as wide."""
SHORT_OF_RADIUS = 10.0 / (1e-3 * MM_PER_DEG2)
"""Area ratio that breaking a radius costs, by the acceleration that is missing [1/(m/rad^2)]: more than any cam gains
by it."""
TYPICAL_SHORT = 0.01 * MM_PER_DEG2
"""Such an acceleration of usual size [m/rad^2]."""


def near(cam: FreeCam, lift: Lift, share: float = WIDTHS[-1]) -> FreeCam:
    """The free cam with its radii held near a cam."""
    return replace(cam, about=replace(cam.about, near=Neighbourhood(lift, share)))


def near_its_best(design: Design, cam: FreeCam) -> FreeCam:
    """The free cam with its radii held near the cam of largest area that holds them, or misses them least; as it is for
    a design without such radii and for limits that contradict each other even without them."""
    if not radii_held_near(design):
        return cam
    try:
        lift = kinematic_optimum(design.model_copy(update=dict.fromkeys(RADII)), cam, explain=False).lift
    except Infeasible:
        return cam
    keys = radii_held_near(design)
    return _narrowed(lambda held: elastic_shape(design, held, keys, SHORT_OF_RADIUS, TYPICAL_SHORT), cam, lift)


def with_radii(program: NoJumpProgram, margin_N: float) -> NoJumpProgram:
    """The program with its radii, if it holds any, near the cam of largest area that keeps a common margin or misses it
    least."""
    held = program.cam.about.near
    if held is None:
        return program
    cam = _narrowed(lambda cam: replace(program, cam=cam).elastic(margin_N), program.cam, held.lift)
    return replace(program, cam=cam)


def _narrowed(program_of: Callable[[FreeCam], ElasticProgram], cam: FreeCam, lift: Lift) -> FreeCam:
    """The free cam with its radii held near a cam that is the best one near itself, the one that the programs reach
    from `lift` on."""
    width, reached, missed = 0, -np.inf, np.inf
    for _ in range(MOST_NARROWINGS):
        try:
            found = program_of(near(cam, lift, WIDTHS[width])).solve()
        except (Infeasible, ArithmeticError):  # of a program that the solver does not decide, too
            break
        lift, short = cam.lift(found.z[:-1]), float(found.z[-1])
        if WIDTHS[width] == WIDTHS[-1] and found.value - reached < CAM_STANDS:
            break
        if short <= 0 or short > BETTER * missed:  # else the same width brings it nearer
            width = min(width + 1, len(WIDTHS) - 1)
        reached, missed = found.value, short
    return near(cam, lift)


FEW = 5
"""Sign changes of a cam with one ripple, from which the search starts too: with many it may stop at a lesser cam."""
STEPS = (6, 3, 1)
"""Cells by which an angle is moved, one after another."""
WORTH = 1e-6
"""Gain in area ratio below which an angle, or a centre, stays."""
SHORT_OF_JERK = 10.0 / (1e-3 * MM_PER_DEG3)
"""Area ratio that a jerk of the wrong sign costs in the search [1/(m/rad^3)]: more than any cam gains by it."""

Switches = tuple[float, ...]


def kinematic_switches(design: Design, cam: FreeCam) -> Switches:
    """The angles [rad] at which the jerk changes its sign with the largest area that the limits on the shape allow;
    none where these contradict each other even without a limit on the changes."""
    assert design.waves_max is not None, "only such designs have switches"
    try:
        unlimited = kinematic_optimum(design, _with_switches(cam, ()), explain=False).lift
    except Infeasible:
        return ()
    starts = {_fewer(unlimited, cam, most) for most in (design.waves_max, min(design.waves_max, FEW))}
    first = _with_switches(cam, next(iter(starts)))
    jerk = (design.jerk_max_mm_per_deg3 or 1e-3) * MM_PER_DEG3
    program = elastic_shape(design, first, ["waves_max"], SHORT_OF_JERK, jerk)
    value = _value(program, cam, first.limits(design).rows("waves_max"))
    return max((_climbed(value, start, cells(cam)) for start in sorted(starts)), key=value)


def with_switches(program: NoJumpProgram, margin_N: float) -> NoJumpProgram:
    """The program with the angles at which the jerk changes its sign, if their number is limited, with the largest area
    for a common margin, which may fall where no cam keeps it with as few changes."""
    design, cam = program.design, program.cam
    if design.waves_max is None or not cam.about.switches:
        return program
    value = _value(program.elastic(margin_N), cam, program.limits.rows("waves_max"))
    starts = [cam.about.switches]
    try:
        unlimited = replace(program, cam=_with_switches(cam, ())).solve(margin_N, explain=False)
        starts.append(_fewer(unlimited.lift, cam, design.waves_max))
    except Infeasible:
        pass
    return replace(program, cam=_with_switches(cam, _climbed(value, max(starts, key=value), cells(cam))))


def _value(program: ElasticProgram, cam: FreeCam, signed: np.ndarray) -> Callable[[Switches], float]:
    """The program's value as a function of the switches, which change the right sides of the rows `signed`."""

    def value(switches: Switches) -> float:
        bound = program.bound.copy()
        bound[signed] = sign_rows(cam, switches)[1]
        try:
            return program.solve(bound).value
        except (Infeasible, ArithmeticError):  # of a pattern that the solver does not decide, too
            return -np.inf

    return value


def _with_switches(cam: FreeCam, switches: Switches) -> FreeCam:
    return replace(cam, about=replace(cam.about, switches=switches))


def _fewer(lift: Lift, cam: FreeCam, most: int) -> Switches:
    """The angles of a cam's changes, at the nearest cells, without its smallest ripples where there are too many."""
    marks, angles = cells(cam), sign_changes(lift)
    while len(angles) > most:
        ends = lift(angles, 2)
        smallest = int(np.argmin(np.abs(np.diff(ends))))  # the least rise or fall between two changes
        angles = np.delete(angles, [smallest, smallest + 1])
    nearest = np.clip(np.round((angles - marks[0]) / (marks[1] - marks[0])).astype(int), 1, len(marks) - 2)
    return tuple(float(marks[i]) for i in np.unique(nearest))


def _climbed(value: Callable[[Switches], float], start: Switches, marks: np.ndarray) -> Switches:
    """The angles from `start` on that no step along `marks` improves any more."""
    best, at = value(start), np.searchsorted(marks, np.array(start) - 1e-9)
    for step in STEPS:
        moving = True
        while moving:
            moving = False
            for i in range(len(at)):
                for way in (-step, step):
                    trial = at.copy()
                    trial[i] += way
                    if np.any(np.diff(np.concatenate([[0], trial, [len(marks) - 1]])) < 1):
                        continue
                    reached = value(tuple(marks[trial]))
                    if reached > best + WORTH:
                        at, best, moving = trial, reached, True
    return tuple(float(x) for x in marks[at])


COARSE_DEG = 4.0
"""Knot interval of the search for centres."""
FARTHEST_DEG = 12.0
"""Farthest centre from the middle that is tried: valve events lean by less."""
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
