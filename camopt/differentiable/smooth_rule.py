"""`camopt.simulate(..., method="smooth", parameters=...)`: one motion as a function of the numbers of train and cam.

`parameters` is a dictionary of arrays, which JAX can differentiate by, batch and trace without further preparation.
"""

from collections.abc import Mapping
from functools import partial

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.response import Response
from camopt.scene.train import Train
from camopt.smooth.grid import LARGEST_PHASE, equal_grid
from camopt.smooth.metrics import at_angle, revolution_metrics
from camopt.smooth.rest import rest_state
from camopt.smooth.simulate import EPS, LIFT_SAMPLES, STEPS, TOLERANCE, response_arrays, touch_layer
from camopt.smooth.system import Motion, System, build_system

TRAIN_PARAMETERS = ("mass", "mass_damping", "mass_force", "stiffness", "damping", "preload", "gap")
"""Fields of `Train` that may be given. The stiffness of a hertz contact is its coefficient [N/m^exponent]."""


def system_with(train: Train, parameters: Mapping[str, jax.Array]) -> System:
    """The system of a train, in which the numbers that `parameters` holds take the place of the train's own."""
    system = build_system(train)
    names = [name for name in TRAIN_PARAMETERS if name in parameters]
    values = [jnp.asarray(parameters[name], system.mass.dtype) for name in names]
    return eqx.tree_at(lambda s: [getattr(s, name) for name in names], system, values)


def samples_of_pieces(borders: np.ndarray, coefficients: jax.Array, steps: int = LIFT_SAMPLES) -> jax.Array:
    """The samples of `lift_samples`, for pieces with coefficients (p, q) [m/rad^k] between `borders` (p + 1) [rad]."""
    theta = equal_grid(steps)
    piece = np.clip(np.searchsorted(borders, theta, side="right") - 1, 0, len(borders) - 2)
    powers = (theta - borders[piece])[:, None] ** np.arange(coefficients.shape[1])
    order = np.arange(1, coefficients.shape[1])
    own = coefficients[piece]
    return jnp.stack([jnp.sum(own * powers, 1), jnp.sum(own[:, 1:] * (order * powers[:, :-1]), 1)], axis=-1)


def differentiable_motion(
    train: Train, lift: Lift, parameters: Mapping[str, jax.Array], cam_speed, revolutions: int, steps: int
) -> tuple[Response, dict[str, jax.Array]]:
    """Motion from rest on `steps` equal steps per revolution, and the metrics of all revolutions but the last.

    `parameters` maps names of `TRAIN_PARAMETERS` to arrays of the train's shapes, and "lift" to the coefficients of
    the cam's pieces (p, q) [m/rad^k]. A name that is left out keeps the value of the train or the cam, and everything
    else about these two, such as the borders of the pieces, is fixed. `cam_speed` [rad/s] may be traced. The record's
    arrays are JAX arrays. A motion that the `allowed_steps` do not resolve is NaN.
    """
    system = system_with(train, parameters)
    pieces = jnp.asarray(parameters.get("lift", lift.coefficients), system.mass.dtype)
    samples = samples_of_pieces(lift.borders, pieces)
    numbers = lift.half_duration, lift.opening_foot
    y0, most = rest_state(train, system), allowed_steps(train, cam_speed)
    motion, metrics = _motion(system, samples, cam_speed, y0, numbers, revolutions, steps, most)
    return Response(train, cam_speed, regular_angles(revolutions, steps), *motion[1:5]), metrics


def allowed_steps(train: Train, cam_speed) -> int:
    """Number of steps offered per revolution.

    It is `STEPS`, doubled for stiff trains at slow speeds until half of the steps suffice for stability. A traced speed
    is assumed to be one at which `STEPS` suffice.
    """
    if isinstance(cam_speed, jax.core.Tracer):
        return STEPS
    with jax.ensure_compile_time_eval():
        least = 2 * np.pi / float(cam_speed) * float(build_system(train).stiffest()) / LARGEST_PHASE
    return STEPS * 2 ** max(0, int(np.ceil(np.log2(2 * least / STEPS))))


def regular_angles(revolutions: int, steps: int) -> np.ndarray:
    """Equally spaced angles (revolutions * steps + 1) [rad] of a record that begins at -pi."""
    return np.linspace(-np.pi, (2 * revolutions - 1) * np.pi, revolutions * steps + 1)


@partial(jax.jit, static_argnames=("revolutions", "steps", "most"))
def _motion(system, samples, cam_speed, y0, numbers, revolutions: int, steps: int, most: int):
    half_duration, opening_foot = numbers
    motion = response_arrays(system, samples, cam_speed, y0, EPS, TOLERANCE, revolutions=revolutions, steps=most)
    found = [
        revolution_metrics(system, motion, cam_speed, half_duration, opening_foot, r, touch_layer(EPS))
        for r in range(revolutions - 1)
    ]
    metrics = {name: jnp.stack([f[name] for f in found]) for name in found[0]} if found else {}
    return regular(motion, cam_speed, regular_angles(revolutions, steps)), metrics


def regular(motion: Motion, cam_speed, angle: np.ndarray) -> Motion:
    """The motion at the angles `angle` [rad]; between samples positions are cubics, velocities and forces linear."""
    theta = jnp.asarray(angle)

    def linear(values):
        return jax.vmap(lambda q: at_angle(motion.angle, q, theta), 1, 1)(values)

    def cubic(values, slope):
        return jax.vmap(lambda q, s: at_angle(motion.angle, q, theta, s), 1, 1)(values, slope)

    lift = linear(motion.lift[:, None])[:, 0]
    return Motion(theta, lift, cubic(motion.x, motion.v / cam_speed), linear(motion.v), linear(motion.force))
