"""Slopes of the limited metrics by the free cam's coefficients, from the settled states, on either differentiable path.

A change of the cam also changes the settled state in which the traced revolutions begin. That effect is left out: on
`kodama` it has fallen to a fifth or less after two revolutions (spectral radius 0.32 to 0.44).
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.exact.batch import value_and_gradient_many
from camopt.optimizer.search.judge import Judged
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.smooth.grid import equal_grid
from camopt.smooth.metrics import revolution_metrics
from camopt.smooth.simulate import EPS, LIFT_SAMPLES, response_arrays, touch_layer
from camopt.smooth.system import build_system

REVOLUTIONS = 2
"""Number of revolutions that run from the settled state; the last one is measured."""


class SmoothSensitivity:
    """Values and gradients of metrics by z on the smooth path, at a fixed number of speeds (one compilation)."""

    def __init__(self, scene: Scene, cam: FreeCam, names: tuple[str, ...], width: int):
        self.scene, self.width = scene, width
        theta = equal_grid(LIFT_SAMPLES)
        parts = [cam.basis(theta, k) for k in (0, 1)]
        matrix = np.stack([m @ cam.Z for m, _ in parts], axis=1)  # (k, 2, m)
        offset = np.stack([m @ cam.x_p + o for m, o in parts], axis=1)
        foot = cam.lift(np.zeros(cam.Z.shape[1])).opening_foot  # of the ramp, the same for every z
        system, half = build_system(build_train(scene)), float(cam.breaks[-1])

        @partial(jax.vmap, in_axes=(None, 0, 0))
        def one(z, cam_speed, y0):
            def metrics(z):
                samples = jnp.asarray(offset) + jnp.asarray(matrix) @ z
                motion = response_arrays(system, samples, cam_speed, y0, revolutions=REVOLUTIONS)
                found = revolution_metrics(system, motion, cam_speed, half, foot, REVOLUTIONS - 1, touch_layer(EPS))
                return jnp.stack([found[n] for n in names])

            return metrics(z), jax.jacrev(metrics)(z)

        self._compiled = jax.jit(one)

    def __call__(self, z: np.ndarray, judged: Judged, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Metrics (r, l) and gradients (r, l, m) at the judged speeds `rows` (r <= width)."""
        filled = np.resize(rows, self.width)  # a fixed width: one compilation
        speeds = np.array([self.scene.cam_speed(s) for s in judged.speeds_rpm[filled]])
        states = judged.states[filled].reshape(self.width, 2, -1)
        values, slopes = self._compiled(jnp.asarray(z), jnp.asarray(speeds), jnp.asarray(states))
        return np.asarray(values)[: len(rows)], np.asarray(slopes)[: len(rows)]


class ExactSensitivity:
    """Values and gradients of metrics by z through the exact motion and its contacts, by the event-exact adjoint."""

    def __init__(self, scene: Scene, cam: FreeCam, names: tuple[str, ...], width: int):
        self.scene, self.cam, self.names, self.width = scene, cam, names, width
        self.train, (self.matrix, _) = build_train(scene), cam.piece_basis()

    def __call__(self, z: np.ndarray, judged: Judged, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Metrics (r, l) and gradients (r, l, m) at the judged speeds `rows`; NaN for a motion that is refused."""
        speeds = [self.scene.cam_speed(s) for s in judged.speeds_rpm[rows]]
        found = value_and_gradient_many(
            self.train, [self.cam.lift(z)] * len(rows), speeds, self.names, judged.states[rows],
            revolutions=REVOLUTIONS + 1, revolution=REVOLUTIONS - 1,
        )  # fmt: skip
        empty = np.full(len(self.names), np.nan), np.full((len(self.names), self.matrix.shape[2]), np.nan)
        answers = [
            empty if g is None else (g.values, np.tensordot(g.by_coefficients, self.matrix, axes=2)) for g in found
        ]
        return np.stack([a[0] for a in answers]), np.stack([a[1] for a in answers])


Sensitivity = SmoothSensitivity | ExactSensitivity
SENSITIVITIES = {"smooth": SmoothSensitivity, "exact": ExactSensitivity}
"""The paths by the names that `--gradient` takes."""
