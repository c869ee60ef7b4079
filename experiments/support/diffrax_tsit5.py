"""The smoothed motion by diffrax's Tsit5 and its reverse mode, beside which the smooth path is put."""

import diffrax
import jax
import jax.numpy as jnp

from camopt.smooth.contact import Layer
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.system import SystemState

MOST_SOLVER_STEPS = 2**17


@jax.jit
def tsit5_states(driven: DrivenSystem, y0, angle, layer: Layer, tolerance) -> SystemState:
    """Motion at the angles `angle` (k) [rad] from the state y0 (2, n) at the first.

    Error control is as in `refined_grid`: `tolerance` [m] per step in positions, and in velocities times the stiffest
    frequency. Samples beyond a failure of the solver are NaN.
    """
    frequency, cam_speed = jax.lax.stop_gradient(driven.system.stiffest()), driven.cam_speed
    scale = jnp.stack([jnp.ones_like(frequency), frequency])[:, None]  # one tolerance for both, in metres

    def rate(t, z, _):
        return driven.rate(z * scale, angle[0] + t * cam_speed, layer) / scale

    time = (angle - angle[0]) / cam_speed
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate),
        diffrax.Tsit5(),
        time[0],
        time[-1],
        None,
        y0 / scale,
        saveat=diffrax.SaveAt(ts=time),
        stepsize_controller=diffrax.PIDController(rtol=0.0, atol=tolerance, dtmax=2 * jnp.pi / cam_speed / 360),
        max_steps=MOST_SOLVER_STEPS,
        throw=False,
    )
    states = jnp.where(solution.result == diffrax.RESULTS.successful, solution.ys * scale[None], jnp.nan)
    lift, lift_dt = driven.lift(angle)
    force = jax.vmap(lambda y, l, l_dt: driven.system.force(y, l, l_dt, layer))(states, lift, lift_dt)
    x, v, memory = driven.system.parts(states)
    return SystemState(angle, lift, x, v, force, memory=memory)
