"""One mass that flies onto a damped contact and off again: closed form, and gradients by every method.

Without gravity a mass of 1 kg starts at a distance from the floor with a speed towards it. The floor is a spring and a
damper in parallel and never pulls. The results are position and speed at the time END [s], and their relative
derivatives by relative changes of speed, distance, damping and stiffness.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

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
"""Force [N] in place of none, because a mass of a scene must be held at rest by some force."""
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
"""Relative step of the closed form's central differences, whose error is its square plus rounding over it."""
Answer = tuple[np.ndarray, np.ndarray, int]
"""End (2), its Jacobian (2, 4), and the number of steps."""


def closed_form(numbers: np.ndarray) -> np.ndarray:
    """Position [m] and speed [m/s] at END; the contact ends when its force is zero."""
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
    """camopt's exact path: the discrete adjoint with the jump of the derivatives where a damped contact closes."""
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
        system = system_with(train, {"damping": c[None], "stiffness": k[None]})
        driven = DrivenSystem(system, samples, 2 * jnp.pi / END)
        motion = response_arrays(driven, jnp.stack([distance[None], -speed[None]]), Layer(width), steps=steps)
        return jnp.stack([motion.x[-1, 0], motion.v[-1, 0]]), steps

    return _by_jax(end)


def diffrax_switch(tolerance: float) -> Callable[[], Answer]:
    """diffrax's Tsit5 with a right-hand side that switches by `where`, the usual first formulation."""

    def rate(t, y, numbers):
        x, v = y
        force = jnp.where(x < 0, jnp.maximum(-numbers[3] * x - numbers[2] * v, 0.0), 0.0)
        return jnp.stack([v, force])

    def solved(numbers):
        solution = _solve(rate, 0.0, jnp.stack([numbers[1], -numbers[0]]), numbers, tolerance)
        return solution.ys[-1], solution.stats["num_steps"]

    return _by_jax(solved)


def diffrax_events(tolerance: float) -> Callable[[], Answer]:
    """diffrax with events at the two ends of contact: three integrations, because their number is known here."""

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
    """A method from a function of the numbers that returns the end state and the number of steps."""
    value, slopes = jax.jit(end), jax.jit(jacobian(end, has_aux=True))

    def answer() -> Answer:
        at = jnp.asarray(AT)
        state, steps = value(at)
        return np.asarray(state), np.asarray(slopes(at)[0]), int(steps)

    return answer


def judged(method: Callable[[], Answer], repeats: int) -> dict:
    """Error and cosine of a method's Jacobian of relative changes, and its time per step."""
    seconds, (end, jacobian, steps) = fastest(method, repeats, time.perf_counter)
    true, value = truth(), closed_form(AT)
    computed, exact = (q * AT / value[:, None] for q in (jacobian, true))
    return {
        "value_error": float(np.max(np.abs(end / value - 1))),
        "relative_error": float(np.linalg.norm(computed - exact) / np.linalg.norm(exact)),
        "cosine": cosine(computed.ravel(), exact.ravel()),
        "steps": steps,
        "ms": 1e3 * float(seconds),
        "us_per_step": 1e6 * float(seconds) / steps if steps else None,
    }


RADIUS = 0.05
MODEL = """
<mujoco>
  <option timestep="{step}" gravity="0 0 0" integrator="Euler" iterations="4" ls_iterations="8"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" condim="1" contype="{on}" conaffinity="{on}"
          solref="-{stiffness} -{damping}" solimp="0.9999 0.9999 0.001 0.5 2"/>
    <body pos="0 0 {radius}">
      <joint type="slide" axis="0 0 1"/>
      <geom type="sphere" size="{radius}" mass="1" condim="1" contype="{on}" conaffinity="{on}"
            solref="-{stiffness} -{damping}" solimp="0.9999 0.9999 0.001 0.5 2"/>
    </body>
  </worldbody>
</mujoco>"""
"""A sphere on a plane. MuJoCo's soft contact with a negative solref has a stiffness and a damping per mass, and never
pulls. With an impedance of 1 it would be camopt's law for one mass; 0.9999 is the largest value that MuJoCo accepts."""


def mjx(steps: int, *, contact: bool) -> Callable[[], Answer]:
    """MuJoCo MJX with its own soft `contact`, or with camopt's law as an applied force that switches by `where`; in
    forward mode, because the loops of its solver have no reverse mode."""
    mujoco: Any = import_module("mujoco")
    mjx: Any = import_module("mujoco.mjx")
    text = MODEL.format(step=END / steps, on=int(contact), stiffness=AT[3], damping=AT[2], radius=RADIUS)
    model = mjx.put_model(mujoco.MjModel.from_xml_string(text))
    rest = mjx.make_data(model)

    def end(numbers):
        speed, distance, c, k = numbers
        solref = jnp.broadcast_to(-jnp.stack([k, c]), model.geom_solref.shape)
        damped = model.replace(geom_solref=solref)

        def step(data, _):
            if not contact:
                x, v = data.qpos[0], data.qvel[0]
                force = jnp.where(x < 0, jnp.maximum(-k * x - c * v, 0.0), 0.0)
                data = data.replace(qfrc_applied=force[None])
            return mjx.step(damped, data), None

        data = rest.replace(qpos=distance[None], qvel=-speed[None])
        data, _ = jax.lax.scan(step, data, None, length=steps)
        return jnp.stack([data.qpos[0], data.qvel[0]]), steps

    return _by_jax(end, jax.jacfwd)


def warp_kernel(steps: int) -> Callable[[], Answer]:
    """NVIDIA Warp with camopt's law in a user-defined kernel: semi-implicit Euler steps, one launch each, in double
    precision on the processor, and one reverse pass of its tape each for position and speed."""
    wp: Any = import_module("warp")
    wp.config.quiet = True
    array, real = wp.array(dtype=wp.float64), wp.float64

    @wp.kernel
    def begin(numbers: array, x: array, v: array):  # pyright: ignore[reportInvalidTypeForm]  # Warp's own types
        x[0] = numbers[1]
        v[0] = -numbers[0]

    @wp.kernel
    def advance(numbers: array, x: array, v: array, i: int, h: real):  # pyright: ignore[reportInvalidTypeForm]
        force = real(0.0)
        if x[i] < real(0.0):
            force = wp.max(-numbers[3] * x[i] - numbers[2] * v[i], real(0.0))
        after = v[i] + h * force
        v[i + 1] = after
        x[i + 1] = x[i] + h * after

    def answer() -> Answer:
        numbers, x, v = (
            wp.array(values, dtype=wp.float64, device="cpu", requires_grad=True)
            for values in (AT, np.zeros(steps + 1), np.zeros(steps + 1))
        )
        tape = wp.Tape()
        with tape:
            wp.launch(begin, dim=1, inputs=[numbers, x, v], device="cpu")
            for i in range(steps):
                wp.launch(advance, dim=1, inputs=[numbers, x, v, i, END / steps], device="cpu")
        rows, last = [], np.zeros(steps + 1)
        last[-1] = 1.0
        for end in (x, v):
            tape.zero()
            tape.backward(grads={end: wp.array(last, dtype=wp.float64, device="cpu")})
            rows.append(numbers.grad.numpy().copy())
        return np.array([x.numpy()[-1], v.numpy()[-1]]), np.stack(rows), steps

    return answer
