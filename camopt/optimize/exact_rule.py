"""The JAX rule of the exact path: `jax.grad`, `jax.jit` and `jax.vmap` through event-exact motions.

The motion runs outside JAX, in one host call whatever is batched: its motions side by side in threads, derivatives by
their discrete adjoint. The rule stands here and not in `camopt.exact`, which the verifier's verdict imports and which
therefore knows no JAX.

Speed: with r = speed / speed', masses times r^2 and dampings times r move through the same positions and forces by
angle at speed', at velocities divided by r. So derivatives by the speed are those by masses and dampings.

A motion that cannot be followed (no rest, endless switching, no bound, numbers that are not finite or a mass or
stiffness that is not positive) is NaN throughout, its derivatives too.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero

from camopt.cam.lift import Lift
from camopt.exact.gradient import rest_back, rest_state
from camopt.exact.metrics import METRICS
from camopt.exact.motion import ByTrain, Samples, Slopes, TracedMotion, metric_numbers
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.response import Response
from camopt.scene.train import Train

jax.config.update("jax_enable_x64", True)

TRAIN_PARAMETERS = tuple(field.name for field in fields(ByTrain))
POSITIVE = ("mass", "stiffness", "cam_speed")
VELOCITY = "m_per_s"
"""How the names of metrics end that grow with all velocities."""
WORKERS = os.cpu_count() or 1
Arrays = dict[str, np.ndarray]


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
) -> jax.Array:
    """Values (l) of metrics in one revolution of an event-exact motion, in the units of their names.

    `parameters` replaces numbers by arrays that JAX may trace: of the train under the names of `ByTrain`, "lift"
    (p, q) [m/rad^k] and "borders" (p + 1) [rad] of the cam's pieces, "start" (2n: [m], then [m/s]), the state at -pi,
    which is rest where it is left out. `cam_speed` [rad/s] may be traced too. Derivatives by the borders take lift and
    velocity to be continuous across them, and the ends of the duration and the opening foot to stay. `spacing` [rad] as
    of `TracedMotion`, for batches of many cams at few speeds.

    The value costs one motion, values with their gradients by the cam one motion and one sweep back per metric.
    Raises InputError for an unknown metric, an unknown parameter or laws that are not linear.
    """
    motion, variables = _varying(train, lift, cam_speed, parameters, revolutions, spacing)
    metric_numbers(train, metrics)
    rows = np.zeros(len(metrics))
    speeds = np.array([name.endswith(VELOCITY) for name in metrics])

    def value(given: Arrays):
        traced = motion.trace(given, ())
        return np.full_like(rows, np.nan) if traced is None else traced.values(metrics, revolution)

    def value_and_slopes(given: Arrays, names: tuple[str, ...]):
        traced = motion.trace(given, names)
        if traced is None:
            return np.full_like(rows, np.nan), {n: np.full((len(rows), *given[n].shape), np.nan) for n in names}
        found, swept = traced.swept(metrics, revolution)
        slopes = motion.by_names(names, given, traced, swept, found[:, 0] * speeds)
        for slope in slopes.values():
            slope[np.isnan(found[:, 0])] = np.nan
        return found[:, 0], slopes

    @jax.custom_vjp
    def values(variables):
        return host_call(value, rows, variables)

    def forward(variables):
        given, names = _perturbed(variables)
        slopes = {name: np.zeros((len(rows), *given[name].shape)) for name in names}
        return host_call(lambda g: value_and_slopes(g, names), (rows, slopes), given)

    def backward(slopes, bar):
        zero = isinstance(bar, SymbolicZero)
        found = {} if zero else {name: weighted(bar, slope) for name, slope in slopes.items()}
        return ({name: found.get(name) for name in variables},)

    values.defvjp(forward, backward, symbolic_zeros=True)
    return values(variables)


def differentiable_motion(
    train: Train, lift: Lift, parameters: Mapping[str, Any], cam_speed, revolutions: int, steps: int
) -> tuple[Response, dict[str, jax.Array]]:
    """Motion from rest on `steps` equal steps per revolution, and the metrics of all revolutions but the last.

    Arguments as of `exact_metrics`; what is differentiated by costs the motion a second time and a sweep per
    revolution. The record's arrays are JAX arrays.
    """
    motion, variables = _varying(train, lift, cam_speed, parameters, revolutions)
    names = [] if train.seat < 0 or not train.cam_side else list(METRICS)
    n, e, measured = len(train.mass), len(train.a), revolutions - 1
    speeds = np.array([name.endswith(VELOCITY) for name in names], dtype=bool)
    angle = np.linspace(-np.pi, (2 * revolutions - 1) * np.pi, revolutions * steps + 1)
    samples = Samples(*(np.zeros((len(angle), *shape)) for shape in ((n,), (n,), (), (), (e,))))
    shape = vars(samples), np.zeros((len(names), measured))

    def record(given: Arrays):
        traced = motion.trace(given, ())
        if traced is None:
            return jax.tree.map(lambda part: np.full_like(part, np.nan), shape)
        rows = [traced.values(names, r) for r in range(measured)]
        return vars(traced.at(angle)), np.array(rows).reshape(measured, len(names)).T

    def slopes(given: Arrays, bars, wanted: tuple[str, ...]):
        traced = motion.trace(given, wanted)
        if traced is None:
            return {name: np.full_like(given[name], np.nan) for name in wanted}
        by_samples, by_metrics = bars
        total = {name: np.zeros_like(given[name]) for name in wanted}

        def add(part: Slopes, moving: float) -> None:
            for name, slope in motion.by_names(wanted, given, traced, part, np.array([moving])).items():
                total[name] = total[name] + (slope[0] if np.isfinite(moving) else np.nan)

        if any(np.any(bar) for bar in by_samples.values()):
            found = vars(traced.at(angle))
            moving = sum(float(np.sum(by_samples[k] * found[k])) for k in ("v", "lift_rate"))
            add(traced.pull_back(angle, Samples(**{k: bar[None] for k, bar in by_samples.items()})), moving)
        for r in range(measured):
            bar = by_metrics[:, r]
            if np.any(bar):
                found, swept = traced.swept(names, r, bar)
                moving = sum(b * v for b, v in zip(bar[speeds], found[speeds, 0], strict=True) if b)
                add(swept, np.nan if np.any(np.isnan(found[bar != 0, 0])) else moving)
        return total

    @jax.custom_vjp
    def moved(variables):
        return host_call(record, shape, variables)

    def forward(variables):
        given, wanted = _perturbed(variables)
        return host_call(record, shape, given), (given, dict.fromkeys(wanted, 0.0))

    def backward(kept, bars):
        given, wanted = kept[0], tuple(kept[1])
        bars = jax.tree.map(lambda bar: jnp.zeros(bar.shape) if isinstance(bar, SymbolicZero) else bar, bars)
        found = host_call(lambda g, b: slopes(g, b, wanted), {k: given[k] for k in wanted}, given, bars)
        return ({name: found.get(name) for name in variables},)

    moved.defvjp(forward, backward, symbolic_zeros=True)
    found, values = moved(variables)
    response = Response(train, cam_speed, angle, found["lift"], found["x"], found["v"], found["force"])
    return response, dict(zip(names, values, strict=True))


@dataclass(frozen=True)
class Varying:
    """A motion of which JAX varies some numbers: what it keeps."""

    train: Train
    lift: Lift
    revolutions: int
    spacing: float | None

    def trace(self, given: Arrays, names: tuple[str, ...]) -> TracedMotion | None:
        """The motion under given numbers, to be differentiated by `names`; None where it cannot be followed."""
        if not all(np.all(np.isfinite(v)) and (k not in POSITIVE or np.all(v > 0)) for k, v in given.items()):
            return None
        changes = tuple((name, given[name].tobytes()) for name in TRAIN_PARAMETERS if name in given)
        cam = {"borders": given.get("borders", self.lift.borders), "coefficients": given.get("lift")}
        lift = replace(self.lift, **{name: value for name, value in cam.items() if value is not None})
        train, speed, mechanical = varied(self.train, changes), float(given["cam_speed"]), bool({*names} & MECHANICAL)
        try:
            start = given["start"] if "start" in given else rest(train)
            return TracedMotion(train, lift, speed, start, self.revolutions, mechanical, self.spacing)
        except (MotionRefused, InputError):  # no bound, endless switching; no rest
            return None

    def by_names(
        self, names: tuple[str, ...], given: Arrays, motion: TracedMotion, slopes: Slopes, moving: np.ndarray
    ) -> Arrays:
        """Gradients (l, ...) by each of the names; `moving` (l) is what of the numbers grows with all velocities."""
        by_train, found = deepcopy(slopes.by_train), {}  # the slopes stay as they are: they may be read again
        if by_train is not None and "start" not in given:
            by_train.add(rest_back(motion.train, slopes.by_start))
        for name in names:
            if name == "lift":
                found[name] = slopes.by_coefficients
            elif name == "borders":
                found[name] = by_borders(motion.lift, slopes.by_coefficients)
            elif name == "start":
                found[name] = slopes.by_start
            elif name == "cam_speed":
                found[name] = by_speed(motion, slopes, given.get("start")) + moving / motion.cam_speed
            else:
                found[name] = getattr(by_train, name)
        return found


MECHANICAL = {*TRAIN_PARAMETERS, "cam_speed"}
"""Variables whose gradients need the sweep over the train's parameters."""


def by_borders(lift: Lift, by_coefficients: np.ndarray) -> np.ndarray:
    """Gradients (l, p + 1) by the borders, where lift and velocity are continuous: a piece moves with its start."""
    derivative = np.arange(1, lift.coefficients.shape[1]) * lift.coefficients[:, 1:]
    starts = -np.sum(by_coefficients[:, :, :-1] * derivative, axis=2)
    return np.concatenate([starts, np.zeros((len(starts), 1))], axis=1)


def by_speed(motion: TracedMotion, slopes: Slopes, start: np.ndarray | None) -> np.ndarray:
    """Gradients (l) by the cam speed through masses, dampings and the start's velocities."""
    by_train, train = slopes.by_train, motion.train
    assert by_train is not None
    total = 2 * by_train.mass @ train.mass + by_train.mass_damping @ train.mass_damping
    total = total + by_train.damping @ train.damping
    if start is not None:
        n = len(train.mass)
        total = total - slopes.by_start[:, n:] @ start[n:]
    return total / motion.cam_speed


def weighted(bar: jax.Array, slope: jax.Array) -> jax.Array:
    """Sum of slopes (l, ...) times bar (l), of those whose weight is not zero: the others may be NaN."""
    bar = jnp.reshape(bar, (len(bar), *(1,) * (slope.ndim - 1)))
    return jnp.sum(jnp.where(bar == 0.0, 0.0, bar * slope), 0)


@lru_cache(maxsize=24)
def varied(train: Train, changes: tuple[tuple[str, bytes], ...]) -> Train:
    """A train with other numbers: the same object for the same numbers, because propagators are kept per train."""
    return replace(train, **{name: np.frombuffer(data).copy() for name, data in changes}) if changes else train


rest = lru_cache(maxsize=24)(rest_state)


def host_call(function: Callable, result: Any, *args: Any) -> Any:
    """`function` of NumPy arrays (a tree like `result`) as one JAX call; under `vmap` it still is one, its rows in
    threads."""
    shapes = jax.tree.map(lambda part: jax.ShapeDtypeStruct(np.shape(part), jnp.float64), result)
    ranks = [np.ndim(leaf) for leaf in jax.tree.leaves(args)]

    def many(*args):
        leaves, tree = jax.tree.flatten(args)
        arrays = [np.array(leaf, dtype=float) for leaf in leaves]  # writable: compiled for such
        batch = arrays[0].shape[: arrays[0].ndim - ranks[0]]
        rows = [a.reshape(-1, *a.shape[len(batch) :]) for a in arrays]

        def one(i: int):
            return function(*jax.tree.unflatten(tree, [row[i] for row in rows]))

        count = len(rows[0])
        if count == 1:
            found = [one(0)]
        else:
            with ThreadPoolExecutor(WORKERS) as pool:
                found = list(pool.map(one, range(count)))
        return jax.tree.map(
            lambda *parts: np.reshape(np.array(parts, dtype=float), (*batch, *np.shape(parts[0]))), *found
        )

    return jax.pure_callback(many, shapes, *args, vmap_method="broadcast_all")


def _varying(train: Train, lift: Lift, cam_speed, parameters: Mapping[str, Any], revolutions: int, spacing=None):
    """(what is kept, what varies); raises InputError for laws that are not linear or an unknown parameter."""
    train.require_linear("event-exact", 'simulate with method "smooth"')
    known = (*TRAIN_PARAMETERS, "lift", "borders", "start")
    unknown = [name for name in parameters if name not in known]
    if unknown:
        raise InputError(f"event-exact: parameter {', '.join(unknown)}: expected one of {', '.join(known)}")
    variables = {name: jnp.asarray(value, float) for name, value in parameters.items()}
    return Varying(train, lift, revolutions, spacing), variables | {"cam_speed": jnp.asarray(cam_speed, float)}


def _perturbed(variables) -> tuple[dict[str, jax.Array], tuple[str, ...]]:
    """Values of variables in a forward rule, and the names of those that are differentiated by."""
    names = tuple(name for name, variable in variables.items() if variable.perturbed)
    return {name: variable.value for name, variable in variables.items()}, names
