"""Forces of the tied contacts of drawn trains with any law, linearised about one cam, from the smoothed motion by JAX.

The forces are those of each train with its own ground cam. Their derivatives are those of the train as designed, from
which the derivatives of a drawn train differ by some per cent; every linearisation evaluates the forces again.
"""

from collections.abc import Sequence
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.cam.lift import Lift
from camopt.measure.as_built import TrainAsBuilt
from camopt.optimizer.as_built.openings_program import STEP
from camopt.optimizer.search.smooth_rows import MOST_TURNS, SETTLED, end_of_contact, in_event
from camopt.scene.errors import NoCamFound
from camopt.scene.smoothing import Smoothing
from camopt.scene.train import Train
from camopt.smooth.grid import equal_grid
from camopt.smooth.laws import Layer
from camopt.smooth.periodic_slopes import Directions, TiedMotions
from camopt.smooth.simulate import lift_samples
from camopt.smooth.tied import (
    STEPS,
    WIDTH,
    parts_of_steps,
    path_angles,
    tied_paths,
    tied_system,
)

AT_ONCE = 40
"""Number of trains whose motions are integrated in one batch."""
WITHIN = 2.0
"""Change of the tied forces over one or two revolutions [N] below which the motions count as settled: a twentieth of
the margin of a search's first cam. A few of a hundred trains with clashing springs repeat every other revolution."""


class SmoothForces:
    """The forces of drawn trains (t); train t has the cam speeds `cam_speeds[t % classes]` (classes, s) [rad/s]."""

    def __init__(self, trains: Sequence[TrainAsBuilt], nominal: Train, cam: FreeCam, cam_speeds: np.ndarray):
        self._trains, self._nominal, self._cam, self._speeds = trains, nominal, cam, cam_speeds
        self._event = float(cam.breaks[0]), end_of_contact(nominal, cam)
        theta, stride = path_angles(), round(STEP * STEPS / (2 * np.pi))
        self._at = np.flatnonzero(in_event(theta, self._event))[::stride]
        self.theta = theta[self._at]
        self._systems = [tied_system(built.train) for built in trains]
        systems = tied_system(nominal), *self._systems
        self._parts = max(parts_of_steps(tied, float(cam_speeds.min())) for tied in systems)
        self._starts: list[jnp.ndarray] = []  # final states of the trains' last motions
        self._along = Directions(cam.samples(equal_grid(STEPS))[0])

    def about(self, z: np.ndarray) -> np.ndarray:
        """Forces (t, s, c, k, 1 + m) [N] at z = 0 and per coefficient, linearised about z (m); in single precision."""
        lift, count = self._cam.lift(z), len(self._speeds)
        slopes, starts = zip(*(self._slopes(lift, speeds) for speeds in self._speeds), strict=True)
        numbers = range(len(self._trains))
        begin = self._starts or [starts[t % count] for t in numbers]
        shape = len(numbers), self._speeds.shape[1], len(self._nominal.cam_side), len(self.theta), 1 + len(z)
        forces = np.empty(shape, dtype=np.float32)
        self._starts = []
        for batch in (numbers[i : i + AT_ONCE] for i in range(0, len(numbers), AT_ONCE)):
            force = self._forces(lift, batch, begin)
            for t, one in zip(batch, force, strict=True):
                slope = slopes[t % count]
                forces[t, ..., 0], forces[t, ..., 1:] = one - slope @ z, slope
        return forces

    def _forces(self, lift: Lift, batch: Sequence[int], begin: Sequence[jnp.ndarray]) -> np.ndarray:
        """Forces (t, s, c, k) [N] of the settled motions of some trains, from the initial states `begin`."""
        tied = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(self._systems[t] for t in batch))
        samples = jnp.asarray(np.stack([lift_samples(self._trains[t].cam(lift), STEPS) for t in batch]))
        speeds = jnp.asarray(self._speeds[np.array(batch) % len(self._speeds)])
        start = jnp.stack([begin[t] for t in batch])
        before = force = jnp.full((len(batch), 1, 1, 1), jnp.inf)
        for _ in range(MOST_TURNS):
            force_along, start = _of_trains(tied, samples, speeds, start, self._event, Layer(WIDTH), parts=self._parts)
            now = force_along[:, self._at]
            moved = jnp.minimum(*(jnp.abs(now - force_before).max(axis=(1, 2, 3)) for force_before in (force, before)))
            before, force = force, now
            if not float(moved.max()) > WITHIN:  # also ends where a motion is no longer finite
                break
        force = np.asarray(force)
        if not np.all(np.isfinite(force)):
            raise NoCamFound(
                "the smoothed motion with tied contacts grows without bound in a drawn train: give elements more "
                "damping_N_s_per_m, or make the tolerances narrower"
            )
        self._starts += list(start)
        return np.moveaxis(force, (3, 2), (1, 2))

    def _slopes(self, lift: Lift, cam_speeds: np.ndarray) -> tuple[np.ndarray, jnp.ndarray]:
        """Derivatives (s, c, k, m) [N/m] of the forces of the train as designed, and its settled final states."""
        motions, samples = (
            TiedMotions(self._nominal, cam_speeds, self._event, Smoothing(), self._parts),
            lift_samples(lift, STEPS),
        )
        _, paths = motions.settled(samples, most=MOST_TURNS, within=SETTLED)
        slopes = motions.slopes(samples, paths, self._along, gaps=False)
        return np.moveaxis(slopes.force[self._at], (2, 1), (0, 1)), paths.end


@partial(jax.jit, static_argnames="parts")
def _of_trains(tied, samples, cam_speeds, y0, event, layer: Layer, *, parts: int):
    """Forces and final states of `tied_paths`, batched over the first axis of systems, samples, speeds and states."""

    def of_train(*one):
        paths = tied_paths(*one, event, 1.0, layer, parts=parts)
        return paths.force, paths.end

    return jax.vmap(of_train)(tied, samples, cam_speeds, y0)
