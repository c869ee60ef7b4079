"""Work-precision of the smooth path: refined grid, equal steps in two precisions, diffrax, gradients, batches (JAX)."""

from collections.abc import Iterator
from functools import partial
from itertools import product

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from camopt.scene import MotionRefused, Response
from camopt.smooth.contact import Layer
from camopt.smooth.metrics import revolution_metrics
from camopt.smooth.rest import rest_state
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import batch_motion, lift_samples, prepare, response_arrays, stage_lifts, touch_layer
from camopt.smooth.system import SystemState, build_system, stacked
from camopt.study.measured_rows import Measurement
from camopt.study.timing import timed
from camopt.study.tradeoff.case import RevolutionCase, valve_lift

REFINED_EPS = (1e-6, 1e-7, 1e-8, 2e-9)
EQUAL_EPS = (1e-5, 1e-6, 1e-7)
BATCH_EPS = (1e-6, 1e-7)
EQUAL_STEPS = (1440, 5760)
TOLERANCE_OF_EPS = 5e-3
GRADIENT_EPS = (1e-6, 1e-7, 2e-9)
GRADIENT_STEPS = 8192
PRECISIONS = {"float64": jnp.float64, "float32": jnp.float32}


def smooth_work(case: RevolutionCase) -> Iterator[Measurement]:
    """Measures one motion: refined grids by eps, equal steps by step, eps, precision; diffrax; gradients."""

    def refined(eps: float, method: str, tolerance: float) -> dict:
        motion = case.train, case.cam, case.cam_speed
        return case.measured(prepare(*motion, layer=Layer(eps), tolerance=tolerance, method=method))

    for eps in REFINED_EPS:
        run = partial(refined, eps, "scan", eps * TOLERANCE_OF_EPS)
        yield (case.name, "smooth, refined grid", f"eps {eps:g} m"), run
    for tolerance in (1e-8, 1e-10):
        setting = f"eps 1e-07 m, tolerance {tolerance:g} m"
        yield (case.name, "smooth, diffrax tsit5", setting), partial(refined, 1e-7, "tsit5", tolerance)
    for name, steps, eps in product(PRECISIONS, EQUAL_STEPS, EQUAL_EPS):
        run = partial(_equal, case, name, steps, eps)
        yield (case.name, f"smooth, equal steps, {name}", f"{steps} steps, eps {eps:g} m"), run
    for eps in GRADIENT_EPS if case.train.straight else ():  # the reference of gradients is the exact adjoint
        yield (case.name, "smooth, refined grid, reverse mode", f"eps {eps:g} m"), partial(_gradient, case, eps)


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
                "the motion has no bound: the step is past the method's stability limit: take a smaller one"
            )
        return Response(case.train, case.cam_speed, np.linspace(-np.pi, np.pi, steps + 1), lift, x, v, force, memory)

    return case.measured(revolve)


def recorded(motion: SystemState) -> list[np.ndarray]:
    """Lift (b, k), x, v (b, k, n), force (b, k, e) and memory (b, k, r) of b motions, as doubles: the integration alone
    is judged."""
    memory = np.zeros((*motion.lift.shape, 0)) if motion.memory is None else motion.memory
    return [np.asarray(q, dtype=float) for q in (*motion[1:5], memory)]


def _gradient(case: RevolutionCase, eps: float) -> dict:
    """The gradient of the seating velocity by every stiffness, times the latter: reverse mode from a fixed start."""
    system, samples = build_system(case.train), jnp.asarray(lift_samples(case.cam))
    rest, half, foot = jnp.asarray(rest_state(case.train)), case.cam.half_duration, case.cam.opening_foot

    @jax.jit
    def gradient(factors):
        def value(factors):
            changed = eqx.tree_at(lambda s: s.stiffness, system, system.stiffness * factors)
            driven, tolerance = DrivenSystem(changed, samples, case.cam_speed), eps * TOLERANCE_OF_EPS
            motion = response_arrays(driven, rest, Layer(eps), tolerance, revolutions=2, steps=GRADIENT_STEPS)
            metrics = revolution_metrics(changed, motion, case.cam_speed, half, foot, layer=touch_layer(eps))
            return metrics["seating_velocity_m_per_s"]

        return jax.grad(value)(factors)

    factors = jnp.ones_like(system.stiffness)
    times, slopes = timed(lambda: jax.block_until_ready(gradient(factors)), 2)
    return {**times, "figures": {"gradient": np.asarray(slopes)}}


def batch_work(name: str, case: RevolutionCase, cam_speeds: np.ndarray) -> Iterator[Measurement]:
    """Measures many speeds in one compiled call, with the axis of the batch last."""

    def run(precision: str, steps: int, eps: float) -> dict:
        batch, rest = equal_steps(case, precision, steps, cam_speeds)
        times, motion = timed(lambda: batch(rest, eps), len(cam_speeds))
        angle = np.linspace(-np.pi, np.pi, steps + 1)
        records = [
            Response(case.train, s, angle, *parts) for s, *parts in zip(cam_speeds, *recorded(motion), strict=True)
        ]
        return {**times, "figures": {"lift_mm": np.array([valve_lift(r) for r in records])}}

    for precision, steps, eps in product(PRECISIONS, EQUAL_STEPS, BATCH_EPS):
        key = name, f"smooth batch, {precision}", f"{steps} steps, eps {eps:g} m"
        yield key, partial(run, precision, steps, eps)
