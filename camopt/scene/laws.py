"""Elastic laws beyond the linear one, as data, with what the scene itself evaluates: rest, touch and stand-ins.

Let d be the compression, p the elastic force and P the preload, which is the force at d = 0 under every law. Then

    linear       p = P + k d
    of contacts  p = p(d - d_touch) above the touch, 0 below it, as `CONTACT_LAWS` has them; under "hertz"
                 k (d - d_touch)^exponent, with d_touch = -(P / k)^(1 / exponent)
    progressive  p = P + integral of K from 0 to d; K piecewise linear in d, constant beyond its first and last row
    table        p follows its rows of compression and force in straight lines; those at its ends go on

so that a contact touches where p falls to zero, whatever its law. An element's force is p + c d'; under a law of
contacts that loses energy by itself, such as "hunt-crossley", it is p (1 + dissipation d').

Two laws have a memory, a length z that has a law of motion of its own, and no force at rest:

    oil          f = k max(0, d - z - travel): the column of a hydraulic adjuster. While it pushes, it leaks through the
                 annular gap, z' = f / leak (laminar flow); where d falls below z, the open valve refills it, z = d; in
                 between the ball is on its way, and z stands still.
    friction     f = k (d - z): an element that sticks, z' = 0, until |f| = slip, and then slides, z' = d', until d'
                 changes its sign (Jenkins 1962, J. Appl. Mech. 29:187).

A law of contacts has two numbers of one contact, its stiffness and one of its own, and four functions of depths and
forces, which are zero or more. A complex step differentiates them in event-exact, and JAX on the smooth path, so that
they are written in arithmetic that all have, + - * / and **. The verifier's methods write them anew.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


Number = Any  # of NumPy, real or complex, or of JAX
DISSIPATION = "dissipation_s_per_m"
"""The key of a law that loses energy by itself, and takes no damper beside it."""


class ContactLaw(Protocol):
    """What a law tells of the elastic force p."""

    def elastic(self, u: Number) -> Number:
        """Force p [N] at a depth [m]."""

    def slope(self, u: Number) -> Number:
        """Stiffness [N/m] at a depth [m]."""

    def stored(self, u: Number) -> Number:
        """Energy [J] at a depth [m]."""

    def depth(self, force: Number) -> Number:
        """Depth [m] at which the force [N] is reached."""


class Hertz(NamedTuple):
    """Two curved bodies that touch in a point: p = k u^n, n = 3/2 (H. Hertz, J. reine angew. Math. 92:156, 1882)."""

    stiffness: Number  # N/m^exponent
    exponent: Number

    def elastic(self, u: Number) -> Number:
        """Force p [N] at a depth [m]."""
        return self.stiffness * u**self.exponent

    def slope(self, u: Number) -> Number:
        """Stiffness [N/m] at a depth [m]."""
        return self.stiffness * self.exponent * u ** (self.exponent - 1.0)

    def stored(self, u: Number) -> Number:
        """Energy [J] at a depth [m]."""
        return self.stiffness * u ** (self.exponent + 1.0) / (self.exponent + 1.0)

    def depth(self, force: Number) -> Number:
        """Depth [m] at which the force [N] is reached."""
        return (force / self.stiffness) ** (1.0 / self.exponent)


class HuntCrossley(Hertz):
    """An impact that loses energy: f = k u^n (1 + lambda u').

    K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, Journal of
    Applied Mechanics 42:440 (1975). The force begins and ends at zero, as that of a dashpot beside a spring does not. A
    body that rebounds freely is slower than 1 / lambda, and its contact never pulls. The source does not speak of one
    that is torn away faster; here its force is zero then, as that of every contact of camopt.
    """


class Registered(NamedTuple):
    """A law of contacts as scene files have it: its class, and the key of an element that holds its own number."""

    law: Callable[[Number, Number], ContactLaw]  # of the stiffness and the own number, in SI
    key: str
    unit: float = 1.0  # of that key, in SI
    usual: float | None = None  # the number where a scene leaves the key out; None: it must be given
    dissipates: bool = False  # whether it has the key `DISSIPATION` too

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of an element that belong to the law, beside its stiffness."""
        return (self.key, DISSIPATION) if self.dissipates else (self.key,)


CONTACT_LAWS = {
    "hertz": Registered(Hertz, "exponent", usual=1.5),
    "hunt-crossley": Registered(HuntCrossley, "exponent", usual=1.5, dissipates=True),
}
"""Every law of contacts by its name in a scene file."""


BEYOND = 1e-3
"""Width [m] of the pieces of a table's curve beyond its rows, which go on."""
KINDS = {name: kind for kind, name in enumerate(("linear", "hertz", "progressive", "table", "oil", "friction"))}
LINEAR, HERTZ, PROGRESSIVE, TABLE, OIL, FRICTION = KINDS.values()
KINDS |= {name: FRICTION + i for i, name in enumerate(CONTACT_LAWS) if name != "hertz"}
"""The number of each law; those of contacts beyond the first follow in the order of their registry."""
OF_CONTACTS = {KINDS[name]: registered.law for name, registered in CONTACT_LAWS.items()}
CURVED = *OF_CONTACTS, PROGRESSIVE
"""Laws that are no straight lines."""
STAND_IN_FORCE = 1000.0
"""Force [N] at which the tangent stiffness of a law of contacts stands in for it in modes and in first step sizes."""


@dataclass(frozen=True, eq=False)
class Laws:
    """The laws of the elements (e) of a train; zeros where a number belongs to another law."""

    kind: np.ndarray  # (e) int, by KINDS
    coefficient: np.ndarray  # (e): N/m^exponent of a law of contacts, N/m of a linear element, oil or friction
    own_number: np.ndarray  # (e) of a law of contacts, as "hertz" has its exponent; 1 of others
    dissipation: np.ndarray  # (e) s/m: an element's force is p (1 + dissipation d') + c d'
    table: np.ndarray  # (e, q, 2): ascending compression [m]; stiffness [N/m] if progressive, force [N] if table
    leak: np.ndarray  # (e) N s/m, of oil
    travel: np.ndarray  # (e) m, of the ball in an oil column's valve
    slip: np.ndarray  # (e) N, of friction
    rows: np.ndarray  # (e) int: first rows of `table` that are the element's own; more bring it to the others' length

    @property
    def has_memory(self) -> np.ndarray:
        """Which elements have a memory, shape (e)."""
        return (self.kind == OIL) | (self.kind == FRICTION)

    @property
    def of_contacts(self) -> list[tuple[int, ContactLaw]]:
        """The elements with a law of contacts, each with its law."""
        found = np.flatnonzero(np.isin(self.kind, [*OF_CONTACTS]))
        return [(e, self.contact_law(e)) for e in found.tolist()]

    def contact_law(self, e: int) -> ContactLaw:
        """The law of contacts of element e, with its numbers."""
        return OF_CONTACTS[int(self.kind[e])](self.coefficient[e], self.own_number[e])

    @property
    def with_table(self) -> list[int]:
        """The elements whose law has a table."""
        return np.flatnonzero(np.isin(self.kind, (PROGRESSIVE, TABLE))).tolist()

    def curve(self, e: int, preload: float) -> "PPoly":
        """Elastic force [N] of an element with a table by its compression [m], whose pieces at the ends go on."""
        from scipy.interpolate import PPoly  # a scene without tables does not wait for SciPy

        c, value = self.table[e].T
        slope = np.diff(value) / np.diff(c)
        ends = np.array([c[0] - BEYOND, *c, c[-1] + BEYOND])
        if self.kind[e] == TABLE:
            slope = np.array([slope[0], *slope, slope[-1]])
            return PPoly(np.stack([slope, np.array([value[0] - slope[0] * BEYOND, *value])]), ends)
        force = PPoly(np.array([[0.0, *slope, 0.0], [value[0], *value]]), ends).antiderivative()
        force.c[-1] += preload - force(0.0)
        return force

    def force(self, d: np.ndarray, preload: np.ndarray) -> np.ndarray:
        """Elastic force [N] at compressions d (e) [m] with the preloads (e) [N]; zero where a memory has faded."""
        return np.array([self.along(e, d[e : e + 1], preload[e])[0][0] for e in range(len(d))])

    def tangent(self, d: np.ndarray, preload: np.ndarray) -> np.ndarray:
        """Derivative of `force` by the compression [N/m], shape (e)."""
        return np.array([self.along(e, d[e : e + 1], preload[e])[1][0] for e in range(len(d))])

    def along(self, e: int, d: np.ndarray, preload: float) -> tuple[np.ndarray, np.ndarray]:
        """Elastic force (k) [N] of element e and its derivative (k) [N/m] at compressions d (k) [m]."""
        kind, k = self.kind[e], self.coefficient[e]
        if kind in (PROGRESSIVE, TABLE):
            curve = self.curve(e, preload)
            return curve(d), curve(d, 1)
        if kind in OF_CONTACTS:
            law = self.contact_law(e)
            u = np.maximum(0.0, d + law.depth(preload))
            return law.elastic(u), law.slope(u)
        if kind in (OIL, FRICTION):
            return np.zeros_like(d), np.zeros_like(d)
        return preload + k * d, np.full_like(d, k)

    def touch(self, preload: np.ndarray) -> np.ndarray:
        """Compression at which each elastic force falls to zero [m], shape (e)."""
        touch = -preload / self.coefficient
        for e, law in self.of_contacts:
            touch[e] = -law.depth(preload[e])
        for e in self.with_table:
            touch[e] = self.curve(e, preload[e]).roots()[0]
        return touch

    def stand_in(self) -> np.ndarray:
        """Constant stiffness [N/m] of each element for modes and step sizes, shape (e): of a law of contacts the slope
        at STAND_IN_FORCE, of a table at compression zero; oil does not leak, and friction sticks."""
        stiffness = np.array(self.coefficient)
        for e, law in self.of_contacts:
            stiffness[e] = law.slope(law.depth(STAND_IN_FORCE))
        for e in self.with_table:
            stiffness[e] = self.curve(e, 0.0)(0.0, 1)
        return stiffness
