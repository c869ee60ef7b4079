"""Rows of the path program from the smoothed motion with tied contacts, by the JAX Jacobian along it: of any law.

The Jacobian holds the start of the revolution's tangents: those that the last Jacobian had at its end are the seeds of
the next one, so that over the rounds of a search the slopes come to be those of the periodic motion.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.lift import Lift
from camopt.optimizer.program.force_rows import CLOSING, OPENING, PEAK, SEAT, SpeedRows
from camopt.optimizer.program.no_jump import NoJumpProgram
from camopt.optimizer.program.radii import near, with_radii
from camopt.optimizer.program.tangents import HELD_N
from camopt.optimizer.program.waves import with_switches
from camopt.scene.errors import NoCamFound
from camopt.scene.units import MM
from camopt.smooth.contact import Layer
from camopt.smooth.grid import equal_grid
from camopt.smooth.rest import rest_state
from camopt.smooth.tied import STEPS, WIDTH, TiedPaths, parts_of_steps, path_angles, tied_paths, tied_system

MOST_TURNS = 12
"""Revolutions that the tied motion may take to settle from where the one before ended."""
SETTLED = 2e-7
"""Change of the positions over a revolution [m] at which the motion counts as settled; the judge settles further."""
TAME_N, TAME_GAP = -250.0, 1e-4
"""Least force [N] and largest gap at the seat [m] of a tied motion that linear slopes describe."""
SHARES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0)
"""Shares of the start's coefficients that are tried in turn until the motion is tame; zero is the calmest cam."""
SEAT_SHARE = 0.6
"""Share of the limit on the bounce that the gap at the seat may have at a margin of zero."""
NEWTONS_PER_LIMIT = 60.0
"""Margin at the seat [N] that stands for the limit on the bounce."""
BOUNCE = 0.05 * MM
"""The limit that stands for one that the design leaves out [m]."""
SEAT_EVERY = 2
KEPT, TOLERATED = 0.003, 0.05
"""Errors of the forces foretold, as parts of the largest one: up to the first slopes are kept, as a step of a margin is
about as large, and up to the second a change is too small to judge them by."""
MOST_REPEATED, PERIODIC, GROWING = 4, 0.05, 0.5
"""How often the first slopes are taken again, the relative change of those at the end that is small enough, and the one
from which the motion at a speed counts as irregular: its start is held there when the next slopes are taken."""


class SmoothRows:
    """The rows of a program at its speeds, renewed about any cam of it."""

    name = "smooth"

    def __init__(self, program: NoJumpProgram):
        train, cam = program.train, program.cam
        self._tied = tied_system(train)
        grid = equal_grid(STEPS)
        pieces = [cam.basis(grid, order) for order in (0, 1)]
        self._basis = jnp.asarray(np.stack([matrix @ cam.Z for matrix, _ in pieces], axis=1))
        self._offset = jnp.asarray(np.stack([offset + matrix @ cam.x_p for matrix, offset in pieces], axis=1))
        self._speeds = jnp.asarray(program.speeds)
        self._parts = parts_of_steps(self._tied, float(program.speeds.min()))
        self._half = float(cam.breaks[-1])
        self._rest = jnp.repeat(rest_state(train)[:, :, None], len(self._speeds), axis=2)
        self._start, self._seeds, self._known, self._paths, self._missed = self._rest, None, None, None, np.inf
        self.jacobians = 0

    def first(self, program: NoJumpProgram, z: np.ndarray) -> tuple[NoJumpProgram, np.ndarray]:
        """The program about the largest share of z (m) whose motion is tame, and that share of z."""
        for share in SHARES:
            paths = self._settled(share * z, self._rest)
            if paths is not None and float(paths.force.min()) > TAME_N and float(paths.seat_gap[-1].max()) < TAME_GAP:
                break
        self._paths = paths
        program = self.about(program, share * z)
        return with_radii(with_switches(program, HELD_N), HELD_N), share * z

    def error_at(self, program: NoJumpProgram, z: np.ndarray) -> float:
        """The error of the forces that the rows foretold for the cam of z (m), as a part of their change."""
        self._paths = self._settled(z, self._start) or self._settled(z, self._rest)
        if self._paths is None or self._known is None:
            return np.inf
        before, slopes, at = self._known
        event = self._event(program)
        foretold = before.force[event] + slopes.force[event] @ jnp.asarray(z - at)
        size = _largest(before.force[event])
        missed, moved = (_largest(self._paths.force[event] - force) for force in (foretold, before.force[event]))
        self._missed = float((missed / size).max())
        return float(jnp.median(missed / (moved + TOLERATED * size)))

    def about(self, program: NoJumpProgram, z: np.ndarray) -> NoJumpProgram:
        """The program with its rows about the cam of z (m), where `error_at` was asked last; slopes that foretold its
        forces well are kept."""
        if self._paths is None:
            raise NoCamFound("the smoothed motion with tied contacts grows without bound at one of the speeds searched")
        slopes = self._known[1] if self._known and self._missed < KEPT else self._slopes(z)
        self._known = self._paths, slopes, z
        program = replace(program, blocks=self._blocks(program, z, self._paths, slopes))
        return (
            program if program.cam.about.near is None else replace(program, cam=near(program.cam, program.cam.lift(z)))
        )

    def _slopes(self, z: np.ndarray) -> TiedPaths:
        """The slopes by z (m); the first ones are taken again from their own end until they are periodic."""
        first = self._seeds is None
        seeds = jnp.zeros((*self._start.shape, len(z))) if self._seeds is None else self._seeds
        for _ in range(MOST_REPEATED if first else 1):
            slopes = _jacobian(
                self._tied, self._offset, self._basis, jnp.asarray(z), self._speeds, self._start, seeds, self._half,
                parts=self._parts,
            )  # fmt: skip
            change = _size(slopes.end - seeds) / _size(slopes.end)
            regular = (change < GROWING) | (_size(seeds) == 0.0)
            seeds, self.jacobians = jnp.where(regular[:, None], slopes.end, 0.0), self.jacobians + 1
            if float(jnp.median(change)) < PERIODIC:
                break
        self._seeds = seeds
        return slopes

    def _settled(self, z: np.ndarray, start: jax.Array) -> TiedPaths | None:
        """The settled motion's paths from `start` or, at speeds at which the valve is off its seat at the end, from
        rest, since an adjuster that pumped up would stay so. None where the motion is not finite."""
        samples, layer = self._offset + self._basis @ jnp.asarray(z), Layer(WIDTH)
        for _ in range(2):
            for _ in range(MOST_TURNS):
                paths = tied_paths(self._tied, samples, self._speeds, start, self._half, 1.0, layer, parts=self._parts)
                moved = float(jnp.abs(paths.end - start)[0].max())
                start = paths.end
                if not np.isfinite(moved) or moved < SETTLED:
                    break
            open_ends = paths.seat_gap[-1] > TAME_GAP
            if not np.isfinite(moved) or not bool(open_ends.any()):
                break
            start = jnp.where(open_ends, self._rest, start)
        if not np.isfinite(moved):
            return None
        self._start = start
        return paths

    def _blocks(self, program: NoJumpProgram, z: np.ndarray, values: TiedPaths, slopes: TiedPaths):
        design, train, theta = program.design, program.train, path_angles()
        force, gap = np.asarray(values.force), np.asarray(values.seat_gap)
        of_force, of_gap = np.asarray(slopes.force), np.asarray(slopes.seat_gap)
        inside = self._event(program)
        bounce = (design.bounce_max_mm or BOUNCE / MM) * MM
        to_newtons = NEWTONS_PER_LIMIT / bounce
        kind = np.where(theta[inside] < 0, OPENING, CLOSING)
        blocks = []
        for s, cam_speed in enumerate(program.speeds):
            seated = self._seated(program, z, gap[:, s])
            parts = []
            for c, element in enumerate(train.cam_side):
                rows = force[inside, c, s], of_force[inside, c, s]
                parts.append((*rows, kind, element, theta[inside]))
                if design.contact_force_max_N is not None:
                    parts.append((*rows, np.full(len(inside), PEAK), element, theta[inside]))
            room = (SEAT_SHARE * bounce - gap[seated, s]) * to_newtons
            seat = np.full(len(seated), SEAT)
            parts.append((room, -to_newtons * of_gap[seated, s], seat, train.seat, theta[seated]))
            value, matrix = (np.concatenate([part[i] for part in parts]) for i in (0, 1))
            element = np.concatenate([np.full(len(part[0]), part[3]) for part in parts])
            kinds, angle = (np.concatenate([part[i] for part in parts]) for i in (2, 4))
            angles = program.blocks[s].angles
            blocks.append(SpeedRows(train, float(cam_speed), angles, matrix, value - matrix @ z, kinds, element, angle))
        return tuple(blocks)

    def _event(self, program: NoJumpProgram) -> np.ndarray:
        """Indices of the angles at which the contacts between cam and valve are to push."""
        return np.flatnonzero(in_event(path_angles(), self._half, program.window.after_top))

    def _seated(self, program: NoJumpProgram, z: np.ndarray, gap: np.ndarray) -> np.ndarray:
        """Indices of the angles at which the valve is to be on its seat."""
        return np.flatnonzero(on_seat(program.cam.lift(z), program.train.lash, gap))[::SEAT_EVERY]


def in_event(theta: Any, half: Any, after_top: float) -> Any:
    """Whether the contacts between cam and valve are to push at `theta` (k) [rad], where half the duration is `half`
    [rad]; arrays of NumPy or JAX."""
    return (theta >= after_top - half) & (theta <= half - 1e-9)


def on_seat(lift: Lift, lash: float, gap: np.ndarray) -> np.ndarray:
    """Whether the valve is to be on its seat at the angles `path_angles()` (k), where its gap there is `gap` (k) [m]:
    from the earlier one of its touch and the nominal closing to the next opening foot."""
    theta = path_angles()
    below = (theta > 0) & (lift(theta) <= lash)
    touches = (theta > theta[np.argmax(gap)]) & (gap <= 0.0)
    begin = min(theta[np.argmax(below)], theta[np.argmax(touches)] if touches.any() else np.pi)
    return (theta >= begin) | (theta <= lift.opening_foot)


def _largest(force: jax.Array) -> jax.Array:
    """The largest absolute value of forces (k, c, b) [N] at each speed (b)."""
    return jnp.abs(force).max(axis=(0, 1))


def _size(slopes: jax.Array) -> jax.Array:
    """Euclidean norm of the positions' slopes (2, n + r, b, m) at each speed (b)."""
    return jnp.sqrt(jnp.sum(slopes[0] ** 2, axis=(0, 2)))


@partial(jax.jit, static_argnames="parts")
def _jacobian(tied, offset, basis, z, speeds, start, seeds, half, *, parts: int) -> TiedPaths:
    """The slopes of one revolution's paths by z (m), the last axis, with the start's slopes `seeds`."""

    def paths(z, start):
        return tied_paths(tied, offset + basis @ z, speeds, start, half, 1.0, Layer(WIDTH), parts=parts)

    def along(direction, seed):
        return jax.jvp(paths, (z, start), (direction, seed))[1]

    return jax.vmap(along, in_axes=(0, -1), out_axes=-1)(jnp.eye(len(z)), seeds)
