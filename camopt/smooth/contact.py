"""The smoothed contact law: a ramp S of width `eps` stands in for max(0, .).

With u the compression beyond the touch (d + preload / k), the force of a contact is

    f = clip_0( p(eps S(u / eps)) + c u' S'(u / eps) ),    p(u) = k u where the elastic law is linear,

and c grows by dissipation p under a law of contacts that loses energy by itself.

The ramp S equals max(0, r) outside |r| < 1/2 and is twice continuously differentiable. Outside its layer it *is* the
law of the non-smooth model, so that the resting force has no bias.
"""

import equinox as eqx
import jax
import jax.numpy as jnp


class Layer(eqx.Module):
    """The layer in which contacts begin to push: its width `eps` > 0 [m], by which derivatives may be taken."""

    eps: jax.Array | float

    @property
    def half_width(self):
        """Compression [m] below which nothing pushes, and beyond which the law is that of the non-smooth model."""
        return 0.5 * self.eps

    def ramp(self, r: jax.Array) -> jax.Array:
        """The smooth stand-in S for max(0, r), of a compression r in units of eps."""
        z = jnp.clip(r + 0.5, 0.0, 1.0)
        return jnp.where(r < 0.5, z**3 * (1.0 - 0.5 * z), r)

    def slope(self, r: jax.Array) -> jax.Array:
        """The derivative S' of the ramp."""
        z = jnp.clip(r + 0.5, 0.0, 1.0)
        return z * z * (3.0 - 2.0 * z)


def raw_force(u, u_dot, stiffness, damping, layer: Layer) -> jax.Array:
    """p(eps S(u / eps)) + c u' S'(u / eps) [N] of contacts, before it is clipped at zero, any shape.

    `u` [m] is the compression beyond the touch and `u_dot` [m/s] its rate. `stiffness` [N/m], or the elastic force p
    [N] as a function of the compression beyond the touch; `damping` [N s/m], or the same as a function of the elastic
    force. Source: design of this project; the limit eps -> 0 is k u + c u' for u > 0 and 0 otherwise.
    """
    eps = layer.eps
    pressed = layer.ramp(u / eps)
    elastic = stiffness(eps * pressed) if callable(stiffness) else stiffness * eps * pressed
    damper = damping(elastic) if callable(damping) else damping
    return elastic + damper * u_dot * layer.slope(u / eps)
