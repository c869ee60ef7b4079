"""Greatest and least values with a derivative everywhere, and what their smoothness costs.

For n values, `soft_worst(q, width) = width log sum_i exp(q_i / width)` lies above the greatest of them by a bias of

    0 <= soft_worst - max <= width log n.

The bias is largest where all values are equal (a tie) and goes to 0 with the width. The derivative is the mean of the
values' derivatives with the weights exp((q_i - soft_worst) / width), so that ties share it equally.
The hard maxima of `camopt.smooth.metrics` choose a side instead: at a tie of samples they have the derivative of the
first one; at a tie of contacts, or of a value with its floor (jump and bounce with zero), half of each.
"""

import jax
import jax.numpy as jnp


def soft_worst(values, width, axis=None) -> jax.Array:
    """Smooth stand-in for the greatest of `values` over `axis`, with the bias above; `width` > 0 has their unit."""
    return width * jax.nn.logsumexp(jnp.asarray(values) / width, axis=axis)


def soft_worst_bias(count: int, width) -> float:
    """Largest bias of `soft_worst` of `count` values, in the unit of `width`."""
    return width * float(jnp.log(count))


def soft_least(angle, values, keep, width):
    """Smooth stand-in for the least of `values` over the samples kept: -width log mean exp(-values / width).

    The mean is by angle, so the result lies above the least value, by at most width * log(window / stay), where stay is
    the angle spent within `width` of the least, plus `width`.
    """
    weight = jnp.where(keep[1:] & keep[:-1], jnp.diff(angle), 0.0)
    middle = 0.5 * (values[1:] + values[:-1])
    return -width * jax.nn.logsumexp(-middle / width, b=weight / jnp.sum(weight))


def soft_greatest(angle, values, keep, width):
    """Smooth stand-in for the greatest of `values`; it lies below by at most as much as `soft_least` lies above."""
    return -soft_least(angle, -values, keep, width)
