"""The equations of motion of a valve train in JAX, assembled from the scene's SI arrays."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from camopt.scene.shapes import Float
from camopt.scene.train import Train
from camopt.smooth.contact import Layer, raw_force
from camopt.smooth.laws import ElasticLaws, elastic_laws

Array = Any  # of JAX, or of NumPy where nothing is traced
"""What a differentiable function takes: arrays of JAX, traced or not, or of NumPy."""


class Topology(NamedTuple):
    """Which masses and elements are connected how. It is hashable, so that one program is compiled per topology and not
    per value."""

    a: tuple[int, ...]
    b: tuple[int, ...]
    contact: tuple[bool, ...]
    cam_driven: tuple[bool, ...]
    valve: int
    seat: int
    cam_side: tuple[int, ...]

    @property
    def contacts(self) -> np.ndarray:
        """Indices of the contacts among the elements."""
        return np.flatnonzero(self.contact)

    def incidence(self, masses: int) -> Float[Array, "e n"]:
        """Matrix D with d = D x + cam_driven * lift - gap."""
        rows = np.zeros((len(self.a), masses + 1))  # the last column is the ground
        for e, (a, b) in enumerate(zip(self.a, self.b, strict=True)):
            rows[e, a] += 1.0
            rows[e, b] -= 1.0
        return rows[:, :masses]


class SystemState(NamedTuple):
    """Samples of a motion at one speed, revolution after revolution from -pi; repeated angles are allowed."""

    angle: Float[Array, " k"]  # rad
    lift: Float[Array, " k"]  # m
    x: Float[Array, "k n"]  # m
    v: Float[Array, "k n"]  # m/s
    force: Float[Array, "k e"]  # N
    force_dtheta: Float[Array, "k e"] | None = None  # N/rad, where it is known
    lift_dtheta: Float[Array, " k"] | None = None  # m/rad, where it is known


class System(eqx.Module):
    """A valve train as a pytree: every array may be differentiated with respect to.

    States y have the shape (2, n), or (2, n, b) for b motions side by side. The axis of the batch comes last, where it
    costs least. Lift and its rate are then scalars or (b).
    """

    mass: Float[Array, " n"]  # kg
    mass_damping: Float[Array, " n"]  # N s/m
    mass_force: Float[Array, " n"]  # N
    stiffness: Float[Array, " e"]  # N/m, of a hertz contact N/m^exponent
    damping: Float[Array, " e"]  # N s/m
    preload: Float[Array, " e"]  # N
    gap: Float[Array, " e"]  # m
    topology: Topology = eqx.field(static=True)
    laws: ElasticLaws | None = None  # None: every law is linear

    def compression(
        self, y: Float[Array, "2 n *b"], lift, lift_dt
    ) -> tuple[Float[Array, " e *b"], Float[Array, " e *b"]]:
        """Compression of every element beyond the zero of its elastic force [m] and its rate [m/s]."""
        rows = self._incidence(y.dtype)
        d, d_dt = (jnp.matmul(rows, q, precision="highest") for q in (y[0], y[1]))
        drive = column(np.array(self.topology.cam_driven, dtype=y.dtype), d)
        lift, lift_dt = (jnp.reshape(q, (1,) * (d.ndim - jnp.ndim(q)) + jnp.shape(q)) for q in (lift, lift_dt))
        return d + drive * lift - column(self.gap + self.touch(), d), d_dt + drive * lift_dt

    def force(self, y: Float[Array, "2 n *b"], lift, lift_dt, layer: Layer) -> Float[Array, " e *b"]:
        """Force of every element [N]; it pushes a towards -x and b towards +x."""
        u, u_dt = self.compression(y, lift, lift_dt)
        pushing = self.raw_force(u, u_dt, layer)
        bilateral = self.elastic(u) + column(self.damping, u) * u_dt
        return bilateral.at[self.topology.contacts].set(jnp.where(pushing > 0.0, pushing, 0.0))

    def raw_force(
        self, u: Float[Array, " e *b"], u_dt: Float[Array, " e *b"], layer: Layer
    ) -> Float[Array, " contacts *b"]:
        """Force of every contact [N], in the order of the elements, before it is clipped at zero."""
        pick = self.topology.contacts
        damping = column(self.damping, u)
        if self.laws is None:
            return raw_force(u[pick], u_dt[pick], column(self.stiffness, u)[pick], damping[pick], layer)
        return raw_force(u, u_dt, self.elastic, damping, layer)[pick]

    def touch(self) -> Float[Array, " e"]:
        """Compression at which each elastic force is zero [m]."""
        return -self.preload / self.stiffness if self.laws is None else self.laws.touch(self.stiffness, self.preload)

    def elastic(self, u: Float[Array, " e *b"]) -> Float[Array, " e *b"]:
        """Elastic force [N] of every element at the compression u [m] beyond its touch."""
        if self.laws is None:
            return column(self.stiffness, u) * u
        force = self.laws.force if u.ndim == 1 else jax.vmap(self.laws.force, (-1, None, None), -1)
        return force(u, self.stiffness, self.preload)

    def rate(self, y: Float[Array, "2 n *b"], lift, lift_dt, layer: Layer) -> Float[Array, "2 n *b"]:
        """Time derivative of the state y = (positions [m], velocities [m/s]) at lift [m] and lift rate [m/s]."""
        force = self.force(y, lift, lift_dt, layer)
        on_mass = jnp.matmul(self._incidence(y.dtype).T, force, precision="highest")
        mass, drag, load = (column(q, on_mass) for q in (self.mass, self.mass_damping, self.mass_force))
        return jnp.stack([y[1], (load - drag * y[1] - on_mass) / mass])

    def stiffest(self) -> jax.Array:
        """Largest frequency of a mass on its own elements [rad/s]: the scale of the fastest motion."""
        stiffness = self.stiffness if self.laws is None else self.laws.stand_in(self.stiffness)
        return jnp.sqrt(jnp.max(stiffness @ jnp.abs(self._incidence(self.mass.dtype)) / self.mass))

    def _incidence(self, dtype) -> np.ndarray:
        return self.topology.incidence(self.mass.shape[0]).astype(dtype)


def column(values, like: jax.Array):
    """`values` (e) with an axis appended for each axis that `like` has beyond its first, so that batches broadcast."""
    return values.reshape(values.shape + (1,) * (like.ndim - 1))


def build_system(train: Train, dtype=jnp.float64) -> System:
    """The differentiable system of a train."""
    topology = Topology(
        tuple(map(int, train.a)),
        tuple(map(int, train.b)),
        tuple(map(bool, train.contact)),
        tuple(map(bool, train.cam_driven)),
        train.valve,
        train.seat,
        tuple(map(int, train.cam_side)),
    )
    laws = None if train.laws is None else elastic_laws(train.laws, dtype)
    return System(**{k: jnp.asarray(v, dtype) for k, v in train.parameters.items()}, topology=topology, laws=laws)
