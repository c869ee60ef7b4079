"""The smoothed contact law: a ramp S of width `eps` stands in for max(0, .).

With u the compression beyond the touch (d + preload / k), the force of a contact is

    f = clip_0( p(eps S(u / eps)) + c u' S'(u / eps) ),    p(u) = k u where the elastic law is linear,

and c grows by dissipation p under a law of contacts that loses energy by itself.

S is either the compact ramp or the softplus. The compact ramp equals max(0, r) outside |r| < 1/2 and is twice
continuously differentiable. Outside its layer it *is* the law of the non-smooth model, so that the resting force has no
bias; softplus has one, since it pushes with k eps ln 2 at the touch itself.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp


class SmoothingRamp(NamedTuple):
    """A smooth stand-in for max(0, r), its derivative, its layer |r| < half_width, and the steps the layer needs."""

    value: Callable[[jax.Array], jax.Array]
    slope: Callable[[jax.Array], jax.Array]
    half_width: float
    steps: int


def _compact_value(r: jax.Array) -> jax.Array:
    z = jnp.clip(r + 0.5, 0.0, 1.0)
    return jnp.where(r < 0.5, z**3 * (1.0 - 0.5 * z), r)


def _compact_slope(r: jax.Array) -> jax.Array:
    z = jnp.clip(r + 0.5, 0.0, 1.0)
    return z * z * (3.0 - 2.0 * z)


RAMPS = {
    "compact": SmoothingRamp(_compact_value, _compact_slope, 0.5, 4),
    "softplus": SmoothingRamp(jax.nn.softplus, jax.nn.sigmoid, 20.0, 80),
}
"""Ramps by name. Softplus has no edge; at |r| = 20 it is e^-20 of its width away from its asymptotes."""


class Layer(eqx.Module):
    """The layer in which contacts begin to push: its width `eps` > 0 [m], and the name of the ramp across it.

    Derivatives may be taken by the width; a program is compiled per ramp.
    """

    eps: jax.Array | float
    ramp: str = eqx.field(static=True, default="compact")

    @property
    def half_width(self):
        """Compression [m] below which nothing pushes, and beyond which the law is that of the non-smooth model."""
        return RAMPS[self.ramp].half_width * self.eps


def raw_force(u, u_dot, stiffness, damping, layer: Layer) -> jax.Array:
    """p(eps S(u / eps)) + c u' S'(u / eps) [N], before it is clipped at zero; arguments as for `contact_force`."""
    smooth, eps = RAMPS[layer.ramp], layer.eps
    pressed = smooth.value(u / eps)
    elastic = stiffness(eps * pressed) if callable(stiffness) else stiffness * eps * pressed
    damper = damping(elastic) if callable(damping) else damping
    return elastic + damper * u_dot * smooth.slope(u / eps)


def contact_force(u, u_dot, stiffness, damping, layer: Layer) -> jax.Array:
    """Force of contacts [N], never below zero, any shape.

    `u` [m] is the compression beyond the touch and `u_dot` [m/s] its rate.
    `stiffness` [N/m], or the elastic force p [N] as a function of the compression beyond the touch; `damping` [N s/m],
    or the same as a function of the elastic force.
    Source: design of this project; the limit eps -> 0 is max(0, k u + c u') for u > 0 and 0 otherwise.
    """
    force = raw_force(u, u_dot, stiffness, damping, layer)
    return jnp.where(force > 0.0, force, 0.0)
