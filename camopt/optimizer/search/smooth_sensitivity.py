"""Slopes of the limited metrics on the smooth path; importing this file imports JAX."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.optimizer.search.judge import Judged
from camopt.optimizer.search.sensitivity import REVOLUTIONS
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.smooth.grid import equal_grid
from camopt.smooth.metrics import revolution_metrics
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import EPS, LIFT_SAMPLES, response_arrays, touch_layer
from camopt.smooth.system import build_system, stacked


class SmoothSensitivity:
    """Values and gradients of metrics by z on the smooth path, at a fixed number of speeds (one compilation)."""

    def __init__(self, scene: Scene, cam: FreeCam, names: tuple[str, ...], width: int):
        self.scene, self.width, self.masses = scene, width, len(scene.mass)
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
                motion = response_arrays(DrivenSystem(system, samples, cam_speed), y0, revolutions=REVOLUTIONS)
                found = revolution_metrics(system, motion, cam_speed, half, foot, REVOLUTIONS - 1, touch_layer(EPS))
                return jnp.stack([found[n] for n in names])

            return metrics(z), jax.jacrev(metrics)(z)

        self._compiled = jax.jit(one)

    def __call__(self, z: np.ndarray, judged: Judged, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Metrics (r, l) and gradients (r, l, m) at the judged speeds `rows` (r <= width)."""
        filled = np.resize(rows, self.width)  # a fixed width: one compilation
        speeds = np.array([self.scene.cam_speed(s) for s in judged.speeds_rpm[filled]])
        states = stacked(judged.states[filled], self.masses)
        values, slopes = self._compiled(jnp.asarray(z), jnp.asarray(speeds), states)
        return np.asarray(values)[: len(rows)], np.asarray(slopes)[: len(rows)]
