"""Radii of the cam under a roller or pad: linear programs in a row, each about the cam that the last one found.

Near a cam linear limits stand for the radii that are a little stricter (`camopt.cam.families.radius_planes`). A program
may break them at a price, so that it has a solution from whichever cam it starts. Once they hold, its neighbourhood is
half as wide as the last one's, down to a width at which the limits are as good as the radii themselves (sequential
linear programs in a trust region: Nocedal and Wright, Numerical Optimization, 2006, ch. 18). What stands at the end
holds the radii at every angle, and is no proof that no cam is larger; the bound leaves these limits out. Where contacts
must keep margins too, the programs begin near the cam that holds the radii, and may be short of the margins at a price.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.cam.families.radius_planes import Neighbourhood
from camopt.cam.lift import Lift
from camopt.cam.linear_limits import radii_held_near
from camopt.highs import Infeasible
from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.kinematic import elastic_shape, kinematic_optimum
from camopt.optimizer.program.linear_program import ElasticProgram
from camopt.optimizer.program.no_jump import NoJumpProgram
from camopt.scene.design import RADII, Design
from camopt.scene.units import MM_PER_DEG2

WIDTHS = (1 / 4, 1 / 8, 1 / 16)
"""Shares of lift and velocity by which a cam may differ from the last one: with the smallest one the limits are
stricter than the radii by less than a thousandth of them."""
STANDS = 1e-5
"""Change of the area ratio below which a cam stands."""
MOST_SOLUTIONS = 20
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
    """The free cam with its radii held near the cam of largest area that holds them.

    A design without such radii gives the cam back as it is, and so do limits that contradict each other even without
    them. Where no cam was found that holds them, it is near the one that misses least.
    """
    if not radii_held_near(design):
        return cam
    try:
        lift = kinematic_optimum(design.model_copy(update=dict.fromkeys(RADII)), cam, explain=False).lift
    except Infeasible:
        return cam
    keys = radii_held_near(design)
    return _narrowed(lambda held: elastic_shape(design, held, keys, SHORT_OF_RADIUS, TYPICAL_SHORT), cam, lift)


def with_radii(program: NoJumpProgram, margin_N: float) -> NoJumpProgram:
    """The program with its radii held near the cam of largest area that keeps a common margin or misses it least.

    A program that holds no radii so is given back as it is.
    """
    held = program.cam.about.near
    if held is None:
        return program
    margins = Margins(margin_N, margin_N, margin_N).table(len(program.blocks))
    cam = _narrowed(lambda cam: replace(program, cam=cam).elastic(margins), program.cam, held.lift)
    return replace(program, cam=cam)


def _narrowed(program_of: Callable[[FreeCam], tuple[ElasticProgram, np.ndarray]], cam: FreeCam, lift: Lift) -> FreeCam:
    """The free cam with its radii held near a cam that is the best one near itself, the one that the programs reach
    from `lift` on; `program_of` gives the program of a free cam and its right sides."""
    width, reached, missed = 0, -np.inf, np.inf
    for _ in range(MOST_SOLUTIONS):
        try:
            program, bound = program_of(near(cam, lift, WIDTHS[width]))
            found = program.solve(bound)
        except (Infeasible, ArithmeticError):  # of a program that the solver does not decide, too
            break
        lift, short = cam.lift(found.z[:-1]), float(found.z[-1])
        if WIDTHS[width] == WIDTHS[-1] and found.value - reached < STANDS:
            break
        if short <= 0 or short > BETTER * missed:  # else the same width brings it nearer
            width = min(width + 1, len(WIDTHS) - 1)
        reached, missed = found.value, short
    return near(cam, lift)
