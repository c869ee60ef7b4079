"""Elastic laws beyond the linear one in JAX, as functions of the compression u beyond the touch.

They are differentiable in every number of a law.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from camopt.scene.laws import HERTZ, PROGRESSIVE, STAND_IN_FORCE, Laws


class ElasticLaws(eqx.Module):
    """The laws of the elements (e) of a train. A stiffness is in N/m, that of a hertz contact in N/m^exponent."""

    table: jax.Array  # (e, q, 2): compression [m] and stiffness [N/m]; read where progressive
    kind: tuple[int, ...] = eqx.field(static=True)
    exponent: tuple[float, ...] = eqx.field(static=True)

    def touch(self, stiffness: jax.Array, preload: jax.Array) -> jax.Array:
        """Compression at which each elastic force falls to zero [m], shape (e).

        A hertz contact without preload touches at zero, and the derivative by its preload is given as zero; the true
        derivative, by a preload that grows from nothing, is infinite.
        """
        touch = -preload / stiffness
        h, q = self._hertz(preload.dtype)
        pressed = preload[h] > 0
        shift = (jnp.where(pressed, preload[h], 1.0) / stiffness[h]) ** (1.0 / q)
        touch = touch.at[h].set(jnp.where(pressed, -shift, 0.0))
        for e in self._progressive():
            touch = touch.at[e].set(_compression(self.table[e], -preload[e]))
        return touch

    def force(self, u: jax.Array, stiffness: jax.Array, preload: jax.Array) -> jax.Array:
        """Elastic force [N] of every element at the compression u (e) [m] beyond its touch."""
        h, q = self._hertz(u.dtype)
        force = (stiffness * u).at[h].set(stiffness[h] * jnp.maximum(u[h], 0.0) ** q)
        if not self._progressive():
            return force
        d = u + self.touch(stiffness, preload)
        for e in self._progressive():
            zero = jnp.zeros((), u.dtype)
            force = force.at[e].set(preload[e] + _integral(self.table[e], d[e]) - _integral(self.table[e], zero))
        return force

    def stand_in(self, stiffness: jax.Array) -> jax.Array:
        """Constant stiffness [N/m] that stands for each law; see `camopt.scene.laws.Laws.stand_in`."""
        h, q = self._hertz(stiffness.dtype)
        return stiffness.at[h].set(q * stiffness[h] ** (1.0 / q) * STAND_IN_FORCE ** (1.0 - 1.0 / q))

    def _hertz(self, dtype) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the hertz contacts and their exponents."""
        h = np.flatnonzero(np.array(self.kind) == HERTZ)
        return h, np.array(self.exponent)[h].astype(dtype)

    def _progressive(self) -> list[int]:
        return [e for e, kind in enumerate(self.kind) if kind == PROGRESSIVE]


def elastic_laws(laws: Laws, dtype) -> ElasticLaws:
    """The differentiable laws of a train."""
    return ElasticLaws(
        jnp.asarray(laws.table, dtype), tuple(map(int, laws.kind)), tuple(float(q) for q in laws.exponent)
    )


def _pieces(table: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """(compression and stiffness of the rows, its slope behind each row, its integral up to each row), each (q)."""
    c, k = table[:, 0], table[:, 1]
    slope = jnp.append(jnp.diff(k) / jnp.diff(c), 0.0)
    at_rows = jnp.concatenate([jnp.zeros_like(c[:1]), jnp.cumsum(0.5 * (k[1:] + k[:-1]) * jnp.diff(c))])
    return c, k, slope, at_rows


def _integral(table: jax.Array, d: jax.Array) -> jax.Array:
    """Integral of the stiffness from the first row to d [N]."""
    c, k, slope, at_rows = _pieces(table)
    i = jnp.clip(jnp.searchsorted(c, d, side="right") - 1, 0, len(c) - 1)
    w = d - c[i]
    return at_rows[i] + w * (k[i] + 0.5 * slope[i] * jnp.maximum(w, 0.0))


def _compression(table: jax.Array, force: jax.Array) -> jax.Array:
    """Compression at which the integral of the stiffness from 0 equals `force` [m]."""
    c, k, slope, at_rows = _pieces(table)
    wanted = force + _integral(table, jnp.zeros_like(force))
    i = jnp.clip(jnp.searchsorted(at_rows, wanted, side="right") - 1, 0, len(c) - 1)
    rest = wanted - at_rows[i]
    return c[i] + 2.0 * rest / (k[i] + jnp.sqrt(k[i] ** 2 + 2.0 * slope[i] * jnp.maximum(rest, 0.0)))
