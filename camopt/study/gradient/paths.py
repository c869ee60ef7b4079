"""The quantities compared by `camopt gradient`: the metrics and their gradients with respect to bumps on a cam.

Every path covers two revolutions from one state; the metrics of the first have windows that extend into the second.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import BSpline, PPoly

from camopt.cam.lift import Lift
from camopt.cam.polynomials import recentred
from camopt.exact.adjoint import metrics as exact_metrics
from camopt.exact.adjoint.motion import Gradient, TracedMotion, value_and_gradient
from camopt.exact.engine import prepare as prepare_event
from camopt.measure.metrics import measure
from camopt.scene import QUANTITIES, Scene, Train, build_train, state_at_rest
from camopt.scene.response import record_of
from camopt.scene.shapes import Float
from camopt.smooth.laws import Layer
from camopt.smooth.metrics import revolution_metrics
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import MOST_GRID_STEPS, TOLERANCE, lift_samples, response_arrays
from camopt.smooth.system import build_system, stacked
from camopt.study.measurements import fastest
from camopt.verifier.methods.dop853 import prepare as prepare_dop853

DEGREE = 5
SAME = 1e-9
"""Distance [rad] within which a knot of a bump is moved onto a border of the cam's pieces."""


def with_bumps(lift: Lift, count: int) -> tuple[Lift, Float[np.ndarray, "count p q"]]:
    """The cam on the union of its pieces with those of `count` bumps, 1 or more, and the bumps as changes of its
    coefficients [m/rad^k] per metre of height. The bumps are quintic B-splines of height 1 on equal knots over the
    duration, each six intervals wide and zero outside, so that ramps and feet do not change."""
    knots = np.linspace(-lift.half_duration, lift.half_duration, count + DEGREE + 1)
    nearest = lift.borders[np.argmin(np.abs(lift.borders[:, None] - knots), axis=0)]
    knots = np.where(np.abs(nearest - knots) < SAME, nearest, knots)
    edges = np.concatenate([[-np.pi], knots, [np.pi]])
    flat = Lift(edges, np.zeros((len(edges) - 1, DEGREE + 1)), lift.half_duration)
    whole = lift.shifted(flat)
    piece = np.searchsorted(edges, 0.5 * (whole.borders[1:] + whole.borders[:-1])) - 1
    bumps = [recentred(_bump(flat, i), piece, whole.borders[:-1]) for i in range(count)]
    missing = whole.coefficients.shape[1] - DEGREE - 1
    return whole, np.pad(np.array(bumps), ((0, 0), (0, 0), (0, missing)))


def moved(lift: Lift, directions: Float[np.ndarray, "m p q"], heights: Float[np.ndarray, " m"]) -> Lift:
    """The cam with the changes `directions` of its coefficients, multiplied by `heights` [m], added."""
    return replace(lift, coefficients=lift.coefficients + np.tensordot(heights, directions, 1))


def _bump(flat: Lift, i: int) -> Lift:
    """The i-th bump on the pieces of `flat`, the first and last of which lie outside the knots."""
    knots = flat.borders[1 + i : 3 + i + DEGREE]
    spline = BSpline.basis_element(knots)
    pieces = PPoly.from_spline(spline.tck)
    inside = [int(np.searchsorted(pieces.x, left, "right")) - 1 for left in knots[:-1]]
    rows = np.zeros_like(flat.coefficients)
    rows[1 + i : 2 + i + DEGREE] = pieces.c[::-1, inside].T / spline(0.5 * (knots[0] + knots[-1]))
    return replace(flat, coefficients=rows)


METRICS = tuple(name for name in exact_metrics.METRICS if name in QUANTITIES)
"""The declared metrics for which both paths have gradients."""
REVOLUTIONS = 2
SETTLED = 1e-6, 1e-3
"""Largest change of positions [m] and velocities [m/s] over a revolution of a settled motion."""
MOST_SETTLING, FOLLOWING = 40, 4
"""Most revolutions for settling; revolutions after them, whose gradients are compared if the motion has not settled."""
SAMPLES = 2880
"""Samples per revolution of DOP853, with which its permitted error is 1e-8 of the motion."""
FIRST_STEPS = 8192
"""First number of steps per revolution allowed to the smooth path."""
REPEATS = 3
"""Number of timed runs, of which the fastest counts."""


@dataclass(frozen=True)
class Problem:
    """A cam with m bumps in a train at one speed, and the common initial state of all motions."""

    train: Train
    lift: Lift
    directions: np.ndarray  # (m, p, q)
    cam_speed: float  # rad/s
    start: np.ndarray  # (2n + r) at -pi; it does not depend on the bumps
    settled: bool


def problem(scene: Scene, lift: Lift, speed_rpm: float, bumps: int) -> Problem:
    """The problem of a cam with a number of bumps at one crankshaft speed [r/min].

    It starts from the periodic state, or from the state after `MOST_SETTLING` revolutions from rest. Raises
    MotionRefused and InputError where the methods do.
    """
    train, cam_speed = build_train(scene), scene.cam_speed(speed_rpm)
    whole, directions = with_bumps(lift, bumps)
    advance = prepare_event(train, whole, cam_speed).advance
    allowed = np.concatenate([np.repeat(SETTLED, len(train.mass)), np.repeat(SETTLED[0], len(train.memory))])
    state, settled, turns = state_at_rest(train), False, 0
    while not settled and turns < MOST_SETTLING:
        last, state, turns = state, advance(state), turns + 1
        settled = bool(np.all(np.abs(state - last) < allowed))
    return Problem(train, whole, directions, cam_speed, state, settled)


def true_values(p: Problem, heights: np.ndarray) -> np.ndarray:
    """METRICS (l) with bumps of these heights (m) [m], by event-exact, or by DOP853 where a law is curved."""
    lift = moved(p.lift, p.directions, heights)
    if p.train.straight:
        return TracedMotion(p.train, lift, p.cam_speed, p.start, REVOLUTIONS).values(METRICS)
    metrics = measure(record_of(prepare_dop853(p.train, lift, p.cam_speed, SAMPLES), p.start, REVOLUTIONS), lift)
    return np.array([metrics[name][0] for name in METRICS])


@dataclass(frozen=True)
class PathGradients:
    """Values (l) and gradients (l, m) of METRICS [unit, unit per m], and their cost ratios (l)."""

    values: np.ndarray
    gradients: np.ndarray
    cost_ratio: np.ndarray  # time of value and gradient over time of the value


def exact_gradients(p: Problem) -> tuple[PathGradients, Gradient]:
    """Values and gradients of the exact path by its adjoint, and the joint gradient of all metrics with its grazing.

    Times are processor times of one thread, which other work on the machine does not affect.
    """
    together, gradients = _bump_gradients(p, p.start)
    ratio = []
    for name in METRICS:
        motion = partial(TracedMotion, p.train, p.lift, p.cam_speed, p.start, REVOLUTIONS)
        gradient = partial(value_and_gradient, p.train, p.lift, p.cam_speed, [name], p.start, revolutions=REVOLUTIONS)
        value, _ = fastest(lambda motion=motion, name=name: motion().values([name]), REPEATS, first=False)
        both, _ = fastest(gradient, REPEATS, first=False)
        ratio.append(both / value)
    return PathGradients(together.values, gradients, np.array(ratio)), together


def _bump_gradients(p: Problem, start: np.ndarray) -> tuple[Gradient, np.ndarray]:
    """The exact gradient of METRICS from a state, and its components along the bumps (l, m)."""
    together = value_and_gradient(p.train, p.lift, p.cam_speed, METRICS, start, revolutions=REVOLUTIONS)
    return together, np.einsum("lpq,mpq->lm", together.by_coefficients, p.directions)


def smooth_gradients(p: Problem) -> Callable[[float], PathGradients]:
    """Values and gradients of the smooth path by eps [m], from two compiled programs; NaN where the path fails."""
    wall_seconds = partial(fastest, clock=time.perf_counter, first=False)
    system, base = build_system(p.train), jnp.asarray(lift_samples(p.lift))
    units = np.eye(len(p.directions))
    bumped = np.stack([lift_samples(moved(p.lift, p.directions, e)) for e in units], axis=-1)
    parts = bumped - np.asarray(base)[..., None]
    shape, y0 = (p.lift.half_duration, p.lift.opening_foot), stacked(p.start, len(p.train.mass))

    def metrics(heights, eps, steps: int):
        driven = DrivenSystem(system, base + jnp.asarray(parts) @ heights, p.cam_speed)
        motion = response_arrays(driven, y0, Layer(eps), TOLERANCE, revolutions=REVOLUTIONS, steps=steps)
        values = revolution_metrics(system, motion, p.cam_speed, *shape, layer=Layer(eps).half_width)
        return jnp.stack([values[name] for name in METRICS])

    values_of = jax.jit(metrics, static_argnames="steps")
    both_of = jax.jit(
        jax.value_and_grad(lambda heights, eps, i, steps: metrics(heights, eps, steps)[i]), static_argnames="steps"
    )
    flat, steps = jnp.zeros(len(units)), FIRST_STEPS

    def run(eps: float) -> PathGradients:
        nonlocal steps
        while not jnp.isfinite(values_of(flat, eps, steps=steps)[-1]) and steps < MOST_GRID_STEPS:  # the dynamic area
            steps *= 4
        jax.block_until_ready(both_of(flat, eps, 0, steps=steps))  # compiles
        value_s, values = wall_seconds(lambda: values_of(flat, eps, steps=steps).block_until_ready(), REPEATS)
        slopes, ratio = [], []
        for i in range(len(METRICS)):
            both_s, (_, slope) = wall_seconds(lambda i=i: jax.block_until_ready(both_of(flat, eps, i, steps=steps)), 1)
            slopes.append(np.asarray(slope))
            ratio.append(both_s / value_s)
        return PathGradients(np.asarray(values), np.array(slopes), np.array(ratio))

    return run


def repeated_cosines(p: Problem, gradients: np.ndarray) -> np.ndarray:
    """Smallest cosines (l) of the exact gradients (l, m) with those of the next revolutions; NaN for zero gradients."""
    start, least = p.start, np.full(len(METRICS), np.inf)
    for _ in range(FOLLOWING):
        start = prepare_event(p.train, p.lift, p.cam_speed).advance(start)
        _, slopes = _bump_gradients(p, start)
        least = np.minimum(least, [cosine(a, b) for a, b in zip(gradients, slopes, strict=True)])
    return least


def spectral_radius(p: Problem) -> float:
    """Spectral radius of the cycle map's Jacobian at the start: the growth of a disturbance per revolution."""
    cycle = TracedMotion(p.train, p.lift, p.cam_speed, p.start)
    return float(np.abs(np.linalg.eigvals(cycle.pull_back(ends=np.eye(len(p.start))).by_start)).max())


def cosine(a: Float[np.ndarray, " m"], b: Float[np.ndarray, " m"]) -> float:
    """Cosine of the angle between two gradients; NaN where one of them is zero."""
    size = np.linalg.norm(a) * np.linalg.norm(b)
    return float(a @ b / size) if size > 0.0 else float("nan")
