"""Simulation of a valve train on the smooth path: the differentiable core, and the record as NumPy arrays.

`differentiable_motion` is what `camopt.simulate(..., method="smooth", parameters=...)` calls: one motion as a function
of the numbers of train and cam. `parameters` is a dictionary of arrays, by which JAX can differentiate, batch and trace
without any further preparation.
"""

from collections.abc import Mapping
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.lift import Lift, permitted_steps, steps_at_borders
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.response import Response, Revolve
from camopt.scene.shapes import Float
from camopt.scene.train import LAW_PARAMETERS, Train
from camopt.smooth.families import polynomial
from camopt.smooth.grid import LARGEST_PHASE, equal_grid, refined_grid, regular_angles
from camopt.smooth.laws import Layer
from camopt.smooth.metrics import at_angle, revolution_metrics
from camopt.smooth.rest import rest_of
from camopt.smooth.scan import DrivenSystem, forces_at, integrate, lift_at
from camopt.smooth.system import System, SystemState, build_system, stacked

EPS = 2e-9
"""Default width of the contact's layer [m]. A width of 1e-7 makes gradients of bouncing motions of `kodama` wrong by up
to 5 percent, and one of 1e-8 those of a hop of 6e-8 m by 2 percent. The grid resolves the layer, so that a narrow one
costs no more than a wide one."""
LAYER = Layer(EPS)
TOLERANCE = 3e-12
"""Default error permitted per step [m]. Gradients at 6000 r/min are then right within one percent; with 1e-9 they are
right within ten percent."""
STEPS = 5120
"""Number of steps first offered per revolution; `kodama` needs 3000 to 4500 at 5000 to 6500 r/min."""
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

    The motion is differentiable in every array. The samples of `driven` are those of `lift_samples`; `tolerance` [m] is
    that of `refined_grid`, and without `refine` the steps are equal. `jax.vmap` makes batches of speeds, cams or
    systems. One program is compiled per topology, shapes and keywords. If `steps` do not suffice every sample is NaN.
    """

    def revolve(y, _):
        if refine:
            angle, on_grid = refined_grid(driven, y, layer, tolerance, steps)
        else:
            angle, on_grid = jnp.asarray(equal_grid(steps), y.dtype), None
        states = integrate(driven, y, angle, layer, on_grid)
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


def prepare(train: Train, lift: Lift, cam_speed: float, *, eps: float = EPS, tolerance: float = TOLERANCE) -> Revolve:
    """One smoothed revolution as a function of its start state (2n + r: [m], [m/s], [m]); `cam_speed` is in rad/s.

    `eps` [m] is the width of the contacts' layer and `tolerance` [m] that of `response_arrays`; the number of steps is
    raised until it suffices. Raises InputError for a width that is not positive, and MotionRefused where no grid
    resolves the motion.
    """
    if not eps > 0.0:
        raise InputError(
            f"eps = {eps:g} m: the width of the contact's layer must be positive; {EPS:g} m is the default"
        )
    layer, driven = Layer(eps), DrivenSystem(build_system(train), jnp.asarray(lift_samples(lift)), cam_speed)

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
                f"smooth path at {cam_speed * 30 / np.pi:g} cam r/min with eps = {eps:g} m: no grid of the steps "
                f"allowed resolves the motion; widen eps, loosen the tolerance, or take more steps"
            )
        distinct = np.append(True, np.diff(angle) > 0)
        return Response(train, cam_speed, *(q[distinct] for q in (angle, cam_lift, x, v, force, memory)))

    return one_revolution


def system_with(train: Train, parameters: Mapping[str, jax.Array]) -> System:
    """The system of a train, in which the numbers that `parameters` holds take the place of the train's own."""
    system = build_system(train)
    names = [name for name in train.parameters if name in parameters]
    values = [jnp.asarray(parameters[name], system.mass.dtype) for name in names]
    return eqx.tree_at(lambda s: [getattr(s.laws if n in LAW_PARAMETERS else s, n) for n in names], system, values)


def samples_of_pieces(borders, coefficients: Float[jax.Array, "p q"]) -> Float[jax.Array, "k 2"]:
    """As `lift_samples`, of polynomial pieces with coefficients [m/rad^k] between `borders` (p + 1) [rad].

    Derivatives by the borders assume that lift and velocity are continuous across them.
    """
    theta, borders = jnp.asarray(equal_grid(LIFT_SAMPLES)), jnp.asarray(borders)
    piece = jnp.clip(jnp.searchsorted(borders, theta, side="right") - 1, 0, len(borders) - 2)
    return jnp.stack([polynomial(coefficients[piece], theta - borders[piece], k) for k in (0, 1)], axis=-1)


def differentiable_motion(
    train: Train,
    lift: Lift,
    parameters: Mapping[str, jax.Array],
    cam_speed,
    revolutions: int,
    steps: int,
    slowest: float,
    eps: float = EPS,
) -> tuple[Response, dict[str, jax.Array]]:
    """Motion from rest on `steps` equal steps per revolution, and the metrics of all revolutions but the last.

    `parameters` maps names of `train.parameters` to arrays of their shapes, "lift" to the coefficients of the cam's
    pieces (p, q) [m/rad^k], "borders" to these pieces' (p + 1) [rad], "half_duration" to a number [rad]; what is left
    out is the train's and the cam's. `cam_speed` [rad/s] may be traced; the number of steps suits the `slowest` that it
    may be. The contacts' layer is `eps` [m] wide. The record's arrays are JAX arrays. The motion is NaN if the
    `allowed_steps` do not resolve it, or if the cam's pieces do not join.
    """
    numbers = {name: jnp.asarray(value, float) for name, value in parameters.items()}
    pieces, borders = numbers.get("lift", lift.coefficients), numbers.get("borders", lift.borders)
    cam = pieces, borders, numbers.get("half_duration", lift.half_duration), permitted_steps(lift)
    settings = {"revolutions": revolutions, "steps": steps, "most": allowed_steps(train, slowest)}
    foot = int(np.argmin(np.abs(lift.borders - lift.opening_foot)))
    motion, metrics = _motion(system_with(train, numbers), *cam, cam_speed, eps, foot=foot, **settings)
    return Response(train, cam_speed, regular_angles(revolutions, steps), *motion), metrics


def allowed_steps(train: Train, slowest: float) -> int:
    """Steps offered per revolution: `STEPS`, doubled for slow speeds [rad/s] of stiff trains until half of them suffice
    for stability."""
    with jax.ensure_compile_time_eval():
        least = 2 * np.pi / slowest * float(build_system(train).stiffest()) / LARGEST_PHASE
    return STEPS * 2 ** max(0, int(np.ceil(np.log2(2 * least / STEPS))))


@partial(jax.jit, static_argnames=("foot", "revolutions", "steps", "most"))
def _motion(
    system: System, pieces, borders, half_duration, permitted, cam_speed, eps, *, foot, revolutions, steps, most
):
    """The motion at regular angles and its metrics, by one program that is kept on disk; NaN if the pieces have steps
    larger than `permitted`. The border number `foot` is the opening foot."""
    joined = (steps_at_borders(borders, pieces) <= permitted).all()
    samples = jnp.where(joined, samples_of_pieces(borders, pieces), jnp.nan)
    driven = DrivenSystem(system, samples, cam_speed)
    motion = response_arrays(driven, rest_of(system), Layer(eps), revolutions=revolutions, steps=most)
    of_revolutions = [
        revolution_metrics(system, motion, cam_speed, half_duration, borders[foot], r, Layer(eps).half_width)
        for r in range(revolutions - 1)
    ]
    names = of_revolutions[0] if of_revolutions else ()
    metrics = {name: jnp.stack([values[name] for values in of_revolutions]) for name in names}
    return regular(motion, cam_speed, regular_angles(revolutions, steps)), metrics


def regular(motion: SystemState, cam_speed, angle: np.ndarray) -> tuple[jax.Array, ...]:
    """Lift, positions, velocities and forces at the angles `angle` [rad]; between samples positions are cubics, and all
    else is linear."""
    theta = jnp.asarray(angle)

    def at(values, *slopes):
        return jax.vmap(lambda q, *s: at_angle(motion.angle, q, theta, *s), 1, 1)(values, *slopes)

    lift = at_angle(motion.angle, motion.lift, theta)
    return lift, at(motion.x, motion.v / cam_speed), at(motion.v), at(motion.force)
