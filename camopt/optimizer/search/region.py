"""The trust region of a search, a box about a cam (Conn, Gould and Toint 2000), and the solution of one step in it."""

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
"""First width of the box [mm/deg^2] for a cam with the largest acceleration USUAL_ACCELERATION [mm/deg^2]; the width is
proportional to the largest acceleration of the scene."""
USUAL_TIMES = 33.0
"""Largest acceleration that is assumed where the design sets none, relative to lift over duration squared."""
NARROWEST, WIDEST = 1 / 256, 4.0
"""Limits of the width, relative to the first width."""
AIMED, BADLY = 0.25, 0.5
"""Target of the predicted forces' error, relative to their change, and largest error with which a cam is accepted."""
NARROWING, CHANGE = 0.1, 4.0
"""Smallest factor on the width after a rejected cam, and largest change of the width after an accepted one."""
RINGS = 200.0
"""Common reduction of all margins, in units of `force_unit` newtons, above which the rows constrain mean forces. It is
more than twice the tension that a margin may permit, and no motion that keeps the limits has it at all angles."""
MOST_AVERAGED = 64
"""Largest number of rows on either side over which forces are averaged."""
EXACT = 1e-9
"""Error of the predicted forces below which it is treated as this value."""


class ExactRows:
    """Source of the rows of a program: the periodic response in closed form, with contacts that switch at the angles of
    the event-exact motion of a cam. `SmoothRows` has the same methods."""

    name = "exact"

    def __init__(self) -> None:
        self.jacobians = 0

    def first(self, program: NoJumpProgram, z: np.ndarray) -> tuple[NoJumpProgram, np.ndarray]:
        """The program with its rows about a cam near z (m), and that cam. Here the contacts switch at the angles of
        static load transfer, which do not depend on the cam."""
        self.jacobians += 1
        return converge_tangents(no_jump_program(program.train, program.design, program.cam, program.speeds)), z

    def errors_at(self, program: NoJumpProgram, z: np.ndarray) -> np.ndarray:
        """Errors (s) of the forces that the rows predict for the cam of z (m), relative to their change. They are zero
        here, since the forces are affine in z as long as contacts switch at the same angles."""
        return np.zeros(len(program.blocks))

    def about(self, program: NoJumpProgram, z: np.ndarray) -> NoJumpProgram:
        """The program with its rows about the cam of z (m), for which `errors_at` was called last. Here the contacts
        switch at the angles of the cam's settled motion."""
        self.jacobians += 1
        return relocate(program, program.cam.lift(z))


@dataclass
class Region:
    """The width of the box [mm/deg^2], which is controlled by the error of the predicted forces."""

    first: float
    width: float = field(init=False)

    def __post_init__(self) -> None:
        self.width = self.first

    def rejects(self, error: float) -> bool:
        """Whether a cam is rejected because its forces were predicted with this error; the box is narrowed then."""
        if error <= BADLY or self.width <= NARROWEST * self.first:
            return False
        factor = float(np.clip(AIMED / error, NARROWING, BADLY))
        self.width = max(factor * self.width, NARROWEST * self.first)
        return True

    def update(self, error: float) -> None:
        """Sets the width for the next program after an accepted cam whose forces were predicted with this error."""
        factor = float(np.clip(AIMED / max(error, EXACT), 1 / CHANGE, CHANGE))
        self.width = float(np.clip(factor * self.width, NARROWEST * self.first, WIDEST * self.first))


def largest_acceleration(design: Design) -> float:
    """The largest acceleration of a design [mm/deg^2], or the usual one for its lift and duration."""
    return design.acceleration_max_mm_per_deg2 or USUAL_TIMES * design.max_lift_mm / design.duration_deg**2


def first_region(design: Design) -> Region:
    """The first box of a search."""
    return Region(FIRST * largest_acceleration(design) / USUAL_ACCELERATION)


def solve_step(
    source: ExactRows,
    program: NoJumpProgram,
    z: np.ndarray,
    region: Region,
    margins: np.ndarray,
    of_speeds: Callable[[np.ndarray], float],
) -> NoJumpOptimum:
    """The cam of largest area in the box about the cam of z (m), which is narrowed until the rows predict its forces.

    `of_speeds` reduces the errors at all speeds (s) to one.
    """
    while True:
        program = program.within(Box(z, region.width))
        optimum = solve_elastic(program, margins)
        error = float(of_speeds(source.errors_at(program, optimum.z)))
        if not region.rejects(error):
            region.update(error)
            return optimum


def solve_elastic(program: NoJumpProgram, margins: np.ndarray) -> NoJumpOptimum:
    """The cam of largest area with the margins (3, s) [N]. Where no cam keeps these, all of them are reduced by one
    amount, whose penalty is weighed against the area (elastic mode), since the least reduction may leave hardly any.

    If the reduction exceeds RINGS, the contacts ring with the impacts that close lash and seat. No cam avoids these,
    and a force that is missing for part of a period hardly separates a contact. The rows then constrain means over more
    and more angles, also in the program of the returned optimum. Raises NoCamHoldsContact where the other limits alone
    are infeasible.
    """
    try:
        return program.solve(margins, explain=False)
    except Infeasible:
        elastic = program.elastic(margins)
    try:
        fall = SHORTFALL * float(elastic.solve().z[-1])
    except Infeasible:
        return program.solve(margins)  # raises the error that explains why
    if fall > RINGS * force_unit(program.train) and program.averaged < MOST_AVERAGED:
        return solve_elastic(replace(program, averaged=max(1, 2 * program.averaged)), margins)
    return program.solve(margins - fall)
