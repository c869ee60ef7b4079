"""The ball of `gradient_ball` in MuJoCo MJX: with its own soft contact, and with camopt's law as an applied force."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

import jax
import jax.numpy as jnp

from experiments.support.gradient_ball import AT, END, Answer, _by_jax

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
"""A sphere on a plane. MuJoCo's soft contact with a negative solref has a stiffness and a damping per mass; it never
pulls. At an impedance of 1 it would be camopt's law for one mass; 0.9999 is the largest that MuJoCo takes."""


def mjx_contact(steps: int) -> Callable[[], Answer]:
    """MJX's own contact: derivatives go through its solver, forwards, since its loops know no reverse mode."""
    return _method(steps, contact=True)


def mjx_force(steps: int) -> Callable[[], Answer]:
    """camopt's law as a force that is applied at every step, by `where`; the same integrator."""
    return _method(steps, contact=False)


def _method(steps: int, *, contact: bool) -> Callable[[], Answer]:
    mujoco: Any = import_module("mujoco")
    mjx: Any = import_module("mujoco.mjx")
    text = MODEL.format(step=END / steps, on=int(contact), stiffness=AT[3], damping=AT[2], radius=RADIUS)
    model = mjx.put_model(mujoco.MjModel.from_xml_string(text))
    rest = mjx.make_data(model)

    def end(numbers):
        speed, distance, c, k = numbers
        solref = jnp.broadcast_to(-jnp.stack([k, c]), model.geom_solref.shape)
        own = model.replace(geom_solref=solref)

        def step(data, _):
            if not contact:
                x, v = data.qpos[0], data.qvel[0]
                force = jnp.where(x < 0, jnp.maximum(-k * x - c * v, 0.0), 0.0)
                data = data.replace(qfrc_applied=force[None])
            return mjx.step(own, data), None

        data = rest.replace(qpos=distance[None], qvel=-speed[None])
        data, _ = jax.lax.scan(step, data, None, length=steps)
        return jnp.stack([data.qpos[0], data.qvel[0]]), steps

    return _by_jax(end, jax.jacfwd)
