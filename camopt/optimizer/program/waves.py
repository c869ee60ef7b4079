"""Where the jerk may change its sign, for designs that limit how often it does.

With given angles of the changes the limit is linear; which angles allow most area is searched. The pattern of the cam
without the limit loses its smallest ripples until it has few enough changes; then one angle after another is moved by
steps that shrink, as long as that helps (Hooke and Jeeves 1961, without their pattern moves). What the search finds is
a cam that holds the limit and no proof that none is larger; the bound leaves the limit out.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.cam.families.shape_rows import cells, sign_rows
from camopt.cam.geometry import sign_changes
from camopt.cam.lift import Lift
from camopt.highs import Infeasible
from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.kinematic import elastic_shape, kinematic_optimum
from camopt.optimizer.program.linear_program import ElasticProgram
from camopt.optimizer.program.no_jump import NoJumpProgram
from camopt.scene.design import Design
from camopt.scene.units import MM_PER_DEG3

FEW = 5
"""Sign changes of a cam with one ripple, from which the search starts too: with many it may stop at a lesser cam."""
STEPS = (6, 3, 1)
"""Cells by which an angle is moved, one after another."""
WORTH = 1e-6
"""Gain in area ratio below which an angle stays."""
SHORT_OF_JERK = 10.0 / (1e-3 * MM_PER_DEG3)
"""Area ratio that a jerk of the wrong sign costs in the search [1/(m/rad^3)]: more than any cam gains by it."""

Switches = tuple[float, ...]


def kinematic_switches(design: Design, cam: FreeCam) -> Switches:
    """The angles [rad] at which the jerk changes its sign with the largest area that the limits on the shape allow.

    Empty where these limits contradict each other even without a limit on the changes.
    """
    assert design.waves_max is not None, "only such designs have switches"
    try:
        unlimited = kinematic_optimum(design, _about(cam, ()), explain=False).lift
    except Infeasible:
        return ()
    starts = {_fewer(unlimited, cam, most) for most in (design.waves_max, min(design.waves_max, FEW))}
    first = _about(cam, next(iter(starts)))
    jerk = (design.jerk_max_mm_per_deg3 or 1e-3) * MM_PER_DEG3
    value = _value(
        *elastic_shape(design, first, ["waves_max"], SHORT_OF_JERK, jerk), cam, first.limits(design).rows("waves_max")
    )
    return max((_climbed(value, start, cells(cam)) for start in sorted(starts)), key=value)


def with_switches(program: NoJumpProgram, margin_N: float) -> NoJumpProgram:
    """The program with the angles at which the jerk changes its sign with the largest area for a common margin.

    The margins may fall where no cam keeps them with as few changes. Raises NoCamHoldsContact where the limits on the
    shape allow no cam. A program whose design does not limit the changes is given back as it is.
    """
    design, cam = program.design, program.cam
    if design.waves_max is None or not cam.about.switches:
        return program
    margins = Margins(margin_N, margin_N, margin_N)
    elastic, bound = program.elastic(margins.table(len(program.blocks)))
    value = _value(elastic, bound, cam, program.limits.rows("waves_max"))
    starts = [cam.about.switches]
    try:
        unlimited = replace(program, cam=_about(cam, ())).solve(margins, explain=False)
        starts.append(_fewer(unlimited.lift, cam, design.waves_max))
    except Infeasible:
        pass
    return replace(program, cam=_about(cam, _climbed(value, max(starts, key=value), cells(cam))))


def _value(program: ElasticProgram, bound: np.ndarray, cam: FreeCam, signed: np.ndarray) -> Callable[[Switches], float]:
    """The program's value as a function of the switches, which change the right sides of the rows `signed`."""

    def value(switches: Switches) -> float:
        other = bound.copy()
        other[signed] = sign_rows(cam, switches)[1]
        return program.value(other)

    return value


def _about(cam: FreeCam, switches: Switches) -> FreeCam:
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
