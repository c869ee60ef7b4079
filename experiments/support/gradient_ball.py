"""One mass that flies onto a damped contact and off again, in closed form, and its gradients by every method.

Without gravity a mass of 1 kg starts at a distance from the floor with a speed towards it. The floor is a spring with a
damper beside it, which never pulls. After END the position and the speed are wanted, and their derivatives by speed,
distance, damping and stiffness, each as the share of a share.
"""

import time
from collections.abc import Callable
from dataclasses import replace

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from camopt.cam.lift import Lift
from camopt.exact.adjoint.motion import TracedMotion
from camopt.scene import build_train, parse_scene
from camopt.smooth.laws import Layer
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import lift_samples, response_arrays, system_with
from camopt.study.gradient.paths import cosine
from camopt.study.measurements import fastest

END = 0.02
AT = np.array([2.0, 0.01, 400.0, 1e6])
"""Speed [m/s], distance [m], damping [N s/m], stiffness [N/m]."""
WEIGHT = 1e-12
"""Force [N] that stands in for none: a scene's mass is held at rest by something."""
SCENE = f"""
format = 1
name = "ball"
[[mass]]
name = "ball"
mass_kg = 1.0
force_N = -{WEIGHT!r}
[[element]]
name = "floor"
kind = "contact"
between = ["ground", "ball"]
stiffness_N_per_m = {float(AT[3])!r}
damping_N_s_per_m = {float(AT[2])!r}
"""
FLAT = Lift(np.array([-np.pi, np.pi]), np.zeros((1, 2)), 1.0)
STEP = 1e-6
"""Step of the closed form's central differences, as a share: their error is its square and the rounding over it."""
Answer = tuple[np.ndarray, np.ndarray, int]
"""End (2), its Jacobian (2, 4), and the number of steps."""


def closed_form(numbers: np.ndarray) -> np.ndarray:
    """Position [m] and speed [m/s] at END; the contact lets go where its force is zero."""
    speed, distance, c, k = numbers
    omega, decay = np.sqrt(k - c**2 / 4), c / 2
    phase = np.arctan2(c * omega, decay**2 - omega**2)
    shape = np.exp(-decay * phase / omega)
    x = -speed * shape * np.sin(phase) / omega
    v = -speed * shape * (np.cos(phase) - decay / omega * np.sin(phase))
    return np.array([x + v * (END - distance / speed - phase / omega), v])


def truth() -> np.ndarray:
    """The Jacobian (2, 4) of the closed form by central differences."""
    steps = np.diag(STEP * AT)
    columns = [(closed_form(AT + h) - closed_form(AT - h)) / (2 * STEP * a) for h, a in zip(steps, AT, strict=True)]
    return np.stack(columns, axis=1)


def exact_path() -> Answer:
    """camopt's exact path: the discrete adjoint with its jump where a damped contact closes."""
    train = build_train(parse_scene(SCENE, "ball"))
    train = replace(train, mass_force=np.zeros(1))
    motion = TracedMotion(train, FLAT, 2 * np.pi / END, np.array([AT[1], -AT[0]]), mechanical=True)
    slopes = motion.pull_back(ends=np.eye(2))
    by = slopes.by_train
    jacobian = np.stack([-slopes.by_start[:, 1], slopes.by_start[:, 0], by.damping[:, 0], by.stiffness[:, 0]], axis=1)
    return motion.end, jacobian, 0


def smooth_path(width: float) -> Callable[[], Answer]:
    """camopt's smooth path with a layer of a width [m]: exponential steps on a refined grid."""
    train = build_train(parse_scene(SCENE, "ball"))
    samples, steps = jnp.asarray(lift_samples(FLAT)), 5120

    def end(numbers):
        speed, distance, c, k = numbers
        own = system_with(train, {"damping": c[None], "stiffness": k[None]})
        driven = DrivenSystem(own, samples, 2 * jnp.pi / END)
        motion = response_arrays(driven, jnp.stack([distance[None], -speed[None]]), Layer(width), steps=steps)
        return jnp.stack([motion.x[-1, 0], motion.v[-1, 0]]), steps

    return _by_jax(end)


def diffrax_switch(tolerance: float) -> Callable[[], Answer]:
    """diffrax's Tsit5 through a right-hand side that switches by `where`, as one writes it first."""

    def rate(t, y, numbers):
        x, v = y
        force = jnp.where(x < 0, jnp.maximum(-numbers[3] * x - numbers[2] * v, 0.0), 0.0)
        return jnp.stack([v, force])

    def solved(numbers):
        found = _solve(rate, 0.0, jnp.stack([numbers[1], -numbers[0]]), numbers, tolerance)
        return found.ys[-1], found.stats["num_steps"]

    return _by_jax(solved)


def diffrax_events(tolerance: float) -> Callable[[], Answer]:
    """diffrax with an event at touch and one at letting go: three integrations, since three are known to be needed."""

    def fly(t, y, numbers):
        return jnp.stack([y[1], 0.0 * y[0]])

    def pushed(t, y, numbers):
        return jnp.stack([y[1], -numbers[3] * y[0] - numbers[2] * y[1]])

    def solved(numbers):
        start = jnp.stack([numbers[1], -numbers[0]])
        one = _solve(fly, 0.0, start, numbers, tolerance, lambda t, y, args, **_: y[0])
        two = _solve(pushed, one.ts[-1], one.ys[-1], numbers, tolerance, lambda t, y, args, **_: pushed(t, y, args)[1])
        three = _solve(fly, two.ts[-1], two.ys[-1], numbers, tolerance)
        return three.ys[-1], sum(part.stats["num_steps"] for part in (one, two, three))

    return _by_jax(solved)


def _solve(rate, begin, y, numbers, tolerance: float, surface=None):
    event = None if surface is None else diffrax.Event(surface, optx.Newton(1e-12, 1e-12), direction=False)
    return diffrax.diffeqsolve(
        diffrax.ODETerm(rate), diffrax.Tsit5(), begin, END, 1e-5, y, numbers, event=event, max_steps=4096,
        stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance, dtmax=END / 50),
    )  # fmt: skip


def _by_jax(end: Callable, jacobian: Callable = jax.jacrev) -> Callable[[], Answer]:
    """By a function of the numbers that gives the end and the number of steps."""
    value, slopes = jax.jit(end), jax.jit(jacobian(end, has_aux=True))

    def answer() -> Answer:
        at = jnp.asarray(AT)
        found, steps = value(at)
        return np.asarray(found), np.asarray(slopes(at)[0]), int(steps)

    return answer


def judged(method: Callable[[], Answer], repeats: int) -> dict:
    """Relative error and cosine of a method's Jacobian, in shares of shares, and its time per step."""
    seconds, (end, jacobian, steps) = fastest(method, repeats, time.perf_counter)
    true, value = truth(), closed_form(AT)
    found, wanted = (q * AT / value[:, None] for q in (jacobian, true))
    return {
        "value_error": float(np.max(np.abs(end / value - 1))),
        "relative_error": float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted)),
        "cosine": cosine(found.ravel(), wanted.ravel()),
        "steps": steps,
        "ms": 1e3 * float(seconds),
        "us_per_step": 1e6 * float(seconds) / steps if steps else None,
    }
