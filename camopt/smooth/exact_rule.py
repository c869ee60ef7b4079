"""The JAX rule of the exact path: `jax.grad`, `jax.jit` and `jax.vmap` through event-exact motions.

The motion is computed outside JAX. A batch takes one host call, in which its motions run side by side in threads;
derivatives come from their discrete adjoint. The rule is here and not in `camopt.exact`, because the verifier's verdict
imports `camopt.exact` and must not load JAX.

A motion that cannot be computed is NaN throughout, and so are its derivatives. That happens if there is no rest, if the
motion switches endlessly or has no bound, if a number is not finite, if a mass, stiffness, leak or slip is not
positive, or if the compressions of a table do not ascend.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import prod
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero

from camopt.cam.lift import Lift
from camopt.exact.adjoint.metrics import METRICS
from camopt.exact.adjoint.motion import Samples, metric_numbers
from camopt.scene.errors import InputError
from camopt.scene.response import Response
from camopt.scene.shapes import Float
from camopt.scene.train import Train
from camopt.smooth.grid import regular_angles
from camopt.smooth.varying_motion import CAM_PARAMETERS, Arrays, Varying

SLOWER = 100.0
"""Ratio of the slowest expected speed to a traced one above which the motion is not computed."""
WORKERS = os.cpu_count() or 1


def exact_metrics(
    train: Train,
    lift: Lift,
    cam_speed,
    parameters: Mapping[str, Any],
    metrics: Sequence[str],
    *,
    revolutions: int = 1,
    revolution: int = 0,
    spacing: float | None = None,
) -> Float[jax.Array, " l"]:
    """Values of metrics in one revolution of an event-exact motion, in the units of their names.

    `parameters` replaces numbers by arrays that JAX may trace: of the train by the names of `train.parameters`, "lift"
    (p, q) [m/rad^k] and "borders" (p + 1) [rad] of the cam's pieces, "half_duration" [rad], and "start" (2n + r: [m],
    [m/s], [m]), the state at -pi, by default rest. `cam_speed` [rad/s] may be traced. Derivatives by the borders assume
    that lift and velocity are continuous across them, and that the opening foot does not end a hop. `spacing` [rad] is
    as in `TracedMotion`, for batches of many cams at few speeds.

    The values cost one motion. Values with their gradients by the cam cost one motion and one backward sweep per
    metric. Raises InputError for an unknown metric or an unknown parameter.
    """
    motion, variables = _varying(train, lift, cam_speed, parameters, revolutions, spacing)
    metric_numbers(train, metrics)
    rows = np.zeros(len(metrics))

    def on_host(numbers: Arrays) -> np.ndarray:
        traced = motion.trace(numbers, ())
        return np.full_like(rows, np.nan) if traced is None else traced.values(metrics, revolution)

    def with_slopes(numbers: Arrays, names: tuple[str, ...]) -> tuple[np.ndarray, Arrays]:
        traced = motion.trace(numbers, names)
        if traced is None:
            return np.full_like(rows, np.nan), {n: np.full((len(rows), *numbers[n].shape), np.nan) for n in names}
        return motion.swept(names, numbers, traced, tuple(metrics), revolution)

    @jax.custom_vjp
    def values(variables):
        return host_call(on_host, rows, variables)

    def forward(variables):
        numbers, names = _perturbed(variables)
        slopes = {name: np.zeros((len(rows), *numbers[name].shape)) for name in names}
        return host_call(lambda n: with_slopes(n, names), (rows, slopes), numbers)

    def backward(slopes, bar):
        zero = isinstance(bar, SymbolicZero)
        weighed = {} if zero else {name: weighted(bar, slope) for name, slope in slopes.items()}
        return ({name: weighed.get(name) for name in variables},)

    values.defvjp(forward, backward, symbolic_zeros=True)
    return values(variables)


def differentiable_motion(
    train: Train,
    lift: Lift,
    parameters: Mapping[str, Any],
    cam_speed,
    revolutions: int,
    steps: int,
    slowest: float,
) -> tuple[Response, dict[str, jax.Array]]:
    """Motion from rest on `steps` equal steps per revolution, and the metrics of all revolutions but the last.

    Arguments are those of `exact_metrics`, and the record's arrays are JAX arrays. A derivative costs the motion a
    second time and one sweep per revolution. A motion at less than a hundredth of the `slowest` speed [rad/s] is NaN,
    because it would take hours.
    """
    motion, variables = _varying(train, lift, cam_speed, parameters, revolutions, least_speed=slowest / SLOWER)
    names = () if train.seat < 0 or not train.cam_side else tuple(METRICS)
    angle = regular_angles(revolutions, steps)
    recorded = _Recorded(motion, names, revolutions - 1, angle)
    shape = recorded.shape

    @jax.custom_vjp
    def moved(variables):
        return host_call(recorded.record, shape, variables)

    def forward(variables):
        numbers, wanted = _perturbed(variables)
        return host_call(recorded.record, shape, numbers), (numbers, dict.fromkeys(wanted, 0.0))

    def backward(residuals, bars):
        numbers, wanted = residuals[0], tuple(residuals[1])
        bars = jax.tree.map(lambda bar: jnp.zeros(bar.shape) if isinstance(bar, SymbolicZero) else bar, bars)
        slopes = host_call(lambda n, b: recorded.slopes(n, b, wanted), {k: numbers[k] for k in wanted}, numbers, bars)
        return ({name: slopes.get(name) for name in variables},)

    moved.defvjp(forward, backward, symbolic_zeros=True)
    samples, values = moved(variables)
    record = {name: samples[name] for name in ("lift", "x", "v", "force", "memory")}
    response = Response(train, cam_speed, angle, **record)
    return response, dict(zip(names, values, strict=True))


@dataclass(frozen=True)
class _Recorded:
    """A varying motion sampled at angles (k) [rad], with the metrics of its first `measured` revolutions."""

    motion: Varying
    metrics: tuple[str, ...]
    measured: int
    angle: np.ndarray

    @property
    def shape(self):
        """A tree of zeros with the shapes of a record."""
        n, e, r = len(self.motion.train.mass), len(self.motion.train.a), len(self.motion.train.memory)
        samples = Samples(*(np.zeros((len(self.angle), *shape)) for shape in ((n,), (n,), (), (), (e,), (r,))))
        return vars(samples), np.zeros((len(self.metrics), self.measured))

    def record(self, numbers: Arrays):
        """The samples by name, and the metrics (l, measured); NaN if the motion cannot be computed."""
        traced = self.motion.trace(numbers, ())
        if traced is None:
            return jax.tree.map(lambda array: np.full_like(array, np.nan), self.shape)
        rows = [traced.values(self.metrics, r) for r in range(self.measured)]
        return vars(traced.at(self.angle)), np.array(rows).reshape(self.measured, len(self.metrics)).T

    def slopes(self, numbers: Arrays, bars, wanted: tuple[str, ...]) -> Arrays:
        """Slopes, by the wanted numbers, of the sum of all recorded values times their weights `bars`."""
        traced = self.motion.trace(numbers, wanted)
        if traced is None:
            return {name: np.full_like(numbers[name], np.nan) for name in wanted}
        by_samples, by_metrics = bars
        terms = [
            self.motion.swept(wanted, numbers, traced, self.metrics, r, by_metrics[:, r])[1]
            for r in range(self.measured)
            if np.any(by_metrics[:, r])
        ]
        if any(np.any(bar) for bar in by_samples.values()):
            samples = vars(traced.at(self.angle))
            moving = np.array([sum(np.sum(by_samples[name] * samples[name]) for name in ("v", "lift_rate"))])
            weights = Samples(**{name: bar[None] for name, bar in by_samples.items()})
            slopes = traced.pull_back(self.angle, weights)
            terms.append(self.motion.by_names(wanted, numbers, traced, slopes, moving, np.zeros(1)))
        return {name: sum((term[name][0] for term in terms), np.zeros_like(numbers[name])) for name in wanted}


def weighted(bar: Float[jax.Array, " l"], slope: Float[jax.Array, " l *shape"]) -> Float[jax.Array, " *shape"]:
    """Sum of the slopes times their weights `bar`, without slopes of weight zero, which may be NaN."""
    bar = jnp.reshape(bar, (len(bar), *(1,) * (slope.ndim - 1)))
    return jnp.sum(jnp.where(bar == 0.0, 0.0, bar * slope), 0)


def host_call(function: Callable, result: Any, *args: Any) -> Any:
    """Calls a `function` of NumPy arrays, which returns a tree like `result`, from JAX.

    Under `vmap` it is still one call, whose rows run in threads.
    """
    shapes = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(np.shape(leaf), jnp.float64), result)
    ranks = [np.ndim(leaf) for leaf in jax.tree.leaves(args)]

    def many(*args):
        leaves, tree = jax.tree.flatten(args)
        arrays = [np.array(leaf, dtype=float) for leaf in leaves]  # writable, as compiled functions require
        batch = arrays[0].shape[: arrays[0].ndim - ranks[0]]
        count = prod(batch)
        rows = [a.reshape(count, *a.shape[len(batch) :]) for a in arrays]

        def call(i: int):
            return function(*jax.tree.unflatten(tree, [row[i] for row in rows]))

        if count == 1:
            results = [call(0)]
        else:
            with ThreadPoolExecutor(WORKERS) as pool:
                results = list(pool.map(call, range(count)))
        return jax.tree.map(
            lambda *leaves: np.reshape(np.array(leaves, dtype=float), (*batch, *np.shape(leaves[0]))), *results
        )

    return jax.pure_callback(many, shapes, *args, vmap_method="broadcast_all")


def _varying(train: Train, lift: Lift, cam_speed, parameters, revolutions: int, spacing=None, least_speed=0.0):
    """The motion, and the variables by name; raises InputError for an unknown parameter."""
    names = (*train.parameters, *CAM_PARAMETERS, "start")
    unknown = [name for name in parameters if name not in names]
    if unknown:
        raise InputError(f"event-exact: parameter {', '.join(unknown)}: expected one of {', '.join(names)}")
    variables = {name: jnp.asarray(value, float) for name, value in parameters.items()}
    motion = Varying(train, lift, revolutions, spacing, least_speed)
    return motion, variables | {"cam_speed": jnp.asarray(cam_speed, float)}


def _perturbed(variables) -> tuple[dict[str, jax.Array], tuple[str, ...]]:
    """The values of the variables in a forward rule, and the names of those by which JAX differentiates."""
    names = tuple(name for name, variable in variables.items() if variable.perturbed)
    return {name: variable.value for name, variable in variables.items()}, names
