"""Smoothed motions by other integrators than the smooth path's: batches on equal steps, and diffrax."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.lift import Lift
from camopt.smooth.grid import equal_grid
from camopt.smooth.laws import Layer
from camopt.smooth.scan import DrivenSystem, forces_at, integrate_stages, stage_angles
from camopt.smooth.system import System, SystemState

BATCH_EPS = 1e-6
"""Width of the contact's layer [m] that some two thousand equal steps follow within 1e-3 mm; see
`experiments.gradient_batch` for its effect on the gradients."""


def stage_lifts(lift: Lift, steps: int) -> np.ndarray:
    """Lift [m] and its angle derivative [m/rad] at the stages of `steps` equal steps from -pi: (2, steps, 6). They are
    linear in the lift, as those of `camopt.smooth.simulate.lift_samples` are."""
    theta = np.asarray(stage_angles(jnp.asarray(equal_grid(steps))))
    return np.stack([lift(theta), lift(theta, 1)])


def batch_motion(system: System, stages, cam_speed, y0, eps=BATCH_EPS) -> SystemState:
    """One revolution from the states y0 (2, n) or (2, n, b) of b motions, as a `SystemState` with the
    batch first, (b, k, ...).

    `stages` (2, steps, 6, b) holds what `stage_lifts` gives for every cam; `cam_speed` (b) is in rad/s. The motion is
    differentiable in every array and has the precision of `stages`. One program is compiled per topology and set of
    shapes.
    """
    steps, width, layer = stages.shape[1], stages.shape[3], Layer(eps)
    angle = jnp.asarray(equal_grid(steps), stages.dtype)
    speed = jnp.reshape(cam_speed, (1, 1, width))
    h = jnp.diff(angle)[:, None, None, None] / speed[None]
    start = y0 if y0.ndim == 3 else jnp.broadcast_to(y0[..., None], (*y0.shape, width))
    push = system.push(stage_angles(angle))
    states = integrate_stages(system, h, (stages[0], stages[1] * speed, push), start, layer)
    # a step's first stage is at its start; lift and lift rate are equal at both ends of a revolution
    lift, lift_dtheta = jnp.concatenate([stages[:, :, 0], stages[:, :1, 0]], axis=1)
    force = jax.vmap(lambda y, l, l_dt: system.force(y, l, l_dt, layer))(states, lift, lift_dtheta * speed[0])
    parts = jax.tree.map(lambda q: jnp.moveaxis(q, -1, 0), (*system.parts(states), force))
    x, v, memory, force = parts
    slope = jnp.gradient(force, 2 * jnp.pi / steps, axis=1)
    return SystemState(jnp.broadcast_to(angle, (width, steps + 1)), lift.T, x, v, force, slope, lift_dtheta.T, memory)


@jax.jit
def tsit5_states(driven: DrivenSystem, y0, angle, layer: Layer, tolerance) -> SystemState:
    """Motion at the angles `angle` (k) [rad] from the state y0 (2, n) at the first, by diffrax's Tsit5.

    Error control is as in `refined_grid`: `tolerance` [m] per step in positions, and in velocities times the stiffest
    frequency. Samples beyond a failure of the solver are NaN.
    """
    frequency, cam_speed = jax.lax.stop_gradient(driven.system.stiffest()), driven.cam_speed
    scale = jnp.stack([jnp.ones_like(frequency), frequency])[:, None]  # one tolerance for both, in metres

    def rate(t, z, _):
        return driven.rate(z * scale, angle[0] + t * cam_speed, layer) / scale

    time = (angle - angle[0]) / cam_speed
    control = diffrax.PIDController(rtol=0.0, atol=tolerance, dtmax=2 * jnp.pi / cam_speed / 360)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate), diffrax.Tsit5(), time[0], time[-1], None, y0 / scale, saveat=diffrax.SaveAt(ts=time),
        stepsize_controller=control, max_steps=2**17, throw=False,
    )  # fmt: skip
    states = jnp.where(solution.result == diffrax.RESULTS.successful, solution.ys * scale[None], jnp.nan)
    lift, lift_dt = driven.lift(angle)
    force, force_dtheta = forces_at(driven, angle, states, layer)
    x, v, memory = driven.system.parts(states)
    return SystemState(angle, lift, x, v, force, force_dtheta, lift_dt / cam_speed, memory)
