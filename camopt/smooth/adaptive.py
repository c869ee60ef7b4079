"""Adaptive integrators of diffrax for the same smoothed motion: they check the scan and give a choice of solvers."""

from functools import partial

import diffrax
import jax
import jax.numpy as jnp

from camopt.scene.errors import InputError
from camopt.smooth.contact import Layer
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.system import SystemState

MOST_SOLVER_STEPS = 2**17
SOLVERS = {
    name.lower(): getattr(diffrax, name)
    for name in ("Tsit5", "Dopri5", "Dopri8", "Bosh3", "Heun", "Kvaerno3", "Kvaerno5", "KenCarp4", "KenCarp5")
}
"""Diffrax's solvers for ordinary differential equations with an error estimate, by their names in lower case."""


ADJOINTS = {"reverse": diffrax.RecursiveCheckpointAdjoint, "forward": diffrax.ForwardMode}
"""Modes of differentiation. One has to be chosen in advance, because diffrax's checkpointed loop knows no forward mode
and its other loop knows no reverse mode."""


@partial(jax.jit, static_argnames=("solver", "adjoint"))
def adaptive_states(
    driven: DrivenSystem, y0, angle, layer: Layer, tolerance, *, solver="tsit5", adjoint="reverse"
) -> SystemState:
    """Motion at the angles `angle` (k) [rad] from the state y0 (2, n) at the first; arguments as of `response_arrays`.

    `adjoint` is "reverse" or "forward", the one mode in which it may then be differentiated. Error control is as in
    `refined_grid`: `tolerance` [m] per step in positions, and in velocities times the stiffest frequency. Samples
    beyond a failure of the solver are NaN. Raises InputError for an unknown solver or adjoint.
    """
    if adjoint not in ADJOINTS:
        raise InputError(f"adjoint {adjoint!r}: unknown; choose one of {', '.join(ADJOINTS)}")
    if solver not in SOLVERS:
        raise InputError(f"method {solver!r}: unknown; choose scan or one of {', '.join(SOLVERS)}")
    frequency, cam_speed = jax.lax.stop_gradient(driven.system.stiffest()), driven.cam_speed
    scale = jnp.stack([jnp.ones_like(frequency), frequency])[:, None]  # one tolerance for both, in metres

    def rate(t, z, _):
        return driven.rate(z * scale, angle[0] + t * cam_speed, layer) / scale

    time = (angle - angle[0]) / cam_speed
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate),
        SOLVERS[solver](),
        time[0],
        time[-1],
        None,
        y0 / scale,
        saveat=diffrax.SaveAt(ts=time),
        stepsize_controller=diffrax.PIDController(rtol=0.0, atol=tolerance, dtmax=2 * jnp.pi / cam_speed / 360),
        adjoint=ADJOINTS[adjoint](),
        max_steps=MOST_SOLVER_STEPS,
        throw=False,
    )
    assert solution.ys is not None
    states = solution.ys * scale[None]
    states = jnp.where(solution.result == diffrax.RESULTS.successful, states, jnp.nan)
    lift, lift_dt = driven.lift(angle)
    force = jax.vmap(lambda y, l, l_dt: driven.system.force(y, l, l_dt, layer))(states, lift, lift_dt)
    x, v, memory = driven.system.parts(states)
    return SystemState(angle, lift, x, v, force, memory=memory)
