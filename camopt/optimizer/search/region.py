"""The trust region, a box about a cam (Conn, Gould and Toint 2000), the exact rows, and the program of a step."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from camopt.highs import Infeasible
from camopt.optimizer.program.force_rows import Box
from camopt.optimizer.program.no_jump import SHORTFALL, NoJumpOptimum, NoJumpProgram, no_jump_program
from camopt.optimizer.program.phases import force_unit
from camopt.optimizer.program.relocation import converge_tangents, relocate
from camopt.scene.design import Design

FIRST, USUAL_ACCELERATION = 1e-2, 0.015
"""First width of the box [mm/deg^2], and the largest acceleration of the cam for which it is meant [mm/deg^2]: it is in
proportion to that of the scene."""
USUAL_TIMES = 33.0
"""What stands for a largest acceleration that the design leaves out, over its lift by the square of its duration."""
NARROWEST, WIDEST = 1 / 256, 4.0
"""Limits of the width, as parts of the first one."""
AIMED, BADLY = 0.25, 0.5
"""Error of the forces foretold, as a part of their change, for which the width is right, and the largest one with which
a cam becomes the centre of the next box."""
NARROWING, CHANGE = 0.1, 4.0
"""Least factor by which the box becomes narrower at once, and largest one by which it becomes wider from a cam to the
next."""
RINGS = 200.0
"""By how much all margins may fall together, times the unit of force, before the rows hold mean forces: more than twice
the tension that a margin may ever allow, which no motion that holds the limits has at all angles."""
MOST_AVERAGED = 64
"""Rows on either side over which forces are averaged at most."""
EXACT = 1e-9
"""Error that counts as none."""


class ExactRows:
    """Where the rows of a program come from: the closed periodic response, with contacts that switch where event-exact
    finds it on a cam. Another source has the same methods."""

    name = "exact"

    def __init__(self) -> None:
        self.jacobians = 0

    def first(self, program: NoJumpProgram, z: np.ndarray) -> tuple[NoJumpProgram, np.ndarray]:
        """The program with its rows about a cam near z (m), and that cam; here at the angles of static load transfer,
        which do not depend on it."""
        self.jacobians += 1
        return converge_tangents(no_jump_program(program.train, program.design, program.cam, program.speeds)), z

    def errors_at(self, program: NoJumpProgram, z: np.ndarray) -> np.ndarray:
        """The errors (s) of the forces that the rows foretold for the cam of z (m), as parts of their change; zero,
        since here forces are straight in z while contacts switch at the same angles."""
        return np.zeros(len(program.blocks))

    def about(self, program: NoJumpProgram, z: np.ndarray) -> NoJumpProgram:
        """The program with its rows about the cam of z (m), where `errors_at` was asked last; here at the angles of its
        settled motion."""
        self.jacobians += 1
        return relocate(program, program.cam.lift(z))


@dataclass
class Region:
    """The width of the box [mm/deg^2]: the error of the forces foretold rules it."""

    first: float
    width: float = field(init=False)

    def __post_init__(self) -> None:
        self.width = self.first

    def refuses(self, error: float) -> bool:
        """Whether a cam whose forces were foretold with this error is too far; the box is narrower then."""
        if error <= BADLY or self.width <= NARROWEST * self.first:
            return False
        factor = float(np.clip(AIMED / error, NARROWING, BADLY))
        self.width = max(factor * self.width, NARROWEST * self.first)
        return True

    def follow(self, error: float) -> None:
        """The width for the next program, after a cam whose forces were foretold with this error."""
        factor = float(np.clip(AIMED / max(error, EXACT), 1 / CHANGE, CHANGE))
        self.width = float(np.clip(factor * self.width, NARROWEST * self.first, WIDEST * self.first))


def largest_acceleration(design: Design) -> float:
    """The largest acceleration of a design [mm/deg^2], or what is usual for its lift and duration."""
    return design.acceleration_max_mm_per_deg2 or USUAL_TIMES * design.max_lift_mm / design.duration_deg**2


def first_region(design: Design) -> Region:
    """The box to begin with."""
    return Region(FIRST * largest_acceleration(design) / USUAL_ACCELERATION)


def stepped(
    source: ExactRows,
    program: NoJumpProgram,
    z: np.ndarray,
    region: Region,
    margins: np.ndarray,
    of_speeds: Callable[[np.ndarray], float],
) -> NoJumpOptimum:
    """The cam of largest area in the box about that of z (m), narrowed until the rows foretell its forces.

    `of_speeds` makes one error of those at all speeds (s).
    """
    while True:
        program = program.within(Box(z, region.width))
        found = solve_priced(program, margins)
        error = float(of_speeds(source.errors_at(program, found.z)))
        if not region.refuses(error):
            region.follow(error)
            return found


def solve_priced(program: NoJumpProgram, margins: np.ndarray) -> NoJumpOptimum:
    """The cam of largest area with the margins (3, s) [N] or, where no cam keeps them, with all of them lower by what
    gains area for its price (elastic mode), since the cam that comes nearest to them may have hardly any area.

    Where they fall by more than RINGS, contacts ring with the impacts that close lash and seat, which no cam can help,
    and a force that is missing for part of a period hardly parts them: the rows then hold means over more and more
    angles, and those of the optimum's program do. Raises NoCamHoldsContact where the other limits alone let no cam
    through.
    """
    try:
        return program.solve(margins, explain=False)
    except Infeasible:
        elastic = program.elastic(margins)
    try:
        fall = SHORTFALL * float(elastic.solve().z[-1])
    except Infeasible:
        return program.solve(margins)  # which says why there is none
    if fall > RINGS * force_unit(program.train) and program.averaged < MOST_AVERAGED:
        return solve_priced(replace(program, averaged=max(1, 2 * program.averaged)), margins)
    return program.solve(margins - fall)
