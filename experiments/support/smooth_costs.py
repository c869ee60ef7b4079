"""Measurements in addition to those of `camopt tradeoff` and `camopt reduce`: the smooth path in two precisions, by
diffrax, and as a batch of speeds, and the gradient of the seating velocity by the adjoint and by reverse mode.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from camopt import exact
from camopt.cam.lift import Lift
from camopt.exact.adjoint.motion import TracedMotion
from camopt.scene import MotionRefused, Response, Scene, Train, state_at_rest
from camopt.smooth.grid import equal_grid
from camopt.smooth.laws import Layer
from camopt.smooth.metrics import revolution_metrics
from camopt.smooth.rest import rest_state
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import LIFT_SAMPLES, lift_samples, response_arrays
from camopt.smooth.system import SystemState, build_system, stacked
from camopt.study.measurements import REFERENCE, Measurement, fastest, timed
from camopt.study.simulate.motion import TOLERANCE_OF_WIDTH
from camopt.study.tradeoff.methods import REFERENCE_STEPS, RevolutionCase, valve_lift
from camopt.verifier.convergence import first_steps
from camopt.verifier.methods import METHOD_NAMES, rkg
from experiments.support.smooth_batch import batch_motion, stage_lifts, tsit5_states

EQUAL_EPS = (1e-5, 1e-6, 1e-7)
BATCH_EPS = (1e-6, 1e-7)
EQUAL_STEPS = (1440, 5760)
GRADIENT_EPS = (1e-6, 1e-7, 2e-9)
GRADIENT_STEPS = 8192
PRECISIONS = {"float64": jnp.float64, "float32": jnp.float32}
SIDE_BY_SIDE = 16


def smooth_work(scene: Scene, cam: Lift) -> Iterator[Measurement]:
    """The measurements on a scene with linear laws, at its lowest and highest listed speed."""
    speeds = scene.operation.speeds_rpm
    for case in (RevolutionCase(scene, cam, speed) for speed in (min(speeds), max(speeds))):
        for tolerance in (1e-8, 1e-10):
            key = case.name, "smooth, diffrax tsit5", f"eps 1e-07 m, tolerance {tolerance:g} m"
            yield key, partial(_diffrax, case, tolerance)
        for name, steps, eps in product(PRECISIONS, EQUAL_STEPS, EQUAL_EPS):
            run = partial(_equal, case, name, steps, eps)
            yield (case.name, f"smooth, equal steps, {name}", f"{steps} steps, eps {eps:g} m"), run
        yield (case.name, "event-exact, adjoint", "default step"), partial(_adjoint, case)
        for eps in GRADIENT_EPS:
            yield (case.name, "smooth, refined grid, reverse mode", f"eps {eps:g} m"), partial(_gradient, case, eps)
    yield from _side_by_side(case)


def _diffrax(case: RevolutionCase, tolerance: float) -> dict:
    driven = DrivenSystem(build_system(case.train), jnp.asarray(lift_samples(case.cam)), case.cam_speed)
    angle = equal_grid(LIFT_SAMPLES)

    def revolve(state: np.ndarray) -> Response:
        motion = tsit5_states(driven, stacked(state, len(case.train.mass)), angle, Layer(1e-7), tolerance)
        return Response(case.train, case.cam_speed, angle, *recorded(motion))

    return case.measured(revolve)


def exact_gradient(case: RevolutionCase) -> np.ndarray:
    """Seating velocity of the first revolution by every stiffness, times that stiffness [m/s], by the adjoint."""
    motion = TracedMotion(case.train, case.cam, case.cam_speed, case.rest, 1, mechanical=True)
    slopes = motion.gradient(("seating_velocity_m_per_s",)).by_train
    assert slopes is not None, "asked for by mechanical"
    return slopes.stiffness[0] * case.train.parameters["stiffness"]


def _adjoint(case: RevolutionCase) -> dict:
    times, _ = timed(lambda: exact_gradient(case))
    return {**times, "errors": {"gradient": 0.0}}


def equal_steps(case: RevolutionCase, precision: str, steps: int, cam_speeds: np.ndarray):
    """A compiled function from (states (2, n + r, b), eps) to one revolution of b motions, and the states at rest."""
    dtype = PRECISIONS[precision]
    system, width = build_system(case.train, dtype), len(cam_speeds)
    stages = jnp.broadcast_to(jnp.asarray(stage_lifts(case.cam, steps), dtype)[..., None], (2, steps, 6, width))
    speeds = jnp.asarray(cam_speeds, dtype)
    rest = jnp.asarray(rest_state(case.train), dtype)
    rest = jnp.broadcast_to(rest[..., None], (*rest.shape, width))
    run = jax.jit(lambda y, eps: batch_motion(system, stages, speeds, y, eps))
    return (lambda y, eps: jax.block_until_ready(run(y, jnp.asarray(eps, dtype)))), rest


def _equal(case: RevolutionCase, precision: str, steps: int, eps: float) -> dict:
    run, rest = equal_steps(case, precision, steps, np.array([case.cam_speed]))

    def revolve(state: np.ndarray) -> Response:
        y = stacked(state, len(case.train.mass))[..., None].astype(rest.dtype)
        lift, x, v, force, memory = (q[0] for q in recorded(run(y, eps)))
        if not np.all(np.isfinite(x)):
            raise MotionRefused(
                "the motion has no bound: the step is above the method's stability limit: take a smaller one"
            )
        return Response(case.train, case.cam_speed, np.linspace(-np.pi, np.pi, steps + 1), lift, x, v, force, memory)

    return case.measured(revolve)


def recorded(motion: SystemState) -> list[np.ndarray]:
    """Lift (*b, k), x, v (*b, k, n), force (*b, k, e) and memory (*b, k, r) of motions in double precision, so that
    only the precision of the integration counts."""
    memory = np.zeros((*motion.lift.shape, 0)) if motion.memory is None else motion.memory
    return [np.asarray(q, dtype=float) for q in (*motion[1:5], memory)]


def _gradient(case: RevolutionCase, eps: float) -> dict:
    """Gradient of the seating velocity by relative changes of every stiffness, in reverse mode from a fixed start."""
    system, samples = build_system(case.train), jnp.asarray(lift_samples(case.cam))
    rest, half, foot = jnp.asarray(rest_state(case.train)), case.cam.half_duration, case.cam.opening_foot

    @jax.jit
    def gradient(factors):
        def value(factors):
            changed = eqx.tree_at(lambda s: s.stiffness, system, system.stiffness * factors)
            driven, tolerance = DrivenSystem(changed, samples, case.cam_speed), eps * TOLERANCE_OF_WIDTH
            motion = response_arrays(driven, rest, Layer(eps), tolerance, revolutions=2, steps=GRADIENT_STEPS)
            metrics = revolution_metrics(changed, motion, case.cam_speed, half, foot, layer=Layer(eps).half_width)
            return metrics["seating_velocity_m_per_s"]

        return jax.grad(value)(factors)

    factors = jnp.ones_like(system.stiffness)
    times, slopes = timed(lambda: jax.block_until_ready(gradient(factors)), 2)
    true = exact_gradient(case)
    return {**times, "errors": {"gradient": float(np.linalg.norm(slopes - true) / np.linalg.norm(true))}}


def _side_by_side(case: RevolutionCase) -> Iterator[Measurement]:
    """A batch of speeds just below the highest one: the lifts of all, and the time per revolution of one."""
    name = f"{SIDE_BY_SIDE} speeds side by side up to {case.speed_rpm:g} r/min"
    cam_speeds = np.linspace(0.95, 1.0, SIDE_BY_SIDE) * case.cam_speed

    def loop(prepare: Callable, steps: int) -> dict:
        revolves = [prepare(case.train, case.cam, s, steps) for s in cam_speeds]
        times, lifts = timed(lambda: np.array([valve_lift(r(case.rest)) for r in revolves]), SIDE_BY_SIDE)
        return {**times, "figures": {"lift_mm": lifts}}

    def batch(precision: str, steps: int, eps: float) -> dict:
        run, rest = equal_steps(case, precision, steps, cam_speeds)
        times, motion = timed(lambda: run(rest, eps), SIDE_BY_SIDE)
        angle = np.linspace(-np.pi, np.pi, steps + 1)
        records = [
            Response(case.train, s, angle, *parts) for s, *parts in zip(cam_speeds, *recorded(motion), strict=True)
        ]
        return {**times, "figures": {"lift_mm": np.array([valve_lift(r) for r in records])}}

    yield (name, REFERENCE, "fine samples"), partial(loop, exact.prepare, REFERENCE_STEPS)
    yield (name, METHOD_NAMES["event"], "1440 samples"), partial(loop, exact.prepare, 1440)
    for steps in (2880, 11_520):
        yield (name, METHOD_NAMES["rkg"], f"{steps} steps"), partial(loop, rkg.prepare, steps)
    for precision, steps, eps in product(PRECISIONS, EQUAL_STEPS, BATCH_EPS):
        key = name, f"smooth batch, {precision}", f"{steps} steps, eps {eps:g} m"
        yield key, partial(batch, precision, steps, eps)


def smooth_times(train: Train, cam: Lift, cam_speed: float) -> dict[str, float]:
    """Least time [ms] of a revolution by the smooth scan with the steps of `first_steps`, alone and in a batch of
    speeds just below (per motion).

    Times are by the clock, because JAX computes in its own threads, whose processor time is not always counted.
    """
    steps, samples = first_steps(train, cam_speed), jnp.asarray(lift_samples(cam))
    system, rest = build_system(train), stacked(state_at_rest(train), len(train.mass))

    def end(speed):
        return response_arrays(DrivenSystem(system, samples, speed), rest, steps=steps, refine=False).x[-1]

    alone, batch = jax.jit(end), jax.jit(jax.vmap(end))
    speeds = jnp.linspace(0.95 * cam_speed, cam_speed, SIDE_BY_SIDE)
    single, _ = fastest(lambda: jax.block_until_ready(alone(cam_speed)), 20, time.perf_counter)
    many, _ = fastest(lambda: jax.block_until_ready(batch(speeds)), 5, time.perf_counter)
    return {"smooth": 1e3 * single, "batch": 1e3 * many / SIDE_BY_SIDE}
