"""`camopt.simulate(..., method="smooth", parameters=...)`: one motion as a function of the numbers of train and cam.

`parameters` is a dictionary of arrays, which JAX can differentiate by, batch and trace without further preparation.
"""

from collections.abc import Mapping
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.lift import Lift, permitted_steps, steps_at_borders
from camopt.scene.response import Response
from camopt.scene.shapes import Float
from camopt.scene.train import LAW_PARAMETERS, Train
from camopt.smooth.contact import Layer
from camopt.smooth.grid import LARGEST_PHASE, equal_grid
from camopt.smooth.metrics import at_angle, revolution_metrics
from camopt.smooth.rest import rest_of
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import EPS, LIFT_SAMPLES, STEPS, response_arrays
from camopt.smooth.system import System, SystemState, build_system


def system_with(train: Train, parameters: Mapping[str, jax.Array]) -> System:
    """The system of a train, in which the numbers that `parameters` holds take the place of the train's own."""
    system = build_system(train)
    names = [name for name in train.parameters if name in parameters]
    values = [jnp.asarray(parameters[name], system.mass.dtype) for name in names]
    return eqx.tree_at(lambda s: [getattr(s.laws if n in LAW_PARAMETERS else s, n) for n in names], system, values)


def samples_of_pieces(
    borders, coefficients: Float[jax.Array, "p q"], steps: int = LIFT_SAMPLES
) -> Float[jax.Array, "{steps}+1 2"]:
    """As `lift_samples`, of polynomial pieces with coefficients [m/rad^k] between `borders` (p + 1) [rad].

    Derivatives by the borders take lift and velocity to be continuous across them.
    """
    theta, borders = jnp.asarray(equal_grid(steps)), jnp.asarray(borders)
    piece = jnp.clip(jnp.searchsorted(borders, theta, side="right") - 1, 0, len(borders) - 2)
    powers = (theta - borders[piece])[:, None] ** np.arange(coefficients.shape[1])
    order = np.arange(1, coefficients.shape[1])
    own = coefficients[piece]
    return jnp.stack([jnp.sum(own * powers, 1), jnp.sum(own[:, 1:] * (order * powers[:, :-1]), 1)], axis=-1)


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

    `parameters` maps names of `train.parameters` to arrays of their shapes, "lift" to the coefficients of the
    cam's pieces (p, q) [m/rad^k], "borders" to these pieces' (p + 1) [rad], "half_duration" to a number [rad]; what is
    left out is the train's and the cam's. `cam_speed` [rad/s] may be traced, and steps are offered for the `slowest`
    that it may be. The contacts' layer is `eps` [m] wide. The record's arrays are JAX arrays.
    A motion that the `allowed_steps` do not resolve is NaN, and one under pieces that do not join.
    """
    own = {name: jnp.asarray(value, float) for name, value in parameters.items()}
    pieces, borders = own.get("lift", lift.coefficients), own.get("borders", lift.borders)
    cam = pieces, borders, own.get("half_duration", lift.half_duration), permitted_steps(lift)
    settings = {"revolutions": revolutions, "steps": steps, "most": allowed_steps(train, slowest)}
    foot = int(np.argmin(np.abs(lift.borders - lift.opening_foot)))
    motion, metrics = _motion(system_with(train, own), *cam, cam_speed, eps, foot=foot, **settings)
    return Response(train, cam_speed, regular_angles(revolutions, steps), *motion[1:5]), metrics


def allowed_steps(train: Train, slowest: float) -> int:
    """Steps offered per revolution: `STEPS`, doubled for slow speeds [rad/s] of stiff trains until half of them suffice
    for stability."""
    with jax.ensure_compile_time_eval():
        least = 2 * np.pi / slowest * float(build_system(train).stiffest()) / LARGEST_PHASE
    return STEPS * 2 ** max(0, int(np.ceil(np.log2(2 * least / STEPS))))


def regular_angles(revolutions: int, steps: int) -> np.ndarray:
    """Equally spaced angles (revolutions * steps + 1) [rad] of a record that begins at -pi."""
    return np.linspace(-np.pi, (2 * revolutions - 1) * np.pi, revolutions * steps + 1)


@partial(jax.jit, static_argnames=("foot", "revolutions", "steps", "most"))
def _motion(
    system: System, pieces, borders, half_duration, permitted, cam_speed, eps, *, foot, revolutions, steps, most
):
    """The motion at regular angles and its metrics, in one program that is kept on disk; NaN where the pieces step by
    more than is permitted. The border number `foot` is the opening foot."""
    joined = (steps_at_borders(borders, pieces) <= permitted).all()
    samples = jnp.where(joined, samples_of_pieces(borders, pieces), jnp.nan)
    driven = DrivenSystem(system, samples, cam_speed)
    motion = response_arrays(driven, rest_of(system), Layer(eps), revolutions=revolutions, steps=most)
    found = [
        revolution_metrics(system, motion, cam_speed, half_duration, borders[foot], r, Layer(eps).half_width)
        for r in range(revolutions - 1)
    ]
    metrics = {name: jnp.stack([f[name] for f in found]) for name in found[0]} if found else {}
    return regular(motion, cam_speed, regular_angles(revolutions, steps)), metrics


def regular(motion: SystemState, cam_speed, angle: np.ndarray) -> SystemState:
    """The motion at the angles `angle` [rad]; between samples positions are cubics, velocities and forces linear."""
    theta = jnp.asarray(angle)

    def linear(values):
        return jax.vmap(lambda q: at_angle(motion.angle, q, theta), 1, 1)(values)

    def cubic(values, slope):
        return jax.vmap(lambda q, s: at_angle(motion.angle, q, theta, s), 1, 1)(values, slope)

    lift = linear(motion.lift[:, None])[:, 0]
    return SystemState(theta, lift, cubic(motion.x, motion.v / cam_speed), linear(motion.v), linear(motion.force))
