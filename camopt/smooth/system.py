"""The equations of motion of a valve train in JAX, assembled from the scene's SI arrays."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from camopt.scene.shapes import Float
from camopt.scene.train import TRAIN_PARAMETERS, Train
from camopt.smooth.laws import ElasticLaws, Layer, elastic_laws, raw_force

Array = Any  # of JAX, or of NumPy where nothing is traced
"""Arguments of differentiable functions: arrays of JAX, traced or not, or of NumPy."""


class Topology(NamedTuple):
    """How masses and elements are connected; hashable, so that one program is compiled per topology, not per value."""

    a: tuple[int, ...]
    b: tuple[int, ...]
    contact: tuple[bool, ...]
    cam_driven: tuple[bool, ...]
    valve: int
    seat: int
    cam_side: tuple[int, ...]
    memory: tuple[int, ...] = ()  # elements
    adjusters: tuple[int, ...] = ()  # numbers of the memories of the oil between cam and valve
    forced: tuple[int, ...] = ()  # masses of the forces by the cam angle

    @property
    def contacts(self) -> np.ndarray:
        """Indices of the contacts among the elements."""
        return np.flatnonzero(self.contact)

    def incidence(self, masses: int) -> Float[Array, "e n"]:
        """Matrix D with d = D x + cam_driven * lift - gap."""
        ends = np.eye(masses + 1)[:, :masses]  # the last row, which the index -1 reads: the ground
        return ends[list(self.a)] - ends[list(self.b)]


class SystemState(NamedTuple):
    """Samples of a motion at one speed, revolution after revolution from -pi; repeated angles are allowed."""

    angle: Float[Array, " k"]  # rad
    lift: Float[Array, " k"]  # m
    x: Float[Array, "k n"]  # m
    v: Float[Array, "k n"]  # m/s
    force: Float[Array, "k e"]  # N
    force_dtheta: Float[Array, "k e"]  # N/rad
    lift_dtheta: Float[Array, " k"]  # m/rad
    memory: Float[Array, "k r"] | None = None  # m, where there is one


class System(eqx.Module):
    """A valve train as a pytree whose arrays may all be differentiated.

    States y have the shape (2, n + r): in the first row positions [m] and the memories [m] of r elements, in the second
    velocities [m/s] and zeros. For b motions side by side the axis of the batch comes last, (2, n + r, b), where it
    costs least. Lift and its rate are then scalars or (b).
    """

    mass: Float[Array, " n"]  # kg
    mass_damping: Float[Array, " n"]  # N s/m
    mass_force: Float[Array, " n"]  # N
    stiffness: Float[Array, " e"]  # N/m, of a law of contacts N/m^exponent
    damping: Float[Array, " e"]  # N s/m
    preload: Float[Array, " e"]  # N
    gap: Float[Array, " e"]  # m
    topology: Topology = eqx.field(static=True)
    laws: ElasticLaws | None = None  # None: every law is linear
    forcing: tuple[tuple[Array, Array], ...] = ()  # angle [rad] and force [N] of the rows of each

    def compression(
        self, y: Float[Array, "2 n *b"], lift, lift_dt
    ) -> tuple[Float[Array, " e *b"], Float[Array, " e *b"]]:
        """Compression of every element beyond the zero of its elastic force [m] and its rate [m/s]."""
        rows, n = self._incidence(y.dtype), self.mass.shape[0]
        d, d_dt = (jnp.matmul(rows, q[:n], precision="highest") for q in (y[0], y[1]))
        drive = column(np.array(self.topology.cam_driven, dtype=y.dtype), d)
        lift, lift_dt = (jnp.reshape(q, (1,) * (d.ndim - jnp.ndim(q)) + jnp.shape(q)) for q in (lift, lift_dt))
        return d + drive * lift - column(self.gap + self.touch(), d), d_dt + drive * lift_dt

    @jax.jit  # a program of its own, which a differentiated loop traces once and not in every pass
    def force(self, y: Float[Array, "2 n *b"], lift, lift_dt, layer: Layer) -> Float[Array, " e *b"]:
        """Force of every element [N]; it pushes a towards -x and b towards +x."""
        u, u_dt = self.compression(y, lift, lift_dt)
        pushing = self.raw_force(u, u_dt, layer)
        bilateral = self.elastic(u, layer) + column(self.damping, u) * u_dt
        if self.laws is not None and self.topology.memory:
            remembered = self.laws.remembered(self.slack(y, u), column(self.stiffness, u), layer)
            bilateral = bilateral.at[np.array(self.topology.memory)].set(remembered)
        return bilateral.at[self.topology.contacts].set(jnp.where(pushing > 0.0, pushing, 0.0))

    def raw_force(
        self, u: Float[Array, " e *b"], u_dt: Float[Array, " e *b"], layer: Layer
    ) -> Float[Array, " contacts *b"]:
        """Force of every contact [N], in the order of the elements, before it is clipped at zero."""
        pick = self.topology.contacts
        if self.laws is None:
            stiffness, damping = (column(q, u)[pick] for q in (self.stiffness, self.damping))
            return raw_force(u[pick], u_dt[pick], stiffness, damping, layer)
        return raw_force(u, u_dt, lambda pressed: self.elastic(pressed, layer), self.damper, layer)[pick]

    def damper(self, elastic: Float[Array, " e *b"]) -> jax.Array:
        """Damping (e, *b) [N s/m] of every element: constant, or by a dissipative law from its elastic force [N]."""
        damping = column(self.damping, elastic)
        if self.laws is None or not self.laws.dissipative:
            return damping
        return damping + column(self.laws.dissipation, elastic) * elastic

    def slack(self, y: Float[Array, "2 n *b"], u: Float[Array, " e *b"]) -> Float[Array, " r *b"]:
        """Compression [m] of every element with a memory beyond that memory."""
        return u[np.array(self.topology.memory)] - y[0, self.mass.shape[0] :]

    def touch(self) -> Float[Array, " e"]:
        """Compression at which each elastic force is zero [m]."""
        return -self.preload / self.stiffness if self.laws is None else self.laws.touch(self.stiffness, self.preload)

    def elastic(self, u: Float[Array, " e *b"], layer: Layer | None = None) -> Float[Array, " e *b"]:
        """Elastic force [N] of every element at the compression u [m] beyond its touch; zero if it has a memory.

        The corners of force tables are rounded over the width of the layer, or sharp without a layer.
        """
        laws = self.laws
        if laws is None:
            return column(self.stiffness, u) * u

        def force(u):
            return laws.force(u, self.stiffness, self.preload, layer)

        return force(u) if u.ndim == 1 else jax.vmap(force, -1, -1)(u)

    def push(self, theta: Float[Array, " *shape"]) -> Float[Array, " *shape n"] | None:
        """Forces by the cam angle [N] on the masses at `theta` [rad]; None where there are none."""
        if not self.forcing:
            return None
        turned = jnp.mod(theta + jnp.pi, 2 * jnp.pi) - jnp.pi
        total = jnp.zeros((*jnp.shape(theta), self.mass.shape[0]), self.mass.dtype)
        for on, (angle, force) in zip(self.topology.forced, self.forcing, strict=True):
            total = total.at[..., on].add(jnp.interp(turned, angle, force))
        return total

    def rate(
        self, y: Float[Array, "2 n *b"], lift, lift_dt, layer: Layer, push=None, force=None
    ) -> Float[Array, "2 n *b"]:
        """Time derivative of the state y at lift [m] and lift rate [m/s], under the forces `push` (n) [N] on the
        masses. `force` (e, *b) [N] replaces the elements' forces where another law holds."""
        n = self.mass.shape[0]
        force = self.force(y, lift, lift_dt, layer) if force is None else force
        on_mass = jnp.matmul(self._incidence(y.dtype).T, force, precision="highest")
        mass, drag, load = (column(q, on_mass) for q in (self.mass, self.mass_damping, self.mass_force))
        load, v = load if push is None else load + column(push, on_mass), y[1, :n]
        acceleration = (load - drag * v - on_mass) / mass
        if self.laws is None or not self.topology.memory:
            return jnp.stack([v, acceleration])
        u, u_dt = self.compression(y, lift, lift_dt)
        e = np.array(self.topology.memory)
        moved = self.laws.memory_rate(self.slack(y, u), u_dt[e], force[e], column(self.stiffness, u), layer)
        return jnp.stack([jnp.concatenate([v, moved]), jnp.concatenate([acceleration, jnp.zeros_like(moved)])])

    def parts(self, states: Float[Array, "k 2 n *b"]) -> tuple:
        """Positions (k, n, *b), velocities (k, n, *b) and memories (k, r, *b), or None, of states."""
        n = self.mass.shape[0]
        return states[:, 0, :n], states[:, 1, :n], states[:, 0, n:] if self.topology.memory else None

    @jax.jit
    def stiffest(self) -> jax.Array:
        """Largest frequency of a mass on its own elements [rad/s]: the scale of the fastest motion."""
        stiffness = self.stiffness if self.laws is None else self.laws.stand_in(self.stiffness)
        return jnp.sqrt(jnp.max(stiffness @ jnp.abs(self._incidence(self.mass.dtype)) / self.mass))

    def _incidence(self, dtype) -> np.ndarray:
        return self.topology.incidence(self.mass.shape[0]).astype(dtype)


def column(values, like: jax.Array):
    """`values` (e), or (e, b) of a batch, with an axis appended for each axis that `like` has beyond theirs."""
    return values.reshape(values.shape + (1,) * (like.ndim - values.ndim))


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
        train.memory,
        tuple(train.memory.index(e) for e in train.adjusters),
        tuple(int(f.on) for f in train.forcing),
    )
    laws = None if train.laws is None else elastic_laws(train.laws, dtype)
    forcing = tuple((jnp.asarray(f.angle, dtype), jnp.asarray(f.force, dtype)) for f in train.forcing)
    numbers = {name: jnp.asarray(train.parameters[name], dtype) for name in TRAIN_PARAMETERS}
    return System(**numbers, topology=topology, laws=laws, forcing=forcing)


def stacked(state: np.ndarray, n: int) -> jax.Array:
    """States y (..., 2, n + r) of a system with n masses from states (..., 2n + r: [m], [m/s], [m]) of its train."""
    x, v, z = jnp.split(jnp.asarray(state), (n, 2 * n), axis=-1)
    return jnp.stack([jnp.concatenate([x, z], -1), jnp.concatenate([v, jnp.zeros_like(z)], -1)], axis=-2)
