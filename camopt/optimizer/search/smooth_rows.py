"""Rows of the path program for any law, from the Jacobian by JAX of the smoothed motion with tied contacts.

The derivatives are those of the periodic motion. They also predict the initial state of the periodic motion of another
cam, from which that motion settles in a few revolutions.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.cam.lift import Lift
from camopt.optimizer.program.force_rows import AFTER_TOP, BEFORE_SEAT, SpeedRows, joined_rows
from camopt.optimizer.program.no_jump import NoJumpProgram
from camopt.optimizer.program.phases import force_unit, static_angles, usual_margin
from camopt.optimizer.program.program_cam import with_radii, with_radii_near, with_switches
from camopt.optimizer.search.region import ExactRows
from camopt.scene.errors import NoCamFound
from camopt.scene.smoothing import Smoothing
from camopt.scene.train import Train
from camopt.scene.units import MM
from camopt.smooth.grid import equal_grid
from camopt.smooth.periodic_slopes import Directions, PeriodicSlopes, TiedMotions
from camopt.smooth.tied import TiedPaths, path_angles

MOST_TURNS = 12
"""Largest number of revolutions in which the tied motion may settle from the predicted state."""
SETTLED = 2e-7
"""Change of the positions over a revolution [m] below which the motion counts as settled; the judge uses less."""
TAME_N, TAME_GAP = -250.0, 1e-4
"""Least contact force [N] and largest gap at the seat [m] of a tied motion that a linearisation describes well."""
REPEATS = 2e-6
"""Change of a position over a revolution [m] up to which the motion of a train with memory counts as periodic; without
periodicity the computed derivatives are not those of any motion."""
SMALL_N = 1e-3
"""Force [N] that counts as zero."""
SHARES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0)
"""Factors on the start's coefficients, tried until a linearisation describes the motion; zero is the calmest cam."""
SEAT_SHARE = 0.6
"""Gap at the seat that a margin of zero permits, as a share of the limit on the bounce."""
NEWTONS_PER_LIMIT = 60.0
"""Margin at the seat [N] that is equivalent to a gap as large as the limit on the bounce."""
BOUNCE = 0.05 * MM
"""Limit on the bounce [m] that is used where the design sets none."""
SEAT_EVERY = 2
"""The seat has a row at one in this number of angles."""
KEPT, TOLERATED = 0.003, 0.05
"""KEPT is the largest error of the predicted forces, relative to the largest force, with which the derivatives are
kept; a step of a margin is about as large. TOLERATED is the share of the largest force that is added to the change of
the forces before an error is divided by it, since small changes do not test the derivatives."""


class SmoothRows(ExactRows):
    """Source of the rows of a program, linearised about any of its cams."""

    name = "smooth"

    def __init__(self, program: NoJumpProgram, smoothing: Smoothing = Smoothing()):  # noqa: B008  it cannot change
        train, cam = program.train, program.cam
        self._theta = path_angles(smoothing.steps)
        self._basis, self._offset = cam.samples(equal_grid(smoothing.steps))
        self._unit = force_unit(train)
        event = -float(cam.breaks[-1]), end_of_contact(train, cam)
        self._event = np.flatnonzero(in_event(self._theta, event))  # of the angles at which these contacts must push
        self._motions = TiedMotions(train, program.speeds, event, smoothing)
        self._model: _LinearModel | None = None  # the linearisation of the rows
        self._paths: TiedPaths | None = None  # those of the cam that `errors_at` evaluated last
        self._missed = np.inf
        super().__init__()

    def first(self, program: NoJumpProgram, z: np.ndarray) -> tuple[NoJumpProgram, np.ndarray]:
        """The program about the largest multiple in SHARES of z (m) whose motion is nearly linear, and that z."""
        for share in SHARES:
            settled = self._settled(share * z, self._motions.rest)
            if settled is not None and self._tame(*settled):
                break
        self._paths = settled and settled[1]
        program = self.about(program, share * z)
        held = usual_margin(program.train)
        return with_radii(with_switches(program, held), held), share * z

    def errors_at(self, program: NoJumpProgram, z: np.ndarray) -> np.ndarray:
        """Errors (s) of the forces that the rows predict for the cam of z (m), relative to their change.

        They are infinite if the motion is not finite, or if at some speed the valve is off its seat at the end of the
        revolution, held up by a pumped-up adjuster, and was not with the cam of the linearisation.
        """
        model = self._model
        rest = self._motions.rest
        settled = self._settled(z, model.start(z) if model else rest) or self._settled(z, rest)
        self._paths = settled and settled[1]
        if self._paths is None or model is None or bool((_open_ends(self._paths) & ~_open_ends(model.paths)).any()):
            return np.full(len(program.speeds), np.inf)
        before = model.paths.force[self._event]
        predicted = before + jnp.asarray(model.slopes.force @ (z - model.at))
        size = _largest(before)
        missed, moved = (_largest(self._paths.force[self._event] - force) for force in (predicted, before))
        self._missed = float((missed / size).max())
        return np.asarray(missed / (moved + TOLERATED * size))

    def about(self, program: NoJumpProgram, z: np.ndarray) -> NoJumpProgram:
        """The program with rows about the cam of z (m), the last one of `errors_at`; accurate derivatives are kept."""
        if self._paths is None:
            raise NoCamFound("the smoothed motion with tied contacts grows without bound at one of the speeds searched")
        model = self._model
        slopes = model.slopes if model and self._missed < KEPT else self._slopes(z, self._paths)
        self._model = _LinearModel(self._paths, slopes, z)
        program = replace(program, blocks=self._blocks(program, self._model))
        return with_radii_near(program, program.cam.lift(z))

    def _samples(self, z: np.ndarray) -> jax.Array:
        """Lift and slope of the cam of z (m) at the ends of the steps (k + 1, 2)."""
        return jnp.asarray(self._offset + self._basis @ z)

    def _slopes(self, z: np.ndarray, paths: TiedPaths) -> PeriodicSlopes:
        """The derivatives by z (m) of the motion with these paths; those of the forces are restricted to the event."""
        self._model = None  # two Jacobians at once would take most of the memory of a search
        self.jacobians += 1
        slopes = self._motions.slopes(self._samples(z), paths, Directions(self._basis), gaps=False)
        force, seat_gap = slopes.force[self._event], slopes.seat_gap.copy()  # copies release the large array
        return slopes._replace(force=force, gap=slopes.gap.copy(), seat_gap=seat_gap)

    def _settled(self, z: np.ndarray, start: jax.Array) -> tuple[jax.Array, TiedPaths] | None:
        """The initial state of the settled motion's last revolution, and its paths; None if the motion is not finite.

        The motion starts from `start`. It starts again from rest where the valve ends off its seat, since a pumped-up
        adjuster stays so.
        """
        for _ in range(2):
            begin, paths = self._motions.settled(self._samples(z), start, MOST_TURNS, SETTLED)
            if not bool(jnp.all(jnp.isfinite(paths.end))):
                return None
            if not bool(_open_ends(paths).any()):
                break
            start = jnp.where(_open_ends(paths), self._motions.rest, paths.end)
        return begin, paths

    def _tame(self, start: jax.Array, paths: TiedPaths) -> bool:
        """Whether a linearisation describes the motion whose last revolution has these paths and starts in `start`.

        In a train with memory the derivatives are misleading where contacts do not push, since an adjuster fills with
        oil there, and where the motion is not periodic.
        """
        memory = self._motions.tied.system.topology.memory
        if bool(_open_ends(paths).any()) or float(paths.force.min()) <= self._unit * (-SMALL_N if memory else TAME_N):
            return False
        return not memory or float(jnp.abs(paths.end - start)[0].max()) < REPEATS

    def _blocks(self, program: NoJumpProgram, model: "_LinearModel") -> tuple[SpeedRows, ...]:
        design, train, theta, z = program.design, program.train, self._theta, model.at
        force, gap = np.asarray(model.paths.force), np.asarray(model.paths.seat_gap)
        of_force, of_gap = model.slopes.force, model.slopes.seat_gap
        bounce = (design.bounce_max_mm or BOUNCE / MM) * MM
        to_newtons = NEWTONS_PER_LIMIT * self._unit / bounce
        lift, blocks = program.cam.lift(z), []
        for s, block in enumerate(program.blocks):
            cam_side = {
                e: np.column_stack([force[self._event, c, s], of_force[:, c, s]]) for c, e in enumerate(train.cam_side)
            }
            seated = np.flatnonzero(on_seat(lift, train.lash, gap[:, s]))[::SEAT_EVERY]
            room = (SEAT_SHARE * bounce - gap[seated, s]) * to_newtons
            seat = np.column_stack([room, -to_newtons * of_gap[seated, s]])
            speed = block.cam_speed, block.angles
            rows = joined_rows(train, design, speed, theta[self._event], cam_side, theta[seated], seat)
            blocks.append(replace(rows, offset=rows.offset - rows.matrix @ z))  # the values are those at z
        return tuple(blocks)


def in_event(theta: Any, event: Any) -> Any:
    """Whether the contacts between cam and valve must push at `theta` (k) [rad], if they are tied over the `event`, a
    pair of angles [rad]; for arrays of NumPy or JAX."""
    return (theta >= event[0] + AFTER_TOP) & (theta <= event[1] - 1e-9)


def on_seat(lift: Lift, lash: float, gap: np.ndarray) -> np.ndarray:
    """Whether the valve must be on its seat at the angles `path_angles()` (k): from the earlier of the touch and the
    nominal closing to the next opening foot. `gap` (k) [m] is the gap at the seat."""
    theta = path_angles(len(gap))
    below = (theta > 0) & (lift(theta) <= lash)
    touches = (theta > theta[np.argmax(gap)]) & (gap <= 0.0)
    begin = min(theta[np.argmax(below)], theta[np.argmax(touches)] if touches.any() else np.pi)
    return (theta >= begin) | (theta <= lift.opening_foot)


def end_of_contact(train: Train, cam: FreeCam) -> float:
    """Angle [rad] up to which the contacts between cam and valve must push: a little before the load moves to the seat,
    or the ramp top if the ramp is too low for that load transfer."""
    top = float(cam.breaks[-1])
    try:
        return max(top, static_angles(train, cam).seat_closes - BEFORE_SEAT)
    except NoCamFound:
        return top


def _open_ends(paths: TiedPaths) -> jax.Array:
    """Whether the valve is off its seat at the end of the revolution, by speed (b)."""
    return paths.seat_gap[-1] > TAME_GAP


def _largest(force: jax.Array) -> jax.Array:
    """Largest absolute value of forces (k, c, b) [N], by speed (b)."""
    return jnp.abs(force).max(axis=(0, 1))


class _LinearModel(NamedTuple):
    """A linearisation: the settled paths of the cam `at` z (m), and their derivatives."""

    paths: TiedPaths
    slopes: PeriodicSlopes
    at: np.ndarray

    def start(self, z: np.ndarray) -> jax.Array:
        """The predicted initial state of the settled revolution of another cam."""
        return self.paths.end + jnp.asarray(self.slopes.start @ (z - self.at))
