"""Readings of sampled values in JAX: values, extremes, roots and integrals between the samples, differentiable.

A reading between samples has the derivative of the interpolant there, and a root that of the implicit function theorem.
"""

import jax
import jax.numpy as jnp

from camopt.scene.shapes import Float
from camopt.smooth.system import Array


def time_to_fall(coefficients, level, most):
    """Time in [0, most] at which sum_k coefficients[k] t^k has fallen to `level`, with its derivative.

    Bisection finds it; one Newton step carries the derivative (implicit function theorem).
    """
    series = jnp.stack(coefficients)[::-1]
    frozen, fixed = jax.lax.stop_gradient((series, level))

    def halve(_, bracket):
        low, high = bracket
        middle = 0.5 * (low + high)
        above = jnp.polyval(frozen, middle) > fixed
        return jnp.where(above, middle, low), jnp.where(above, high, middle)

    most = jax.lax.stop_gradient(most)
    low, high = jax.lax.fori_loop(0, 50, halve, (jnp.zeros_like(most), most))
    t = 0.5 * (low + high)
    speed = jnp.polyval(jnp.polyder(frozen), t)
    falling = speed < 0
    value = jnp.polyval(series, t) - level
    return t - jnp.where(falling, (value - jax.lax.stop_gradient(value)) / jnp.where(falling, speed, -1.0), 0.0)


def cubic(start, rise, m0, m1):
    """Coefficients of the cubic on [0, 1] that begins at `start`, rises by `rise` and has the end slopes m0 and m1.

    SciPy's CubicHermiteSpline cannot be differentiated by its values.
    """
    return start, m0, 3 * rise - 2 * m0 - m1, m0 + m1 - 2 * rise


def at_angle(angle: Float[Array, " k"], values: Float[Array, " k"], theta, slope: Float[Array, " k"] | None = None):
    """`values` at the angle theta: linear inside a step or, with their `slope` by angle, the cubic."""
    i = jnp.clip(jnp.searchsorted(angle, jax.lax.stop_gradient(theta), side="right") - 1, 0, len(angle) - 2)
    width = angle[i + 1] - angle[i]
    t = jnp.where(width > 0, (theta - angle[i]) / jnp.where(width > 0, width, 1.0), 0.0)
    rise = values[i + 1] - values[i]
    linear = values[i] + t * rise
    if slope is None:
        return linear
    return linear + t * (1 - t) * ((1 - t) * (slope[i] * width - rise) - t * (slope[i + 1] * width - rise))


def step_integral(angle: Float[Array, " k"], s: Float[Array, " k"], s_dtheta: Float[Array, " k"], keep):
    """Integrals of max(0, s) and max(0, s)^2 over the steps kept, by Simpson's rule with the cubic in the middle."""
    width = jnp.diff(angle)
    middle = 0.5 * (s[1:] + s[:-1]) - width * jnp.diff(s_dtheta) / 8

    def simpson(f):
        return jnp.sum(jnp.where(keep, width / 6 * (f(s[:-1]) + 4 * f(middle) + f(s[1:])), 0.0))

    return simpson(lambda q: jnp.maximum(q, 0.0)), simpson(lambda q: jnp.maximum(q, 0.0) ** 2)


def least(angle: Float[Array, " k"], values: Float[Array, " k"], edges):
    """Smallest of `values` at samples between the edges, refined by the parabola through it and its neighbours.

    A minimum between samples has the derivative of the interpolant at its foot, not that of the nearest sample. No
    parabola is drawn through an exact zero: the force of a contact jumps from there where it closes.
    """
    keep = (angle >= edges[0]) & (angle <= edges[1])
    i = jnp.clip(jnp.argmin(jnp.where(keep, values, jnp.inf)), 1, len(values) - 2)
    left, right = angle[i] - angle[i - 1], angle[i + 1] - angle[i]
    free = (values[i - 1] != 0) & (values[i] != 0) & (values[i + 1] != 0)
    proper = (left > 0) & (right > 0) & keep[i] & free
    left, right = jnp.where(proper, left, 1.0), jnp.where(proper, right, 1.0)
    before, after = (values[i] - values[i - 1]) / left, (values[i + 1] - values[i]) / right
    curve = (after - before) / (left + right)
    slope = before + left * curve
    proper = proper & (curve > 0)
    shift = jnp.clip(-slope / (2 * jnp.where(proper, curve, 1.0)), -left, right)
    shift = jnp.clip(shift, edges[0] - angle[i], edges[1] - angle[i])
    refined = values[i] + jax.lax.stop_gradient(shift) * (slope + jax.lax.stop_gradient(shift) * curve)
    return jnp.where(proper, refined, jnp.min(jnp.where(keep, values, jnp.inf)))


def greatest(at: Float[Array, " k"], s: Float[Array, " k"], v: Float[Array, " k"], edges):
    """Greatest s at samples between the edges, raised to the crest of the cubic beside it; v is the slope by `at`.

    The place of the crest is held fixed. The crest of a force may lie in the layer of its contact, where a damped
    contact closes: its derivative then includes how the closing shifts, that at the sample behind would not.
    """
    keep = (at >= edges[0]) & (at <= edges[1])
    i = jnp.argmax(jnp.where(keep, s, -jnp.inf))
    j = jnp.clip(jnp.where(v[i] > 0, i, i - 1), 0, len(s) - 2)  # the crest lies between j and j + 1
    h, (v0, v1) = at[j + 1] - at[j], jax.lax.stop_gradient((v[j], v[j + 1]))
    proper = (v0 > 0) & (v1 < 0)
    start, m0, second, third = cubic(s[j], s[j + 1] - s[j], v[j] * h, v[j + 1] * h)
    m1 = v[j + 1] * h
    t = jax.lax.stop_gradient(jnp.where(proper, _fall_through_zero(m0, m1, second, third), 0.0))
    proper = proper & (at[j] + t * h >= edges[0]) & (at[j] + t * h <= edges[1])
    crest = start + t * (m0 + t * (second + t * third))
    return jnp.where(proper, crest, jnp.max(jnp.where(keep, s, -jnp.inf)))


def _fall_through_zero(m0, m1, second, third):
    """Place in [0, 1] at which m0 + 2 second t + 3 third t^2 falls from m0 > 0 through zero to m1 < 0."""
    t = m0 / jnp.where(m0 > m1, m0 - m1, 1.0)
    for _ in range(4):  # Newton; where the slope is not that of a fall the secant's serves
        slope = 2 * second + 6 * third * t
        slope = jnp.where(slope < 0, slope, jnp.where(m0 > m1, m1 - m0, -1.0))
        t = jnp.clip(t - (m0 + t * (2 * second + 3 * third * t)) / slope, 0.0, 1.0)
    return t


def separation_angle(angle: Float[Array, " k"], margin: Float[Array, " k"], edges):
    """Total angle between the edges at which a contact is apart (margin < 0) [rad], crossings linear inside steps."""
    low, high = jnp.minimum(margin[1:], margin[:-1]), jnp.maximum(margin[1:], margin[:-1])
    spread = jnp.where(high > low, high - low, 1.0)
    share = jnp.where(high <= 0, jnp.where(low < 0, 1.0, 0.0), jnp.clip(-low / spread, 0.0, 1.0))
    width = jnp.minimum(angle[1:], edges[1]) - jnp.maximum(angle[:-1], edges[0])
    return jnp.sum(jnp.maximum(width, 0.0) * share)


def greatest_between(angle, values, slopes, edges, sign=1.0):
    """Greatest of sign * values (k) from one angle to another, by cubics or, without their `slopes`, by parabolas."""
    values, slopes = sign * values, None if slopes is None else sign * slopes
    crest = -least(angle, -values, edges) if slopes is None else greatest(angle, values, slopes, edges)
    return jnp.max(jnp.stack([crest, *(at_angle(angle, values, edge, slopes) for edge in edges)]))
