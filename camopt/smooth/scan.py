"""Explicit Runge-Kutta of order five (Dormand and Prince) as one `lax.scan` on a given grid of angles.

The grid is data: `camopt.smooth.grid` refines it where a contact crosses its layer. Derivatives are taken on the fixed
grid, which is right because a resolved motion does not depend on its grid.
Source: Dormand, Prince (1980), A family of embedded Runge-Kutta formulae, J. Comp. Appl. Math. 6, table 2;
the numbers are those of SciPy's class `RK45`.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from scipy.integrate import RK45

from camopt.scene.shapes import Float
from camopt.smooth.laws import Layer
from camopt.smooth.system import Array, System

NODES = RK45.C
STAGES = tuple(tuple(RK45.A[i, :i].tolist()) for i in range(len(NODES)))  # Python's, so that float32 stays float32
WEIGHTS = tuple(RK45.B.tolist())
ERROR = tuple((-RK45.E).tolist())
"""Weights of the result of order five minus those of the embedded result of order four; the last weight belongs to the
first slope of the next step."""


def lift_at(
    samples: Float[Array, "m_plus_1 2"], theta: Float[Array, " *shape"], first=-jnp.pi, span: float = 2 * jnp.pi
) -> tuple[Float[Array, " *shape"], Float[Array, " *shape"]]:
    """Lift [m] and its angle derivative [m/rad] at `theta` [rad], cubic between samples.

    `samples` hold lift and its angle derivative at m + 1 equally spaced angles over the `span` [rad] from the angle
    `first` [rad], by default those of a revolution. The result is linear in `samples`.
    """
    count = samples.shape[0] - 1
    width = span / count
    place = jnp.mod(theta - first, 2 * jnp.pi) / width
    cell = jnp.clip(place.astype(int), 0, count - 1)
    s = place - cell
    left, right = samples[cell], samples[cell + 1]
    l0, v0, l1, v1 = left[..., 0], left[..., 1] * width, right[..., 0], right[..., 1] * width
    c2, c3 = 3 * (l1 - l0) - 2 * v0 - v1, 2 * (l0 - l1) + v0 + v1
    return l0 + s * (v0 + s * (c2 + s * c3)), (v0 + s * (2 * c2 + 3 * s * c3)) / width


def hermite(t, start, rise, m0, m1):
    """Value at t of the cubic on [0, 1] that begins at `start`, rises by `rise` and has the end slopes m0 and m1."""
    return start + t * rise + t * (1 - t) * ((1 - t) * (m0 - rise) - t * (m1 - rise))


class DrivenSystem(NamedTuple):
    """A valve train with the cam that drives it and its speed: the differential equation that is integrated."""

    system: System
    samples: Float[Array, "m_plus_1 2"]  # of the lift, as `lift_at` reads them
    cam_speed: Array  # rad/s

    def lift(self, theta: Float[Array, " *shape"]) -> tuple[Float[Array, " *shape"], Float[Array, " *shape"]]:
        """Lift [m] and lift rate [m/s] at `theta` [rad]."""
        lift, lift_dtheta = lift_at(self.samples, theta)
        return lift, lift_dtheta * self.cam_speed

    def rate(self, y: Float[Array, "2 n"], theta, layer: Layer) -> Float[Array, "2 n"]:
        """Time derivative of the state y at the angle `theta` [rad]."""
        return self.system.rate(y, *self.lift(theta), layer, self.system.push(theta))

    def cam(self, theta: Float[Array, " *shape"]) -> tuple:
        """Lift [m], lift rate [m/s] and given forces [N] (None where there are none) at `theta` [rad]."""
        return *self.lift(theta), self.system.push(theta)


def forces_at(driven: DrivenSystem, angle, states, layer: Layer):
    """Forces [N] and their derivatives by angle [N/rad], each (k, e), at angles (k) [rad] and states (k, 2, n)."""

    def both(y, theta):
        along = driven.rate(y, theta, layer) / driven.cam_speed, jnp.ones_like(theta)
        return jax.jvp(lambda y, theta: driven.system.force(y, *driven.lift(theta), layer), (y, theta), along)

    return jax.vmap(both)(states, angle)


def combine(y, h, weights, slopes):
    """y + h * sum_j weights_j slopes_j."""
    return y + h * sum(w * k for w, k in zip(weights, slopes, strict=True) if w != 0.0)


def at_stage(cam: tuple, i: int) -> tuple:
    """The rows of `cam` (6, ...) for stage i of a step."""
    return jax.tree.map(lambda q: q[i], cam)


def stage_slopes(system: System, y, k1, h, cam: tuple, layer: Layer) -> list[jax.Array]:
    """The six slopes of a step of `h` [s] from the state y (2, n), whose first slope is k1.

    `cam` is what `DrivenSystem.cam` gives at the step's `NODES`.
    """
    slopes = [k1]
    for i in range(1, 6):
        lift, lift_dt, push = at_stage(cam, i)
        slopes.append(system.rate(combine(y, h, STAGES[i], slopes), lift, lift_dt, layer, push))
    return slopes


def integrate(driven: DrivenSystem, y0, angle, layer: Layer, on_grid=None) -> jax.Array:
    """States (k, 2, n) at the ascending angles `angle` (k) [rad], which may repeat, from the state y0 (2, n).

    If `on_grid` (k, 2, n) gives the states that were found with the grid, each step starts from these, and the scan
    carries only the derivatives. Rounding that grows from contact to contact then cannot move the motion off its grid.
    """
    cam = driven.cam(stage_angles(angle))
    return integrate_stages(driven.system, jnp.diff(angle) / driven.cam_speed, cam, y0, layer, on_grid)


def stage_angles(angle: jax.Array) -> jax.Array:
    """Angles (k - 1, 6) [rad] of the stages of the steps between the angles (k)."""
    return angle[:-1, None] + jnp.diff(angle)[:, None] * jnp.asarray(NODES, angle.dtype)[None, :]


def integrate_stages(system: System, h, cam: tuple, y0, layer: Layer, on_grid=None) -> jax.Array:
    """The states of `integrate`, from steps h (k - 1) [s] and lift [m], lift rate [m/s] (k - 1, 6) and given forces [N]
    (k - 1, 6, n), or None, at the stages.

    The axis of a batch comes last: h (k - 1, 1, 1, b), lift and its rate (k - 1, 6, b) and y0 (2, n, b) give states
    (k, 2, n, b). The given forces are the same for all.
    """

    @partial(jax.checkpoint, prevent_cse=False)  # storing the stages would cost more than repeating them
    def step(y, inputs):
        h, cam, end = inputs
        lift, lift_dt, push = at_stage(cam, 0)
        k1 = system.rate(y, lift, lift_dt, layer, push)
        y = combine(y, h, WEIGHTS, stage_slopes(system, y, k1, h, cam, layer))
        y = y if end is None else y + jax.lax.stop_gradient(end - y)
        return y, y

    ends = None if on_grid is None else on_grid[1:]
    _, states = jax.lax.scan(step, y0, (h, cam, ends))
    return jnp.concatenate([y0[None], states])
