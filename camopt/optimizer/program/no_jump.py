"""The linear program of largest area with contacts that stay closed at every speed, under the model of `periodic`.

The contact forces are affine in the cam's free coefficients. The rows keep them above a margin: in the contacts between
cam and valve while the valve is lifted, and in the seat while it is seated. A negative margin permits some tension in
the linear model, for which the real contact separates a little.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from camopt.cam.families.free import FreeCam
from camopt.cam.families.shape_rows import Limits
from camopt.cam.lift import Lift
from camopt.highs import Infeasible
from camopt.optimizer.program.force_rows import PEAK, SEAT, Box, SpeedRows, averaged, speed_rows
from camopt.optimizer.program.kinematic import (
    SHORT_OF_FORCE,
    TYPICAL_FORCE,
    area_ratio_row,
    first_working,
    peak_angle,
    solve_over_peak_angles,
    spline_rows,
    with_lift_reached,
)
from camopt.optimizer.program.linear_program import ElasticProgram, Optimum, Rows, least_relaxation
from camopt.optimizer.program.periodic import SAMPLE, sample_cam
from camopt.optimizer.program.phases import HELD_N, Angles, force_unit, static_angles
from camopt.scene.design import Design
from camopt.scene.errors import NoCamFound
from camopt.scene.train import Train

SHORTFALL = 1.01
"""Factor on a shortfall, so that the program is feasible in spite of rounding when the margins are reduced by it."""
BESIDE = 0.2
"""Largest difference of angle, as a fraction of the step between rows, at which rows of two similar programs match."""


class NoCamHoldsContact(NoCamFound):
    """No free cam keeps the margins; all of them would have to be reduced by `shortfall_N`."""

    def __init__(self, sentence: str, shortfall_N: float):
        super().__init__(sentence)
        self.shortfall_N = shortfall_N


@dataclass(frozen=True)
class NoJumpOptimum:
    """A cam of largest area under margins: free coefficients z (m), area ratio, the program's solution."""

    program: "NoJumpProgram"
    margins: np.ndarray  # (3, speeds) N
    z: np.ndarray
    area_ratio: float
    optimum: Optimum

    @property
    def lift(self) -> Lift:
        """The cam's lift law."""
        return self.program.cam.lift(self.z)

    @property
    def margin_prices(self) -> np.ndarray:
        """d area ratio / d margin [1/N] by kind and speed, shape (3, speeds): zero or negative."""
        program, first = self.program, len(self.program.limits.bound)
        prices = np.zeros(self.margins.shape)
        rows = np.flatnonzero(program.kind != PEAK)
        np.add.at(prices, (program.kind[rows], program.speed[rows]), -self.optimum.duals[first + rows])
        return prices

    def value_in(self, similar: "NoJumpProgram") -> float | None:
        """The largest area ratio of a similar program, with another train or other ramps, to first order: from this cam
        and its duals (the envelope theorem; Gal 1995, Postoptimal Analyses). None if an active row has no match there.
        """
        duals, first = self.optimum.duals, len(self.program.limits.bound)
        if len(similar.limits.bound) != first:
            return None
        row, constant = area_ratio_row(similar.design, similar.cam)
        value = row @ self.z + constant + duals[:first] @ (similar.limits.bound - similar.limits.matrix @ self.z)
        count = len(self.program.kind)
        for r in np.flatnonzero(duals[first:][:count] > 0):
            slack = self._slack_in(similar, int(r))
            if slack is None:
                return None
            value += duals[first + r] * slack
        for dual in duals[first + count :]:  # of the row that requires the maximum lift to be reached
            value += dual * (similar.cam.lift(self.z).max_lift - self.lift.max_lift)
        return float(value)

    def _slack_in(self, similar: "NoJumpProgram", r: int) -> float | None:
        """Slack [N] of this cam's force of row r in the other program, at the row that matches it; None without one."""
        program, speed = self.program, self.program.speed[r]
        block, matching = program.constrained[speed], similar.constrained[speed]
        at = r - int(np.searchsorted(program.speed, speed))
        candidates = np.flatnonzero((matching.kind == block.kind[at]) & (matching.element == block.element[at]))
        distance = np.abs(matching.angle[candidates] - block.angle[at])
        if not len(candidates) or distance.min() > BESIDE * program.step:
            return None
        nearest = candidates[np.argmin(distance)]
        force = float(matching.offset[nearest] + matching.matrix[nearest] @ self.z)
        if block.kind[at] == PEAK:
            return (similar.design.contact_force_max_N or np.inf) - force
        return force - float(self.margins[block.kind[at], speed])


@dataclass(frozen=True)
class NoJumpProgram:
    """The no-jump linear program of a train, a design and a free cam, at the speeds of `blocks`.

    Its rows constrain the mean of each force with `averaged` forces on either side. Margins are least contact forces
    [N] on the opening flank, on the closing flank and at the seat: one number, one per kind (3), or one per kind and
    speed (3, s).
    """

    train: Train
    design: Design
    cam: FreeCam
    blocks: tuple[SpeedRows, ...]
    box: Box | None = None
    averaged: int = 0
    step: float = SAMPLE  # longest step between two rows [rad]

    @property
    def speeds(self) -> np.ndarray:
        """Cam speeds [rad/s]."""
        return np.array([b.cam_speed for b in self.blocks])

    @cached_property
    def limits(self) -> Limits:
        """The kinematic rows, which come first in the program."""
        return self.cam.limits(self.design)

    @cached_property
    def constrained(self) -> tuple[SpeedRows, ...]:
        """The blocks with the averaged forces, which the rows constrain."""
        return tuple(averaged(b, self.averaged) for b in self.blocks) if self.averaged else self.blocks

    @cached_property
    def kind(self) -> np.ndarray:
        """Kind of every force row (r)."""
        return np.concatenate([b.kind for b in self.blocks])

    @cached_property
    def speed(self) -> np.ndarray:
        """Index of the speed of every force row (r)."""
        return np.repeat(np.arange(len(self.blocks)), [len(b.kind) for b in self.blocks])

    @cached_property
    def rows(self) -> Rows:
        """Kinematic rows, then force rows, then those of the box: matrix @ z <= bound."""
        force = np.concatenate([b.matrix for b in self.constrained])
        force *= np.where(self.kind == PEAK, 1.0, -1.0)[:, None]
        sides = [] if self.box is None else [np.eye(force.shape[1]), -np.eye(force.shape[1])]
        return spline_rows(np.concatenate([self.limits.matrix, force, *sides]))

    def margin_table(self, margins: ArrayLike) -> np.ndarray:
        """Margins by kind and speed (3, s) [N]."""
        rows = np.asarray(margins, dtype=float)
        return np.broadcast_to(rows[:, None] if rows.ndim == 1 else rows, (3, len(self.blocks)))

    def bound(self, margins: ArrayLike) -> np.ndarray:
        """Right-hand sides (r) of the program for margins."""
        offset = np.concatenate([b.offset for b in self.constrained])
        least = self.margin_table(margins)[np.minimum(self.kind, SEAT), self.speed]
        peak = self.design.contact_force_max_N or np.inf
        force = np.where(self.kind == PEAK, peak - offset, offset - least)
        box = self.box
        sides = [] if box is None else [box.width + box.centre, box.width - box.centre]
        return np.concatenate([self.limits.bound, force, *sides])

    def with_rows(self, blocks: tuple[SpeedRows, ...], box: Box | None) -> "NoJumpProgram":
        """This program with other force rows and another box."""
        program = replace(self, blocks=blocks, box=box)
        vars(program)["limits"] = self.limits  # these depend on neither
        return program

    def within(self, box: Box) -> "NoJumpProgram":
        """This program with another box; the solver keeps its basis if this program has a box too."""
        program = self.with_rows(self.blocks, box)
        if self.box is not None:
            vars(program)["rows"] = self.rows
        return program

    def forces(self, z: np.ndarray) -> np.ndarray:
        """Contact force of every force row [N] under the linear model, shape (r)."""
        return np.concatenate([b.offset + b.matrix @ z for b in self.blocks])

    def solve(
        self, margins: ArrayLike = HELD_N, explain: bool = True, working: np.ndarray | None = None
    ) -> NoJumpOptimum:
        """The cam of largest area with these margins; `working` are the row indices of the first working set. Raises
        NoCamHoldsContact where no cam keeps the margins, or Infeasible without `explain`."""
        table = self.margin_table(margins)
        row, constant = area_ratio_row(self.design, self.cam)
        working = self.first_working() if working is None else working
        try:
            optimum = solve_over_peak_angles(self.cam, self.design, row, self.rows, self.bound(table), working)
        except Infeasible:
            if not explain:
                raise
            raise self._shortfall(table) from None
        return NoJumpOptimum(self, table, optimum.z, optimum.value + constant, optimum)

    def solve_below(self, margins: ArrayLike, working: np.ndarray | None = None) -> NoJumpOptimum:
        """Like `solve`, but where no cam keeps the margins, all of them are reduced by the least common amount that is
        needed. Raises NoCamHoldsContact where the other limits alone are infeasible."""
        try:
            return self.solve(margins, working=working)
        except NoCamHoldsContact as short:
            if np.isinf(short.shortfall_N):
                raise
            return self.solve(np.subtract(margins, SHORTFALL * short.shortfall_N))

    def first_working(self) -> np.ndarray:
        """Row indices of the default first working set: rows of the limits and every fortieth force row."""
        first = len(self.limits.bound)
        return np.union1d(first_working(self.limits), np.arange(first, first + len(self.kind), 40))

    def relaxable(self, margins: ArrayLike) -> tuple[Rows, np.ndarray, np.ndarray, np.ndarray]:
        """The rows and right-hand sides (r) for margins, the change of each right-hand side per newton of reduction of
        all margins (r), and the first working set. A maximum lift that must be reached is reached in the middle, or
        where the box's central cam is highest."""
        top = peak_angle(self.cam.lift(self.box.centre)) if self.box else 0.0
        matrix, bound = with_lift_reached(self.cam, self.design, self.rows.matrix, self.bound(margins), top)
        give = np.zeros(len(bound))
        give[len(self.limits.bound) :][: len(self.kind)] = self.kind != PEAK
        working = np.union1d(self.first_working(), np.arange(len(self.rows.norm), len(bound)))
        return spline_rows(matrix), bound, give, working

    def elastic(self, margins: ArrayLike) -> ElasticProgram:
        """The elastic program, which may miss the margins at the cost SHORT_OF_FORCE."""
        rows, bound, give, working = self.relaxable(margins)
        row, _ = area_ratio_row(self.design, self.cam)
        unit = force_unit(self.train)
        return ElasticProgram(rows, bound, give, row, SHORT_OF_FORCE / unit, TYPICAL_FORCE * unit, working)

    def _shortfall(self, margins: np.ndarray) -> NoCamHoldsContact:
        """The error that explains why no cam keeps the margins (3, s) [N]."""
        rows, bound, give, working = self.relaxable(margins)
        needed = least_relaxation(rows, bound, give, TYPICAL_FORCE * force_unit(self.train), working)
        if needed is None:
            return NoCamHoldsContact(
                "no free cam keeps the limits of the design and its largest contact force, whatever the margins: raise "
                "contact_force_max_N, or loosen the limits on the shape",
                np.inf,
            )
        least, largest = float(margins.min()), float(margins.max())
        margin, most = f"{least:g} N", f"even the best cam needs contacts that pull with {needed - least:.3g} N"
        if least < largest:
            margin, most = f"{least:g} to {largest:g} N", f"lower by {needed:.3g} N each is the most"
        elif needed < least:
            most = f"{least - needed:.4g} N is the most"
        reaching = " with max_lift_mm reached in the middle" if self.design.reach_max_lift else ""
        where = f"in the contacts at all of the {len(self.blocks)} speeds{reaching}"
        return NoCamHoldsContact(f"keeping {margin} {where} is impossible: {most}", needed)

    def under(self, design: Design) -> "NoJumpProgram":
        """This program with other values of the limits, but the same duration, ramps and kinds of limits. If no row's
        left-hand side changes, the solver keeps its basis."""
        program = replace(self, design=design)
        if np.array_equal(program.limits.matrix, self.limits.matrix):
            vars(program)["rows"] = self.rows
        return program

    def relocated(self, angles: Sequence[Angles]) -> "NoJumpProgram":
        """The same program at other switching angles, one per block."""
        return replace(self, blocks=_blocks(self.train, self.design, self.cam, self.speeds, angles, self.step))


def no_jump_program(
    train: Train,
    design: Design,
    cam: FreeCam,
    speeds: Sequence[float] | np.ndarray,
    step: float = SAMPLE,
) -> NoJumpProgram:
    """The program at cam speeds [rad/s], at the switching angles of static load transfer."""
    angles = [static_angles(train, cam)] * len(speeds)
    return NoJumpProgram(train, design, cam, _blocks(train, design, cam, speeds, angles, step), step=step)


def _blocks(train, design, cam, speeds, angles, step) -> tuple[SpeedRows, ...]:
    sampled = {a: sample_cam(cam, a, step) for a in set(angles)}
    pairs = zip(speeds, angles, strict=True)
    return tuple(speed_rows(train, design, sampled[a], float(w), a) for w, a in pairs)
