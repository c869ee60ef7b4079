"""The smoothed law of contacts, and laws beyond the linear one, in JAX.

A ramp S of width `eps` replaces max(0, .). With u the compression beyond the touch, the force of a contact is

    f = clip_0( p(eps S(u / eps)) + c u' S'(u / eps) ),    p(u) = k u where the elastic law is linear,

and c is increased by dissipation p under a contact law with an energy loss of its own. S equals max(0, r) outside |r| <
1/2 and is twice continuously differentiable: outside its layer the law *is* that of the non-smooth model, so that the
resting force has no bias. Other laws are functions of u, and of memories.

They are differentiable in every number of a law. The corners of a force table are rounded over the width eps of the
contact's layer, by the same ramp S and its slope H = S': p is continued along its first line, and each corner at c adds
its change of slope times eps S((d - c) / eps). With s = d - z, oil and friction have

    oil        f = k eps S((s - travel) / eps),  z' = f / leak - max(0, -d') H(-s / eps)
    friction   f = k s,                          z' = sign(s) max(0, sign(s) d') H((|s| - slip / k) / eps)

so that oil fills, and friction slides, before s is more than eps / 2 beyond its bound.
"""

from collections.abc import Iterator

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from camopt.scene.laws import FRICTION, OF_CONTACTS, OIL, PROGRESSIVE, STAND_IN_FORCE, TABLE, ContactLaw, Laws
from camopt.scene.train import LAW_PARAMETERS


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


class ElasticLaws(eqx.Module):
    """The laws of the elements (e) of a train. A stiffness is in N/m, that of a law of contacts in N/m^exponent."""

    dissipation: jax.Array  # (e) s/m, of laws of contacts
    table: jax.Array  # (e, q, 2): compression [m] and stiffness [N/m] where progressive, force [N] where a table
    leak: jax.Array  # (e) N s/m, of oil
    travel: jax.Array  # (e) m, of oil
    slip: jax.Array  # (e) N, of friction
    kind: tuple[int, ...] = eqx.field(static=True)
    own_number: tuple[float, ...] = eqx.field(static=True)
    dissipative: bool = eqx.field(static=True)

    def touch(self, stiffness: jax.Array, preload: jax.Array) -> jax.Array:
        """Compression at which each elastic force falls to zero [m], shape (e).

        A law of contacts without preload touches at zero, and the derivative by its preload is given as zero; the true
        derivative, by a preload that grows from nothing, is infinite.
        """
        touch = -preload / stiffness
        for h, law in self._of_contacts(stiffness):
            pressed = preload[h] > 0
            shift = law.depth(jnp.where(pressed, preload[h], 1.0))
            touch = touch.at[h].set(jnp.where(pressed, -shift, 0.0))
        for e in self._of(PROGRESSIVE):
            touch = touch.at[e].set(_compression(self.table[e], -preload[e]))
        for e in self._of(TABLE):
            touch = touch.at[e].set(_zero_of_lines(self.table[e]))
        return touch

    def force(self, u: jax.Array, stiffness: jax.Array, preload: jax.Array, layer: Layer | None = None) -> jax.Array:
        """Elastic force [N] of every element at the compression u (e) [m] beyond its touch; zero with a memory."""
        force = stiffness * u
        for h, law in self._of_contacts(stiffness):
            pressed = u[h] > 0.0  # else the second slope of a power, used by rates of forces, is NaN
            force = force.at[h].set(jnp.where(pressed, law.elastic(jnp.where(pressed, u[h], 1.0)), 0.0))
        force = force.at[np.array(self.memory, dtype=int)].set(0.0)
        if not self._of(PROGRESSIVE) and not self._of(TABLE):
            return force
        d = u + self.touch(stiffness, preload)
        for e in self._of(TABLE):
            force = force.at[e].set(_on_lines(self.table[e], d[e], layer))
        for e in self._of(PROGRESSIVE):
            zero = jnp.zeros((), u.dtype)
            force = force.at[e].set(preload[e] + _integral(self.table[e], d[e]) - _integral(self.table[e], zero))
        return force

    def stand_in(self, stiffness: jax.Array) -> jax.Array:
        """Constant stiffness [N/m] that stands for each law; see `camopt.scene.laws.Laws.stand_in`."""
        stands = stiffness
        for h, law in self._of_contacts(stiffness):
            stands = stands.at[h].set(law.slope(law.depth(STAND_IN_FORCE)))
        return stands

    @property
    def memory(self) -> list[int]:
        """The elements with a memory."""
        return [e for e, kind in enumerate(self.kind) if kind in (OIL, FRICTION)]

    def remembered(self, slack: jax.Array, stiffness: jax.Array, layer: Layer) -> jax.Array:
        """Force (r, *b) [N] of the elements with a memory, `slack` (r, *b) [m] being d - z."""
        forces = []
        for s, e in zip(slack, self.memory, strict=True):
            pressed = s if self.kind[e] == FRICTION else _ramp(s - self.travel[e], layer)
            forces.append(stiffness[e] * pressed)
        return jnp.stack(forces)

    def memory_rate(self, slack, d_dt, force, stiffness, layer: Layer) -> jax.Array:
        """Rates (r, *b) [m/s] of the memories, from the rates d' (r, *b) and the forces (r, *b) of their elements."""
        rates = []
        for s, rate, f, e in zip(slack, d_dt, force, self.memory, strict=True):
            if self.kind[e] == OIL:
                rates.append(f / self.leak[e] - jnp.maximum(0.0, -rate) * layer.slope(-s / layer.eps))
            else:
                side, beyond = jnp.where(s > 0.0, 1.0, -1.0), jnp.abs(s) - self.slip[e] / stiffness[e]
                rates.append(side * jnp.maximum(0.0, side * rate) * layer.slope(beyond / layer.eps))
        return jnp.stack(rates)

    def bounds(self, slack: jax.Array, stiffness: jax.Array) -> jax.Array:
        """Distances [m] (m, *b) beyond the bounds at which memories move or oil pushes: the middles of layers."""
        distances = []
        for s, e in zip(slack, self.memory, strict=True):
            sliding = jnp.abs(s) - self.slip[e] / stiffness[e]
            distances += (s - self.travel[e], -s) if self.kind[e] == OIL else (sliding,)
        return jnp.stack(distances)

    def _of_contacts(self, stiffness: jax.Array) -> Iterator[tuple[np.ndarray, ContactLaw]]:
        """The elements of each law of contacts, and the law with their numbers."""
        for kind in sorted(set(self.kind) & set(OF_CONTACTS)):
            h = np.array(self._of(kind))
            yield h, OF_CONTACTS[kind](stiffness[h], np.array(self.own_number, stiffness.dtype)[h])

    def _of(self, law: int) -> list[int]:
        return [e for e, kind in enumerate(self.kind) if kind == law]


def elastic_laws(laws: Laws, dtype) -> ElasticLaws:
    """The differentiable laws of a train."""
    numbers = {name: jnp.asarray(getattr(laws, name), dtype) for name in LAW_PARAMETERS}
    kind, own_number = tuple(map(int, laws.kind)), tuple(float(q) for q in laws.own_number)
    return ElasticLaws(**numbers, kind=kind, own_number=own_number, dissipative=bool(laws.dissipation.any()))


def _ramp(r: jax.Array, layer: Layer | None) -> jax.Array:
    """max(0, r), rounded over the width of a layer if there is one."""
    return jnp.maximum(0.0, r) if layer is None else layer.eps * layer.ramp(r / layer.eps)


def _on_lines(table: jax.Array, d: jax.Array, layer: Layer | None) -> jax.Array:
    """Force [N] at the compression d [m] on the straight lines through a table's rows (q, 2)."""
    c, force = table[:, 0], table[:, 1]
    slope = jnp.diff(force) / jnp.diff(c)
    bends = jnp.diff(slope) * _ramp(d - c[1:-1], layer)
    return force[0] + slope[0] * (d - c[0]) + jnp.sum(bends)


def _zero_of_lines(table: jax.Array) -> jax.Array:
    """Compression [m] at which the straight lines through a table's rows, whose forces ascend, pass through zero."""
    c, force = table[:, 0], table[:, 1]
    i = jnp.clip(jnp.searchsorted(force, 0.0, side="right", method="compare_all") - 1, 0, len(c) - 2)
    return c[i] - force[i] * (c[i + 1] - c[i]) / (force[i + 1] - force[i])


def _pieces(table: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """(compression and stiffness of the rows, its slope behind each row, its integral up to each row), each (q)."""
    c, k = table[:, 0], table[:, 1]
    slope = jnp.append(jnp.diff(k) / jnp.diff(c), 0.0)
    at_rows = jnp.concatenate([jnp.zeros_like(c[:1]), jnp.cumsum(0.5 * (k[1:] + k[:-1]) * jnp.diff(c))])
    return c, k, slope, at_rows


def _integral(table: jax.Array, d: jax.Array) -> jax.Array:
    """Integral of the stiffness from the first row to d [N]."""
    c, k, slope, _ = _pieces(table)
    bends = jnp.diff(slope, prepend=0.0) * jnp.maximum(d - c, 0.0) ** 2
    return k[0] * (d - c[0]) + 0.5 * jnp.sum(bends)


def _compression(table: jax.Array, force: jax.Array) -> jax.Array:
    """Compression at which the integral of the stiffness from 0 equals `force` [m]."""
    c, k, slope, at_rows = _pieces(table)
    wanted = force + _integral(table, jnp.zeros_like(force))
    i = jnp.clip(jnp.searchsorted(at_rows, wanted, side="right", method="compare_all") - 1, 0, len(c) - 1)
    rest = wanted - at_rows[i]
    return c[i] + 2.0 * rest / (k[i] + jnp.sqrt(k[i] ** 2 + 2.0 * slope[i] * jnp.maximum(rest, 0.0)))
