"""Rest on the base circle in JAX, from a system's numbers alone, so that it can be traced, batched and differentiated.

The NumPy side (`camopt.scene.rest`) tries the sets of closed contacts and reports what is wrong with a scene. Here rest
is found as the minimum of the elastic energy, which is convex, by Newton's method with a step that is halved while it
overshoots; the NumPy side does the same for nonlinear laws.
"""

import jax
import jax.numpy as jnp
import numpy as np

from camopt.scene.rest import state_at_rest
from camopt.scene.shapes import Float
from camopt.scene.train import Train
from camopt.smooth.system import Array, System, stacked

MOST_CONTACT_SETS = 200
"""Largest number of Newton steps; ten are usual."""
MOST_HALVINGS = 40
SLACK = 1e-9
"""Largest unbalanced force at rest, over the largest given force; in float32 it is a hundred units of rounding."""
GROUNDING = 1e-12
"""Stiffness to ground that a Newton step adds, relative to the train's largest stiffness: with it, a step can cross
contacts that are open."""


def balance(system: System, x: Float[Array, " n"]) -> tuple[Float[Array, " n"], Float[Array, "n n"]]:
    """Unbalanced force [N] at the positions x [m], lift zero, and the stiffness matrix there."""
    rows = jnp.asarray(system.topology.incidence(x.shape[0]), x.dtype)
    u, _ = system.compression(jnp.stack([x, jnp.zeros_like(x)]), 0.0, 0.0)
    force, tangent = jax.jvp(system.elastic, (u,), (jnp.ones_like(u),))
    carries = ~np.array(system.topology.contact) | (u > 0.0)
    force, tangent = (jnp.where(carries, q, 0.0) for q in (force, tangent))
    return system.mass_force - force @ rows, rows.T @ (tangent[:, None] * rows)


def newton_step(stiffness: Float[Array, "n n"], force: Float[Array, " n"], ground) -> Float[Array, " n"]:
    """Solution of (stiffness + ground) step = force, rows and columns scaled by their diagonal."""
    stiffness = stiffness + ground * jnp.eye(len(force), dtype=force.dtype)
    scale = jnp.sqrt(jnp.diag(stiffness))
    return jnp.linalg.solve(stiffness / jnp.outer(scale, scale), force / scale) / scale


@jax.jit
def rest_positions(system: System) -> Float[Array, " n"]:
    """Positions at rest on the base circle [m], differentiable by the implicit function theorem.

    They are NaN if no rest is found, because nothing holds a mass. A contact whose force at rest is exactly zero counts
    as open, so that the derivative there is the one-sided derivative towards open.
    """
    frozen = jax.lax.stop_gradient(system)
    ground = GROUNDING * jnp.max(frozen.stiffness)
    largest = jnp.maximum(jnp.max(jnp.abs(frozen.preload)), jnp.max(jnp.abs(frozen.mass_force)))
    slack = max(SLACK, 100 * float(jnp.finfo(frozen.mass.dtype).eps)) * jnp.maximum(largest, 1.0)

    def more(search):
        _, unbalanced, steps = search
        return (jnp.max(jnp.abs(unbalanced)) > slack) & (steps < MOST_CONTACT_SETS)

    def improve(search):
        x, unbalanced, steps = search
        step = newton_step(balance(frozen, x)[1], unbalanced, ground)
        gain = jnp.abs(unbalanced @ step)

        def overshoots(halving):
            share, count = halving
            return (balance(frozen, x + share * step)[0] @ step < -0.1 * gain) & (count < MOST_HALVINGS)

        share, _ = jax.lax.while_loop(overshoots, lambda h: (0.5 * h[0], h[1] + 1), (jnp.ones_like(gain), 0))
        x = x + share * step
        return x, balance(frozen, x)[0], steps + 1

    x = jnp.zeros_like(frozen.mass)
    x, unbalanced, _ = jax.lax.while_loop(more, improve, (x, balance(frozen, x)[0], jnp.asarray(0)))
    stiffness = jax.lax.stop_gradient(balance(frozen, x)[1])
    rest = x + newton_step(stiffness, balance(system, x)[0], 0.0)
    return jnp.where(jnp.max(jnp.abs(unbalanced)) <= slack, rest, jnp.nan)


def rest_state(train: Train) -> Float[Array, "2 n"]:
    """State (2, n + r) of a train at rest on the base circle, found without JAX; every memory has relaxed.

    Raises InputError if there is no rest (see `camopt.scene.rest`).
    """
    return stacked(state_at_rest(train), len(train.mass))


def rest_of(system: System) -> Float[Array, "2 n"]:
    """The same state of a system, NaN if there is no rest."""
    x = rest_positions(system)
    at_rest = jnp.stack([x, jnp.zeros_like(x)])
    if not system.topology.memory:
        return at_rest
    z = system.compression(at_rest, 0.0, 0.0)[0][np.array(system.topology.memory)]
    return jnp.concatenate([at_rest, jnp.stack([z, jnp.zeros_like(z)])], axis=1)
