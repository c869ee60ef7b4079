"""Simulating a valve train on the smooth path: the differentiable core, and the record for everyone else."""

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.response import Response, Revolve, end_state, joined
from camopt.scene.rest import state_at_rest
from camopt.scene.train import Train
from camopt.smooth.contact import Layer
from camopt.smooth.grid import equal_grid, refined_grid
from camopt.smooth.scan import DrivenSystem, forces_at, integrate, lift_at
from camopt.smooth.system import SystemState, build_system, stacked

EPS = 2e-9
"""Default width of the contact's layer [m]. A width of 1e-7 makes gradients of bouncing motions of `kodama` wrong by up
to 5 percent, and one of 1e-8 those of a hop of 6e-8 m by 2 percent. The grid resolves the layer, so that a narrow one
costs no more than a wide one."""
LAYER = Layer(EPS)
TOLERANCE = 3e-12
"""Default error permitted per step [m]. Gradients at 6000 r/min are then right within one percent; with 1e-9 they are
right within ten percent."""
STEPS = 5120
"""Number of steps offered per revolution at first; `kodama` needs 3000 to 4500 at 5000 to 6500 r/min."""
MOST_GRID_STEPS = 2**17
"""A motion that needs more steps per revolution than this is refused."""
LIFT_SAMPLES = 2880


def lift_samples(lift: Lift, steps: int = LIFT_SAMPLES) -> np.ndarray:
    """Lift [m] and its angle derivative [m/rad] at `steps` + 1 equal angles from -pi to pi.

    They are linear in the lift: those of L0 + sum_j z_j B_j are those of L0 plus the sum of z_j times those of B_j.
    """
    theta = equal_grid(steps)
    return np.stack([lift(theta), lift(theta, 1)], axis=-1)


def response_arrays(
    driven: DrivenSystem,
    y0: jax.Array,
    layer: Layer = LAYER,
    tolerance=TOLERANCE,
    *,
    revolutions: int = 1,
    steps: int = STEPS,
    refine: bool = True,
) -> SystemState:
    """Motion over `revolutions` from the state y0 (2, n) at -pi, with `steps` + 1 samples per revolution.

    The motion is differentiable in every array. The samples of `driven` are what `lift_samples` gives; `tolerance` [m]
    is that of `refined_grid`, and without `refine` the steps are equal. `jax.vmap` makes batches of speeds, cams or
    systems. One program is compiled per topology, shapes and keywords. Where `steps` do not suffice every sample
    is NaN.
    """

    def revolve(y, _):
        if refine:
            angle, known = refined_grid(driven, y, layer, tolerance, steps)
        else:
            angle, known = jnp.asarray(equal_grid(steps), y.dtype), None
        states = integrate(driven, y, angle, layer, known)
        force, force_dtheta = forces_at(driven, angle, states, layer)
        arrived = angle[-1] >= jnp.asarray(jnp.pi, y.dtype)
        states, force = (jnp.where(arrived, q, jnp.nan) for q in (states, force))
        lift, lift_dtheta = lift_at(driven.samples, angle)
        x, v, memory = driven.system.parts(states)
        return states[-1], SystemState(angle, lift, x, v, force, force_dtheta, lift_dtheta, memory)

    _, motion = jax.lax.scan(revolve, y0, None, length=revolutions)
    turns = 2 * jnp.pi * jnp.arange(revolutions, dtype=y0.dtype)[:, None]
    motion = motion._replace(angle=motion.angle + turns)
    return jax.tree.map(lambda q: q.reshape(-1, *q.shape[2:]), motion)


compiled_response = jax.jit(response_arrays, static_argnames=("revolutions", "steps", "refine"))


def prepare(
    train: Train,
    lift: Lift,
    cam_speed: float,
    *,
    layer: Layer = LAYER,
    tolerance: float = TOLERANCE,
) -> Revolve:
    """One smoothed revolution as a function of its start state (2n + r: [m], [m/s], [m]); `cam_speed` is in rad/s.

    `layer` and `tolerance` [m] are those of `response_arrays`; the number of steps is raised until it suffices. Raises
    InputError for a width that is not positive, and MotionRefused where no grid resolves the motion.
    """
    if not layer.eps > 0.0:
        raise InputError(
            f"eps = {layer.eps:g} m: the width of the contact's layer must be positive; {EPS:g} m is the default"
        )
    driven = DrivenSystem(build_system(train), jnp.asarray(lift_samples(lift)), cam_speed)

    def one_revolution(state: np.ndarray) -> Response:
        y0, steps = stacked(state, len(train.mass)), STEPS
        motion = compiled_response(driven, y0, layer, tolerance, steps=steps)
        while not jnp.isfinite(motion.x[0, 0]) and steps < MOST_GRID_STEPS:
            steps *= 4
            motion = compiled_response(driven, y0, layer, tolerance, steps=steps)
        angle, cam_lift, x, v, force = (np.asarray(q) for q in motion[:5])
        memory = np.zeros((len(angle), 0)) if motion.memory is None else np.asarray(motion.memory)
        if not np.all(np.isfinite(x)):
            raise MotionRefused(
                f"smooth path at {cam_speed * 30 / np.pi:g} cam r/min with eps = {layer.eps:g} m: no grid of the steps "
                f"allowed resolves the motion; widen eps, loosen the tolerance, or take more steps"
            )
        distinct = np.append(True, np.diff(angle) > 0)
        return Response(train, cam_speed, *(q[distinct] for q in (angle, cam_lift, x, v, force, memory)))

    return one_revolution


def simulate_smooth(
    train: Train,
    lift: Lift,
    cam_speed: float,
    revolutions: int = 2,
    *,
    eps: float = EPS,
    tolerance: float = TOLERANCE,
) -> Response:
    """Motion from rest on the base circle over `revolutions`, by the scan; `eps` [m] is the width of the layer, the
    other arguments and the errors are those of `prepare`."""
    revolve = prepare(train, lift, cam_speed, layer=Layer(eps), tolerance=tolerance)
    records = [revolve(state_at_rest(train))]
    for _ in range(revolutions - 1):
        records.append(revolve(end_state(records[-1])))
    return joined(records)
