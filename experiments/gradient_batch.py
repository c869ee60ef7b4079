"""What does a gradient through the contacts cost for 64 cams at 4 speeds, compared with one diffrax trajectory?

Times are measured in one run, per trajectory with its gradient by 20 bumps on the lift: diffrax's Tsit5 alone with the
recursive checkpoint adjoint, the exact path (its NumPy interface, and `jax.vmap` of `jax.grad`), the smooth path on
equal steps (all cams and speeds in one call), and the smooth path on the refined grid. Tsit5 and the equal steps use
the loosest setting whose valve position is within 1e-3 mm of a fine solution of the same smoothed model; gradients are
compared with central differences of event-exact.
"""

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from threadpoolctl import threadpool_limits

from camopt.cam.design_file import read_design
from camopt.cam.lift import Lift
from camopt.cam.polynomials import recentred
from camopt.exact.adjoint.motion import TracedMotion, value_and_gradient
from camopt.exact.engine import prepare as prepare_exact
from camopt.measure.hermite import Hermite
from camopt.scene import Response, load_scene
from camopt.scene.units import DEG
from camopt.smooth.exact_rule import exact_metrics
from camopt.smooth.grid import equal_grid
from camopt.smooth.laws import Layer
from camopt.smooth.simulate import EPS, prepare, response_arrays
from camopt.smooth.system import build_system
from camopt.study.measurements import fastest
from experiments.support.gradient_bumps import METRIC, Problem, against, exact_differences, problem
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.smooth_batch import BATCH_EPS, batch_motion, stage_lifts, tsit5_states

SIZES = {"small": (2, 3, (5000.0, 6000.0)), "full": (64, 20, (5000.0, 6000.0, 6500.0, 7000.0))}
"""Cams, bumps, speeds."""
DESIGN = Path(__file__).parents[1] / "tests" / "data" / "kodama-design.json"
"""The design of `camopt optimize kodama`; its motion is calm enough for an error of 1e-3 mm to mean something."""
ON_KNOTS = {"interval_deg": 4.0, "last_deg": 38.0}
"""Bumps whose knots are every second of the cam's own, which are 2 deg apart."""
SPACING = 2 * DEG
ERROR_MM = 1e-3
STEPS = (1440, 2160, 2880, 4320, 5760, 8640)
TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
REFERENCE_STEPS = 28_800
"""Per revolution; event-exact at its default takes some 900 at 5000 r/min."""
DIFFRAX_SAMPLES = 720
WORKERS = os.cpu_count() or 1
Timed = tuple[np.ndarray, np.ndarray, dict]
"""Wall and processor time [s] per trajectory with gradient, gradients (s, m) of the first cam, and the setting."""
HEIGHT = 1e-6
"""Standard deviation of the random heights of bumps by which the cams of the batch differ [m]."""


def main(size: str, folder=RESULTS) -> dict:
    """Times, settings and gradient errors; small: two cams, three bumps, two speeds."""
    cams, bumps, speeds = SIZES[size]
    scene = load_scene("kodama")
    p = problem(scene, read_design(DESIGN, scene), speeds, bumps, **ON_KNOTS)
    z = HEIGHT * np.random.default_rng(4).normal(size=(bumps, cams))
    z[:, 0] = 0.0  # the cam whose gradient is compared
    truth = [exact_differences(p, s) for s in range(len(speeds))]
    rows = []
    for name, method in METHODS.items():
        with threadpool_limits(limits=1, user_api="blas"):  # its threads spin on the cores of the others
            (seconds, processor), gradients, setting = method(p, z)
        judged = [against(g, t) for g, t in zip(gradients, truth, strict=True)]
        times = {"ms_per_trajectory": 1e3 * seconds, "processor_ms_per_trajectory": 1e3 * processor}
        rows.append({"method": name, **times, **setting, "at_speed": judged})
    for row in rows:
        for kind in ("", "processor_"):
            key = f"{kind}ms_per_trajectory"
            row[f"{kind}times_cheaper_than_diffrax"] = rows[0][key] / row[key]
    content = {"cams": cams, "speeds_rpm": speeds, "coefficients": bumps, "metric": METRIC, "methods": rows}
    return write_result("gradient_batch", size, content, {}, folder)


def diffrax_tsit5(p: Problem, z: np.ndarray) -> Timed:
    """One trajectory with its gradient at a time; the mean over the speeds."""
    system, angle = build_system(p.train), jnp.asarray(equal_grid(DIFFRAX_SAMPLES))
    under = p.under(system)

    def motion(z, speed, y0, tolerance):
        return tsit5_states(under(z, speed), y0, angle, Layer(BATCH_EPS), tolerance)

    def value(z, speed, y0, tolerance):
        return p.metric(system, motion(z, speed, y0, tolerance), speed, BATCH_EPS)

    def valve(s: int, tolerance: float):
        response = jax.jit(motion)(jnp.zeros(len(p.bumps)), *p.at(s), tolerance)
        return np.asarray(response.angle), np.asarray(response.x[:, p.train.valve])

    tolerance, error = loosest(p, TOLERANCES, valve)
    gradient = jax.jit(jax.value_and_grad(value))
    one = [timed(lambda s=s: gradient(jnp.asarray(z[:, 0]), *p.at(s), tolerance)) for s in range(len(p.speeds_rpm))]
    setting = {"eps_m": BATCH_EPS, "tolerance_m": tolerance, "error_mm": error}
    return np.mean([t for t, _ in one], axis=0), np.array([g for _, (_, g) in one]), setting


def equal_steps(p: Problem, z: np.ndarray) -> Timed:
    """All cams side by side, the batch last; the speeds one by one, as many at a time as there are cores."""
    system, cams = build_system(p.train), z.shape[1]

    def lifts(steps: int):
        return stage_lifts(p.lift, steps), np.stack([stage_lifts(b, steps) for b in p.bumps], -1)

    def valve(s: int, steps: int):
        speed, y0 = p.at(s)
        response = jax.jit(batch_motion)(system, jnp.asarray(lifts(steps)[0])[..., None], jnp.full(1, speed), y0)
        return np.asarray(response.angle[0]), np.asarray(response.x[0, :, p.train.valve])

    steps, error = loosest(p, STEPS, valve)
    base, parts = (jnp.asarray(q) for q in lifts(steps))

    def total(z, speed, y0):
        motions = batch_motion(system, base[..., None] + parts @ z, speed, y0)
        values = jax.vmap(lambda motion, at: p.metric(system, motion, at, BATCH_EPS))(motions, speed)
        return jnp.sum(values), values

    @jax.jit
    def gradients(z, speed, y0):
        return jax.grad(total, has_aux=True)(z, jnp.full(cams, speed), y0)[0]

    def one_speed(s: int):
        return jax.block_until_ready(gradients(jnp.asarray(z), *p.at(s)))

    with ThreadPoolExecutor(WORKERS) as pool:
        seconds, slopes = timed(lambda: list(pool.map(one_speed, range(len(p.speeds_rpm)))))
    setting = {"eps_m": BATCH_EPS, "steps": steps, "error_mm": error}
    return seconds / (cams * len(p.speeds_rpm)), np.asarray(slopes)[:, :, 0], setting


def refined_grid(p: Problem, z: np.ndarray) -> Timed:
    """The smooth path at its defaults, whose gradients are those of the exact motion; two cams represent all."""
    system, some = build_system(p.train), z[:, :2].T
    under = p.under(system)

    def value(z, speed, y0):
        return p.metric(system, response_arrays(under(z, speed), y0), speed, EPS)

    states = jnp.asarray(p.states.reshape(len(p.states), 2, -1))
    many = jax.jit(jax.vmap(jax.vmap(jax.grad(value), (0, None, None)), (None, 0, 0)))
    seconds, slopes = timed(lambda: many(jnp.asarray(some), jnp.asarray(p.cam_speeds), states))
    return seconds / (len(some) * len(p.speeds_rpm)), np.asarray(slopes[:, 0]), {"eps_m": EPS, "refined": True}


def exact_numpy(p: Problem, z: np.ndarray) -> Timed:
    """All cams and speeds in threads; gradients by the pieces are converted to gradients by the bumps."""
    lift, bumps = on_common_pieces(p)
    speeds, states = np.tile(p.cam_speeds, z.shape[1]), np.tile(p.states, (z.shape[1], 1))

    def all_gradients():
        cams = [replace(lift, coefficients=lift.coefficients + change) for change in np.moveaxis(bumps @ z, -1, 0)]
        lifts = [cam for cam in cams for _ in p.cam_speeds]

        def slope(lift: Lift, speed: float, start: np.ndarray) -> np.ndarray:
            return value_and_gradient(p.train, lift, speed, [METRIC], start, spacing=SPACING).by_coefficients[0]

        with ThreadPoolExecutor(WORKERS) as pool:
            return np.tensordot(np.array(list(pool.map(slope, lifts, speeds, states))), bumps, 2)

    seconds, slopes = timed(all_gradients)
    return seconds / len(speeds), slopes[: len(p.speeds_rpm)], exact_setting(p, lift)


def exact_jax(p: Problem, z: np.ndarray) -> Timed:
    """The same by `jax.jit(jax.vmap(jax.vmap(jax.grad)))` over cams and speeds: one host call."""
    lift, bumps = on_common_pieces(p)

    def value(z, speed, start):
        cam = {"lift": lift.coefficients + jnp.asarray(bumps) @ z, "start": start}
        return exact_metrics(p.train, lift, speed, cam, [METRIC], spacing=SPACING)[0]

    many = jax.jit(jax.vmap(jax.vmap(jax.grad(value), (None, 0, 0)), (0, None, None)))
    seconds, slopes = timed(lambda: many(jnp.asarray(z.T), jnp.asarray(p.cam_speeds), jnp.asarray(p.states)))
    return seconds / (z.shape[1] * len(p.speeds_rpm)), np.asarray(slopes[0]), exact_setting(p, lift)


def on_common_pieces(p: Problem) -> tuple[Lift, np.ndarray]:
    """The cam on the union of its borders and the bumps', and the bumps (p, q, m) there [m/rad^k]."""
    inner = {round(b, 9): b for law in (*p.bumps, p.lift) for b in law.borders[1:-1]}  # equal but for rounding
    borders = np.array([-np.pi, *(inner[key] for key in sorted(inner)), np.pi])

    def pieces(law: Lift) -> np.ndarray:
        rows = recentred(law, np.searchsorted(law.borders, 0.5 * (borders[1:] + borders[:-1])) - 1, borders[:-1])
        return np.pad(rows, ((0, 0), (0, p.lift.coefficients.shape[1] - rows.shape[1])))

    lift = replace(p.lift, borders=borders, coefficients=pieces(p.lift))
    return lift, np.stack([pieces(one) for one in p.bumps], axis=-1)


def exact_setting(p: Problem, lift: Lift) -> dict:
    """Error of the valve on the common pieces against event-exact on the cam's own pieces in finer steps."""
    worst = 0.0
    for speed, state in zip(p.cam_speeds, p.states, strict=True):
        fine = prepare_exact(p.train, p.lift, speed, REFERENCE_STEPS)(state)
        motion = TracedMotion(p.train, lift, speed, state, spacing=SPACING)
        angle = np.linspace(-np.pi, np.pi, 721)
        worst = max(worst, valve_error_mm(p, fine, speed, angle, motion.at(angle).x[:, p.train.valve]))
    return {"error_mm": worst}


METHODS: dict[str, Callable[[Problem, np.ndarray], Timed]] = {
    "diffrax tsit5, one trajectory": diffrax_tsit5,
    "exact, NumPy": exact_numpy,
    "exact, jax.vmap of jax.grad": exact_jax,
    "smooth, equal steps, batch": equal_steps,
    "smooth, refined grid, batch": refined_grid,
}
"""The first is the reference for the ratios of times."""


def loosest(p: Problem, settings, valve) -> tuple[float, float]:
    """First setting whose valve position is within ERROR_MM of the fine solution at every speed, and its error [mm]."""
    speeds = list(enumerate(p.cam_speeds))
    fine = [prepare(p.train, p.lift, speed, eps=BATCH_EPS)(p.states[s]) for s, speed in speeds]
    for setting in settings:
        worst = float(np.max([valve_error_mm(p, fine[s], speed, *valve(s, setting)) for s, speed in speeds]))
        if worst <= ERROR_MM:
            return setting, worst
    raise RuntimeError(f"no setting of {settings} keeps within {ERROR_MM} mm of its own reference")


def valve_error_mm(p: Problem, fine: Response, cam_speed: float, angle: np.ndarray, x: np.ndarray) -> float:
    """Largest distance [mm] of valve positions x [m] at angles [rad] from cubics through a fine motion."""
    i = p.train.valve
    curve = Hermite(fine.angle, fine.x[:, i], fine.v[:, i] / cam_speed)
    return 1e3 * float(np.max(np.abs(x - curve(angle))))


def timed(call, repeats: int = 10):
    """Least wall and processor time (2) [s] of a call that is compiled, and its result."""
    clocks = lambda: np.array([time.perf_counter(), time.process_time()])  # noqa: E731
    return fastest(lambda: jax.block_until_ready(call()), repeats, clocks)


if __name__ == "__main__":
    run_script(main, __doc__)
