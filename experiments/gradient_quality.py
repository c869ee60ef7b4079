"""How accurate are gradients through a damped contact by the tools that researchers use, compared with the exact and
the smooth path?

The first problem is one mass that flies onto a damped contact and off again, whose end state has a closed form: the
derivatives of its end state by speed, distance, damping and stiffness. The second is `kodama` with its Polydyne: the
derivatives of the seating velocity of a settled revolution by the heights of bumps on the cam, compared with central
differences of the exact motion. When a damped contact closes, its force jumps by damping times speed, so that
derivatives jump there too; a solver that merely switches its right-hand side does not include this. MuJoCo MJX and
NVIDIA Warp are left out, with a line that says so, where they are not installed.
"""

import time
from collections.abc import Callable
from importlib.util import find_spec

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.families.polydyne import polydyne
from camopt.exact.adjoint.motion import value_and_gradient
from camopt.scene import load_scene
from camopt.smooth.grid import equal_grid
from camopt.smooth.laws import Layer
from camopt.smooth.system import build_system
from camopt.study.measurements import fastest
from experiments.gradient_batch import on_common_pieces
from experiments.gradient_bias import compiled
from experiments.support import gradient_ball as ball
from experiments.support.gradient_ball import Answer
from experiments.support.gradient_bumps import METRIC, Problem, against, exact_differences, exact_value, problem
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.smooth_batch import tsit5_states

WIDTHS = {"small": (1e-6,), "full": (1e-5, 1e-6, 1e-7)}
"""Widths of the smooth path's layer [m]."""
TOLERANCE = 1e-8
EQUAL_STEPS = {"small": (500,), "full": (2000, 20_000)}
"""Steps of MJX and of Warp."""
ENGINES = {"mujoco": "MuJoCo MJX", "warp": "NVIDIA Warp"}
REPEATS = {"small": 1, "full": 5}
SPEED_RPM, BUMPS = 6000.0, {"small": 2, "full": 10}
SAMPLES = 11_520
"""Number of angles at which diffrax records its motion; between them the seating is located on cubics."""


class Switch(Layer):
    """The non-smooth contact law by `where`, without a layer, over which diffrax has to step."""

    def ramp(self, r):
        return jax.nn.relu(r)

    def slope(self, r):
        return jnp.where(r > 0.0, 1.0, 0.0)


def main(size: str = "full", folder=RESULTS) -> dict:
    """Errors, cosines and times; small: one width, two bumps and few steps."""
    rows = [{"method": name, **ball.judged(make(), REPEATS[size])} for name, make in ball_methods(size).items()]
    train = of_kodama(size)
    absent = [name for module, name in ENGINES.items() if not find_spec(module)]
    missing = [f"{name} is not installed and is left out." for name in absent]
    content = {"ball": rows, "kodama": train, "metric": METRIC, "speed_rpm": SPEED_RPM, "missing": missing}
    return write_result("gradient_quality", size, content, {}, folder)


def ball_methods(size: str) -> dict[str, Callable[[], Callable[[], Answer]]]:
    """A function that prepares each method, by its name in the table."""
    methods: dict[str, Callable[[], Callable[[], Answer]]] = {"exact path": lambda: ball.exact_path}
    methods |= {f"smooth path, {w:g} m": lambda w=w: ball.smooth_path(w) for w in WIDTHS[size]}
    methods["diffrax, switch by where"] = lambda: ball.diffrax_switch(TOLERANCE)
    methods["diffrax, two events"] = lambda: ball.diffrax_events(TOLERANCE)
    for steps in EQUAL_STEPS[size]:
        if find_spec("mujoco"):
            methods[f"MJX, its contact, {steps} steps"] = lambda steps=steps: ball.mjx(steps, contact=True)
            methods[f"MJX, the law as a force, {steps} steps"] = lambda steps=steps: ball.mjx(steps, contact=False)
        if find_spec("warp"):
            methods[f"Warp, the law in a kernel, {steps} steps"] = lambda steps=steps: ball.warp_kernel(steps)
    return methods


def of_kodama(size: str) -> list[dict]:
    """The rows of the problem on `kodama`."""
    scene = load_scene("kodama")
    p = problem(scene, polydyne(scene), (SPEED_RPM,), BUMPS[size])
    value, differences = exact_value(p, p.lift, 0), exact_differences(p, 0)
    rows = [_row("exact path", lambda: exact(p), value, differences, REPEATS[size])]
    bias = compiled(p, "refined", "float64")
    for width in WIDTHS[size]:
        rows.append(_row(f"smooth path, {width:g} m", lambda w=width: bias(w, 0), value, differences, REPEATS[size]))
    switch = by_switch(p)
    return [*rows, _row("diffrax, switch by where", switch, value, differences, REPEATS[size])]


def _row(name: str, method: Callable, value: float, differences: np.ndarray, repeats: int) -> dict:
    seconds, (computed, gradient) = fastest(lambda: jax.block_until_ready(method()), repeats, time.perf_counter)
    judged_ = against(np.asarray(gradient), differences)
    return {"method": name, "value_error": abs(float(computed) / value - 1), **judged_, "ms": 1e3 * float(seconds)}


def exact(p: Problem) -> tuple[float, np.ndarray]:
    """Value and gradient by the bumps (m), by the discrete adjoint."""
    lift, bumps = on_common_pieces(p)
    slopes = value_and_gradient(p.train, lift, p.cam_speeds[0], [METRIC], p.states[0], revolutions=2)
    return float(slopes.values[0]), np.tensordot(slopes.by_coefficients[0], bumps, 2)


def by_switch(p: Problem) -> Callable:
    """Value and gradient by the bumps (m), by reverse mode through diffrax's Tsit5."""
    system, angle = build_system(p.train), jnp.asarray(equal_grid(SAMPLES))
    under, (speed, y0) = p.under(system), p.at(0)

    def value(z):
        motion = tsit5_states(under(z, speed), y0, angle, Switch(1e-12), 1e-12)
        return p.metric(system, motion, speed, 1e-12)

    both = jax.jit(jax.value_and_grad(value))
    return lambda: both(jnp.zeros(len(p.bumps)))


if __name__ == "__main__":
    run_script(main, __doc__)
