"""Periodic motions with tied contacts, and their derivatives, step by step.

The end of a step depends on its beginning, on lift and slope at its two ends, and on the numbers of the train. JAX
differentiates every step by these few numbers alone, and a recurrence of small matrices carries any number of
directions through the revolution: the condensing of multiple shooting (Bock and Plitt 1984). Its cost hardly grows with
the number of coefficients, and one compiled program serves cams with any number of them.
"""

from functools import partial
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from camopt.scene.smoothing import Smoothing
from camopt.scene.train import Train
from camopt.smooth.grid import equal_grid
from camopt.smooth.laws import Layer
from camopt.smooth.rest import rest_state
from camopt.smooth.tied import DrivenTies, LowStorage, TiedPaths, TiedSystem, parts_of_steps, tied_paths, tied_system

GROWS = 1.0 + 1e-6
"""Factor of a disturbance over a revolution above which it grows: for a memory at rest it is one but for rounding."""
AT_ONCE = 16
"""Number of steps that are differentiated side by side."""
MOST_TURNS, SETTLED = 40, 1e-10
"""Permitted number of revolutions until a motion has settled, and the change of its positions over one [m] below which
it has: the stiffest contacts then change their forces by some hundredths of a newton."""


class Directions(NamedTuple):
    """Directions (d) in which the cam varies and, in the last of them, as many as `numbers` has, the train as well."""

    samples: np.ndarray  # (k + 1, 2, d), of lift and slope
    numbers: TiedSystem | None = None  # every number with a first axis


class PeriodicSlopes(NamedTuple):
    """Derivatives of a periodic revolution along directions (d)."""

    force: np.ndarray  # (k, c, b, d)
    gap: np.ndarray  # (k, c, b, d), with c = 0 where they are left out
    seat_gap: np.ndarray  # (k, b, d)
    start: np.ndarray  # (2, n + r, b, d)


@partial(jax.jit, static_argnames=("parts", "gaps"))
def step_slopes(
    tied, samples, cam_speed, states, event, tie, layer: Layer, numbers, steps, *, parts: int, gaps: bool
) -> jax.Array:
    """Matrices (k, b, q + c + 1 + c, q + 4 + p) of the slopes of `steps` (k) that begin in `states` (k, 2, n + r, b).

    Rows: the state at the step's end (q), force (c), the gap at the seat and, with `gaps`, those of the contacts (c).
    Columns: the state at its beginning, lift and slope at its two ends, and the `numbers` (p) of the train that vary,
    if any. Velocities are divided by the largest frequency of a mass. The other arguments are those of `tied_paths`.
    """
    (_, width, cases), masses = states.shape[1:], tied.system.mass.shape[0]
    size = width + masses  # of a state, whose memories have no velocities
    p = 0 if numbers is None else len(numbers.at_rest)
    count, grid, solver = samples.shape[0] - 1, jnp.asarray(equal_grid(samples.shape[0] - 1)), LowStorage(parts)
    unit = jnp.where(jnp.arange(size) < width, 1.0, tied.system.stiffest())
    units = jnp.pad(jnp.diag(unit), ((0, 0), (0, width - masses))).reshape(size, 2, width, 1)

    def placed(rows, before):
        return jnp.pad(rows, ((before, size + 4 + p - before - len(rows)), *((0, 0),) * (rows.ndim - 1)))

    directions = placed(jnp.repeat(units, cases, axis=3), 0), placed(jnp.eye(4).reshape(4, 2, 2), size)
    if numbers is not None:
        directions = *directions, jax.tree.map(lambda rows: placed(rows, size + 4), numbers)

    def of_step(k, begin):
        def end(y, edges, tied=tied):
            driven = DrivenTies(tied, edges, cam_speed, event, tie, layer, grid[k], 2 * np.pi / count)
            term = diffrax.ODETerm(lambda theta, y, _: driven.rate(theta, y))
            return driven.reading(grid[k + 1], solver.step(term, grid[k], grid[k + 1], y, None, None, False)[0])

        inputs = (begin, jnp.stack([samples[k], samples[k + 1]]), tied)[: len(directions)]
        moved = jax.vmap(lambda *along: jax.jvp(end, inputs, along)[1])(*directions)
        state = moved.states.reshape(-1, 2 * width, cases)[:, :size] / unit[None, :, None]
        rows = state, moved.force, moved.seat_gap[:, None], *((moved.gap,) if gaps else ())
        return jnp.concatenate(rows, axis=1).T

    return jax.vmap(of_step)(steps, states)


class TiedMotions:
    """Motions with tied contacts of one train at the cam speeds (b) [rad/s], under a smoothing.

    The contacts are tied over the `event`, from one angle to another [rad], and each step is divided into `parts`, by
    default as many as the lowest speed requires. `samples` (k + 1, 2) of a cam are lift and slope at the ends of the
    revolution's k equal steps.
    """

    def __init__(
        self, train: Train, cam_speeds: np.ndarray, event: Any, smoothing: Smoothing, parts: int | None = None
    ):
        width, tie, steps = smoothing
        self.tied, self.speeds = tied_system(train), jnp.asarray(cam_speeds)
        self._rule = event, tie, Layer(width)
        self.parts = parts or parts_of_steps(self.tied, float(np.min(cam_speeds)), steps)
        self.rest = jnp.repeat(rest_state(train)[:, :, None], len(self.speeds), axis=2)

    def revolution(self, samples: Any, start: Any, adjoint: str = "forward") -> TiedPaths:
        """The paths of the revolution from a state `start` (2, n + r, b); `adjoint` as in `tied_paths`."""
        return tied_paths(self.tied, samples, self.speeds, start, *self._rule, parts=self.parts, adjoint=adjoint)

    def driven(self, samples: Any) -> DrivenTies:
        """The train driven by a cam, for the forces of all its elements."""
        return DrivenTies(self.tied, samples, self.speeds, *self._rule)

    def settled(
        self, samples: Any, start: jax.Array | None = None, most: int = MOST_TURNS, within: float = SETTLED
    ) -> tuple[jax.Array, TiedPaths]:
        """The state (2, n + r, b) at which the last revolution of a settling motion begins, and the paths of that
        revolution.

        The motion starts from `start`, by default from rest, and ends after a revolution that moves no position by
        `within` [m], or after `most` revolutions.
        """
        y0, samples = self.rest if start is None else start, jnp.asarray(samples)
        for _ in range(most):
            begin, paths = y0, self.revolution(samples, y0)
            y0, moved = paths.end, float(np.abs(np.asarray(paths.end) - np.asarray(begin))[0].max())
            if not np.isfinite(moved) or moved < within:
                break
        return begin, paths

    def slopes(self, samples: Any, paths: TiedPaths, directions: Directions, gaps: bool = True) -> PeriodicSlopes:
        """The slopes along all directions of the motion whose settled revolution has these `paths`; the start varies
        with the end. Without `gaps` those of the contacts are left out.

        With M the slope of the end by the start, and e that by a direction, the start's slope solves s = M s + e. A
        memory that does not move in the revolution keeps its value. The start is also held fixed if disturbances of it
        grow, because no motion settles then.
        """
        (count, _, width, cases), contacts = paths.states.shape, paths.force.shape[1]
        size, along = width + self.tied.system.mass.shape[0], directions.samples.shape[2]
        numbers, begins = directions.numbers, np.roll(np.asarray(paths.states), 1, axis=0)
        moved = 0 if numbers is None else len(numbers.at_rest)
        carried = np.zeros((cases, size + 4 + moved, size + along))
        carried[:, :size, :size] = np.eye(size)
        carried[:, size + 4 :, size + along - moved :] = np.eye(moved)
        read = np.empty((count, cases, (1 + gaps) * contacts + 1, size + along))
        for first in range(0, count, AT_ONCE):
            steps = np.minimum(np.arange(first, first + AT_ONCE), count - 1)  # always as many, for one compiled program
            moving = self.tied, jnp.asarray(samples), self.speeds, begins[steps], *self._rule, numbers, steps
            matrices = step_slopes(*moving, parts=self.parts, gaps=gaps)
            for k, matrix in zip(range(first, count), np.asarray(matrices), strict=False):
                carried[:, size : size + 4, size:] = directions.samples[k : k + 2].reshape(4, along)
                ahead = matrix @ carried
                carried[:, :size], read[k] = ahead[:, :size], ahead[:, size:]
        end, pushed = carried[:, :size, :size], carried[:, :size, size:]
        begin = np.linalg.pinv(np.eye(size) - end, rcond=1e-12) @ pushed  # (b, q, d)
        begin[np.abs(np.linalg.eigvals(end)).max(axis=1) > GROWS] = 0.0
        for row in read:
            row[..., size:] += row[..., :size] @ begin
        start = np.zeros((2 * width, cases, along))
        start[:size] = np.moveaxis(begin, 1, 0)
        start[width:] *= float(self.tied.system.stiffest())
        slopes = np.moveaxis(read[..., size:], 1, 2)  # (k, c + 1 + c, b, d)
        force, seat_gap, gap = slopes[:, :contacts], slopes[:, contacts], slopes[:, contacts + 1 :]
        return PeriodicSlopes(force, gap, seat_gap, start.reshape(2, width, cases, along))
