"""Forces of the tied contacts of trains of any law about one cam, from the smoothed motion by JAX.

Each train has its own forces with that cam, as it is ground for it; their slopes are those of the train as designed,
from which a drawn one's differ by some per cent, and every round takes the forces anew.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.measure.as_built import TrainAsBuilt
from camopt.optimizer.as_built.openings import STEP
from camopt.optimizer.program.force_rows import Window
from camopt.optimizer.search.smooth_rows import MOST_TURNS, SETTLED, end_of_contact
from camopt.scene.errors import NoCamFound
from camopt.scene.train import Train
from camopt.smooth.contact import Layer
from camopt.smooth.grid import equal_grid
from camopt.smooth.rest import rest_state
from camopt.smooth.simulate import lift_samples
from camopt.smooth.tied import (
    STEPS,
    WIDTH,
    Directions,
    parts_of_steps,
    path_angles,
    periodic_slopes,
    settled_paths,
    tied_system,
)


class SmoothForces:
    """The forces of trains (t), train t at the cam speeds `cam_speeds[t % classes]` (classes, s) [rad/s]."""

    for_every_cam = False

    def __init__(self, trains: Sequence[TrainAsBuilt], nominal: Train, cam: FreeCam, cam_speeds: np.ndarray):
        self._trains, self._nominal, self._cam, self._speeds = trains, nominal, cam, cam_speeds
        self._event = float(cam.breaks[0]), end_of_contact(nominal, cam, Window())
        theta, every = path_angles(), round(STEP * STEPS / (2 * np.pi))
        inside = (theta >= self._event[0] + Window().after_top) & (theta <= self._event[1] - 1e-9)
        self._at = np.flatnonzero(inside)[::every]
        self.theta = theta[self._at]
        self._systems = [tied_system(one.train) for one in trains]
        systems = [tied_system(nominal), *self._systems]
        self._parts = max(parts_of_steps(tied, float(cam_speeds.min())) for tied in systems)
        every = [one.train for one in trains]
        self._starts = [jnp.repeat(rest_state(t)[:, :, None], cam_speeds.shape[1], axis=2) for t in every]
        grid = equal_grid(STEPS)
        basis = np.stack([(cam.basis(grid, k)[0] @ cam.Z).T for k in (0, 1)], axis=-1)
        self._along = Directions(samples=jnp.asarray(basis))

    def about(self, z: np.ndarray) -> np.ndarray:
        """The forces (t, s, c, k, 1 + m) [N] in single precision: those with the cam of z (m), with slopes by z."""
        lift = self._cam.lift(z)
        slopes = [self._slopes(lift, speeds) for speeds in self._speeds]
        found = []
        for t, (one, tied) in enumerate(zip(self._trains, self._systems, strict=True)):
            slope = slopes[t % len(slopes)]
            speeds = jnp.asarray(self._speeds[t % len(slopes)])
            _, paths = self._settled(tied, one.cam(lift), speeds, self._starts[t])
            force = np.moveaxis(np.asarray(paths.force)[self._at], 2, 0).swapaxes(1, 2)  # (s, c, k)
            if not np.all(np.isfinite(force)):
                raise NoCamFound("the smoothed motion with tied contacts grows without bound in a drawn train")
            self._starts[t] = paths.end
            found.append(np.concatenate([(force - slope @ z)[..., None], slope], axis=-1).astype(np.float32))
        return np.array(found)

    def _settled(self, tied, lift, speeds, start):
        samples = jnp.asarray(lift_samples(lift, STEPS))
        motion = samples, speeds, start, self._event, 1.0, Layer(WIDTH)
        return settled_paths(tied, *motion, parts=self._parts, most=MOST_TURNS, within=SETTLED)

    def _slopes(self, lift, cam_speeds: np.ndarray) -> np.ndarray:
        """Slopes (s, c, k, m) [N/m] of the train as designed."""
        tied, speeds = tied_system(self._nominal), jnp.asarray(cam_speeds)
        rest = jnp.repeat(rest_state(self._nominal)[:, :, None], len(speeds), axis=2)
        start, _ = self._settled(tied, lift, speeds, rest)
        samples = jnp.asarray(lift_samples(lift, STEPS))
        motion = samples, speeds, start, self._event, 1.0, Layer(WIDTH)
        slopes = periodic_slopes(tied, *motion, [self._along], parts=self._parts)
        return np.moveaxis(slopes.force[self._at], (2, 1), (0, 1))
