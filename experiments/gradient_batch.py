"""What does a gradient through the contacts cost when 64 cams at 4 speeds want one, beside a single diffrax trajectory?

One run times, per trajectory with its gradient by 20 bumps on the lift: diffrax's Tsit5 alone with the recursive
checkpoint adjoint, the smooth path on equal steps (all cams and speeds in one call), and the smooth path on the refined
grid. The first two use the loosest setting whose valve stays within 1e-3 mm of the same smoothed model resolved finely;
gradients are judged against central differences of event-exact.
"""

import time
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.design_file import read_design
from camopt.scene import load_scene
from camopt.smooth.adaptive import adaptive_states
from camopt.smooth.batch import BATCH_EPS, batch_metrics, batch_motion, stage_lifts
from camopt.smooth.grid import equal_grid
from camopt.smooth.metrics import revolution_metrics
from camopt.smooth.simulate import EPS, lift_samples, prepare, response_arrays, touch_layer
from camopt.smooth.system import build_system
from camopt.verify.hermite import Hermite
from experiments.gradient_bumps import METRIC, Problem, against, exact_differences, problem
from experiments.record import RESULTS, run_script, write_result

SIZES = {"small": (2, 3, (5000.0, 6000.0)), "full": (64, 20, (5000.0, 6000.0, 6500.0, 7000.0))}
"""Cams, bumps, speeds."""
DESIGN = Path(__file__).parents[1] / "tests" / "data" / "kodama-design.json"
"""The cam that `camopt optimize kodama` delivered: calm enough at every speed that 1e-3 mm has a meaning."""
ERROR_MM = 1e-3
STEPS = (1440, 2160, 2880, 4320, 5760, 8640)
TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
DIFFRAX_SAMPLES = 720
HEIGHT = 1e-6
"""Scale of the random heights that make one cam of the batch from another [m]."""


def main(size: str, folder=RESULTS) -> dict:
    """Times, settings and gradient errors; small: two cams, three bumps, two speeds."""
    cams, bumps, speeds = SIZES[size]
    scene = load_scene("kodama")
    p = problem(scene, read_design(DESIGN, scene), speeds, bumps)
    z = HEIGHT * np.random.default_rng(4).normal(size=(bumps, cams))
    z[:, 0] = 0.0  # the cam whose gradient is judged
    truth = [exact_differences(p, s) for s in range(len(speeds))]
    rows = []
    for name, method in METHODS.items():
        seconds, gradients, setting = method(p, z)
        judged = [against(g, t) for g, t in zip(gradients, truth, strict=True)]
        rows.append({"method": name, "ms_per_trajectory": 1e3 * seconds, **setting, "at_speed": judged})
    for row in rows:
        row["times_cheaper_than_diffrax"] = rows[0]["ms_per_trajectory"] / row["ms_per_trajectory"]
    content = {"cams": cams, "speeds_rpm": speeds, "coefficients": bumps, "metric": METRIC, "methods": rows}
    write_result("gradient_batch", size, content, {}, folder)
    return content


def diffrax_tsit5(p: Problem, z: np.ndarray) -> tuple[float, np.ndarray, dict]:
    """One trajectory with its gradient at a time; the mean over the speeds."""
    system, angle = build_system(p.train), jnp.asarray(equal_grid(DIFFRAX_SAMPLES))
    base, parts = jnp.asarray(lift_samples(p.lift)), jnp.asarray(np.stack([lift_samples(b) for b in p.bumps], -1))

    def motion(z, speed, y0, tolerance):
        return adaptive_states(system, base + parts @ z, speed, y0, angle, BATCH_EPS, tolerance, "tsit5")

    def value(z, speed, y0, tolerance):
        found = motion(z, speed, y0, tolerance)
        layer = touch_layer(BATCH_EPS)
        return revolution_metrics(system, found, speed, p.lift.half_duration, p.lift.opening_foot, layer=layer)[METRIC]

    def valve(s: int, tolerance: float):
        found = jax.jit(motion)(jnp.zeros(len(p.bumps)), *at(p, s), tolerance)
        return np.asarray(found.angle), np.asarray(found.x[:, p.train.valve])

    tolerance, error = loosest(p, TOLERANCES, valve)
    gradient = jax.jit(jax.value_and_grad(value))
    one = [timed(lambda s=s: gradient(jnp.asarray(z[:, 0]), *at(p, s), tolerance)) for s in range(len(p.speeds_rpm))]
    setting = {"eps_m": BATCH_EPS, "tolerance_m": tolerance, "error_mm": error}
    return float(np.mean([t for t, _ in one])), np.array([g for _, (_, g) in one]), setting


def equal_steps(p: Problem, z: np.ndarray) -> tuple[float, np.ndarray, dict]:
    """All cams side by side, the batch last, one speed after the other inside one compiled call."""
    system, cams = build_system(p.train), z.shape[1]

    def lifts(steps: int):
        return stage_lifts(p.lift, steps), np.stack([stage_lifts(b, steps) for b in p.bumps], -1)

    def valve(s: int, steps: int):
        speed, y0 = at(p, s)
        found = jax.jit(batch_motion)(system, jnp.asarray(lifts(steps)[0])[..., None], jnp.full(1, speed), y0)
        return np.asarray(found.angle[0]), np.asarray(found.x[0, :, p.train.valve])

    steps, error = loosest(p, STEPS, valve)
    base, parts = (jnp.asarray(q) for q in lifts(steps))

    def total(z, speed, y0):
        found = batch_metrics(
            system, base[..., None] + parts @ z, speed, y0, p.lift.half_duration, p.lift.opening_foot
        )[METRIC]
        return jnp.sum(found), found

    @jax.jit
    def gradients(z):
        def one_speed(row):
            speed, y0 = row
            return jax.grad(total, has_aux=True)(z, jnp.full(cams, speed), y0)

        return jax.lax.map(one_speed, (jnp.asarray(p.cam_speeds), jnp.asarray(p.states.reshape(len(p.states), 2, -1))))

    seconds, (slopes, _) = timed(lambda: gradients(jnp.asarray(z)))
    setting = {"eps_m": BATCH_EPS, "steps": steps, "error_mm": error}
    return seconds / (cams * len(p.speeds_rpm)), np.asarray(slopes[:, :, 0]), setting


def refined_grid(p: Problem, z: np.ndarray) -> tuple[float, np.ndarray, dict]:
    """The smooth path at its defaults, whose gradients are those of the exact motion: a few cams stand for all."""
    system, some = build_system(p.train), z[:, :2].T
    base, parts = jnp.asarray(lift_samples(p.lift)), jnp.asarray(np.stack([lift_samples(b) for b in p.bumps], -1))

    def value(z, speed, y0):
        found = response_arrays(system, base + parts @ z, speed, y0)
        layer = touch_layer(EPS)
        return revolution_metrics(system, found, speed, p.lift.half_duration, p.lift.opening_foot, layer=layer)[METRIC]

    states = jnp.asarray(p.states.reshape(len(p.states), 2, -1))
    many = jax.jit(jax.vmap(jax.vmap(jax.grad(value), (0, None, None)), (None, 0, 0)))
    seconds, slopes = timed(lambda: many(jnp.asarray(some), jnp.asarray(p.cam_speeds), states))
    return seconds / (len(some) * len(p.speeds_rpm)), np.asarray(slopes[:, 0]), {"eps_m": EPS, "refined": True}


METHODS: dict[str, Callable[[Problem, np.ndarray], tuple[float, np.ndarray, dict]]] = {
    "diffrax tsit5, one trajectory": diffrax_tsit5,
    "smooth, equal steps, batch": equal_steps,
    "smooth, refined grid, batch": refined_grid,
}
"""Seconds per trajectory with gradient, gradients (s, m) of the first cam, and the setting. The first is the yardstick;
the exact path's adjoint is added here by one function of the same form."""


def at(p: Problem, s: int):
    return p.cam_speeds[s], jnp.asarray(p.states[s].reshape(2, -1))


def loosest(p: Problem, settings, valve) -> tuple[float, float]:
    """First of the settings whose valve position keeps within ERROR_MM of the finely resolved one at every speed."""
    fine = []
    for s in range(len(p.speeds_rpm)):
        record = prepare(p.train, p.lift, p.cam_speeds[s], eps=BATCH_EPS)(p.states[s])
        i = p.train.valve
        fine.append(Hermite(record.angle, record.x[:, i], record.v[:, i] / p.cam_speeds[s]))
    for setting in settings:
        worst = 0.0
        for s, curve in enumerate(fine):
            angle, x = valve(s, setting)
            worst = max(worst, 1e3 * float(np.max(np.abs(x - curve(angle)))))
        if worst <= ERROR_MM:
            return setting, worst
    raise RuntimeError(f"no setting of {settings} keeps within {ERROR_MM} mm of its own reference")


def timed(call, repeats: int = 3):
    """Least wall time [s] of a call that is compiled, and its result."""
    result, seconds = jax.block_until_ready(call()), []
    for _ in range(repeats):
        begin = time.perf_counter()
        result = jax.block_until_ready(call())
        seconds.append(time.perf_counter() - begin)
    return min(seconds), result


if __name__ == "__main__":
    run_script(main, __doc__)
