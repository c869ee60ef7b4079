"""Laws of elements as data, with what the scene itself evaluates: forces at rest, touch points and tangent stiffnesses.

Let d be the compression, p the elastic force and P the preload, which is the force at d = 0 under every law. Then

    linear       p = P + k d
    of contacts  p = p(d - d_touch) for d > d_touch and 0 below it, see `CONTACT_LAWS`; under "hertz"
                 k (d - d_touch)^exponent, with d_touch = -(P / k)^(1 / exponent)
    progressive  p = P + integral of K from 0 to d; K piecewise linear in d, constant beyond its first and last row
    table        p is interpolated linearly between rows of compression and force, and extrapolated beyond them

A contact touches where p falls to zero, whatever its law. The force of an element is p + c d'. A contact law that
dissipates energy by itself, such as "hunt-crossley", has the force p (1 + dissipation d').

Two laws have a memory, a length z that has an equation of motion of its own, and no force at rest:

    oil          f = k max(0, d - z - travel): the column of a hydraulic adjuster. While it pushes, it leaks through the
                 annular gap, z' = f / leak (laminar flow). Where d falls below z, the open valve refills it, z = d. In
                 between, the ball moves towards its seat and z stays constant.
    friction     f = k (d - z): the element sticks, z' = 0, until |f| = slip. It then slides, z' = d', until d' changes
                 its sign (Jenkins 1962, J. Appl. Mech. 29:187).

A contact law has two parameters, its stiffness and one more (`own_number`), and four functions of non-negative depths
and forces. Event-exact differentiates them by a complex step and the smooth path by JAX, so they use only + - * / and
**, which work for both. The verifier's methods implement the laws independently.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


Number = Any  # of NumPy, real or complex, or of JAX
DISSIPATION = "dissipation_s_per_m"
"""Key of a contact law that dissipates energy by itself and has no damper beside it."""


class ContactLaw(Protocol):
    """Elastic force p of a contact law, with its slope, its energy and its inverse."""

    def elastic(self, u: Number) -> Number:
        """Force p [N] at a depth [m]."""

    def slope(self, u: Number) -> Number:
        """Stiffness [N/m] at a depth [m]."""

    def stored(self, u: Number) -> Number:
        """Stored energy [J] at a depth [m]."""

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
        """Stored energy [J] at a depth [m]."""
        return self.stiffness * u ** (self.exponent + 1.0) / (self.exponent + 1.0)

    def depth(self, force: Number) -> Number:
        """Depth [m] at which the force [N] is reached."""
        return (force / self.stiffness) ** (1.0 / self.exponent)


class HuntCrossley(Hertz):
    """An impact that dissipates energy: f = k u^n (1 + lambda u').

    K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, Journal of
    Applied Mechanics 42:440 (1975). The force begins and ends at zero, unlike that of a dashpot parallel to a spring. A
    body that rebounds freely is slower than 1 / lambda, and its contact never pulls. The source does not treat a body
    that is torn away faster; here its force is then zero, as in every contact of camopt.
    """


class Registered(NamedTuple):
    """A contact law in scene files: its class, and the key of an element that holds its second parameter."""

    law: Callable[[Number, Number], ContactLaw]  # function of the stiffness and the second parameter, in SI
    key: str
    unit: float = 1.0  # SI value of the key's unit
    usual: float | None = None  # value if a scene leaves the key out; None: it must be given
    dissipates: bool = False  # whether it also has the key `DISSIPATION`

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of an element that belong to the law, in addition to its stiffness."""
        return (self.key, DISSIPATION) if self.dissipates else (self.key,)


CONTACT_LAWS = {
    "hertz": Registered(Hertz, "exponent", usual=1.5),
    "hunt-crossley": Registered(HuntCrossley, "exponent", usual=1.5, dissipates=True),
}
"""Contact laws by their names in a scene file."""


BEYOND = 1e-3
"""Width [m] of the pieces that extrapolate a table's curve beyond its rows."""
KINDS = {name: kind for kind, name in enumerate(("linear", "hertz", "progressive", "table", "oil", "friction"))}
LINEAR, HERTZ, PROGRESSIVE, TABLE, OIL, FRICTION = KINDS.values()
KINDS |= {name: FRICTION + i for i, name in enumerate(CONTACT_LAWS) if name != "hertz"}
"""Number of each law. Contact laws after the first one follow in the order of their registry."""
OF_CONTACTS = {KINDS[name]: registered.law for name, registered in CONTACT_LAWS.items()}
CURVED = *OF_CONTACTS, PROGRESSIVE
"""Laws whose force is not piecewise linear."""
STAND_IN_FORCE = 1000.0
"""Force [N] at which the tangent stiffness of a contact law replaces it in modal analysis and for first step sizes."""


@dataclass(frozen=True, eq=False)
class Laws:
    """Laws of the elements (e) of a train; a number that does not belong to an element's law is zero."""

    kind: np.ndarray  # (e) int, by KINDS
    coefficient: np.ndarray  # (e): N/m^exponent of a contact law, N/m of a linear element, oil or friction
    own_number: np.ndarray  # (e) second parameter of a contact law, such as the exponent of "hertz"; 1 of others
    dissipation: np.ndarray  # (e) s/m: an element's force is p (1 + dissipation d') + c d'
    table: np.ndarray  # (e, q, 2): ascending compression [m]; stiffness [N/m] if progressive, force [N] if table
    leak: np.ndarray  # (e) N s/m, of oil
    travel: np.ndarray  # (e) m, of the ball in an oil column's valve
    slip: np.ndarray  # (e) N, of friction
    rows: np.ndarray  # (e) int: number of the element's own rows, the first ones of `table`; the rest is padding

    @property
    def has_memory(self) -> np.ndarray:
        """Mask (e) of the elements that have a memory."""
        return (self.kind == OIL) | (self.kind == FRICTION)

    @property
    def of_contacts(self) -> list[tuple[int, ContactLaw]]:
        """The elements with a contact law, each with its law."""
        elements = np.flatnonzero(np.isin(self.kind, [*OF_CONTACTS]))
        return [(e, self.contact_law(e)) for e in elements.tolist()]

    def contact_law(self, e: int) -> ContactLaw:
        """The contact law of element e with its numbers."""
        return OF_CONTACTS[int(self.kind[e])](self.coefficient[e], self.own_number[e])

    @property
    def with_table(self) -> list[int]:
        """The elements whose law has a table."""
        return np.flatnonzero(np.isin(self.kind, (PROGRESSIVE, TABLE))).tolist()

    def curve(self, e: int, preload: float) -> "PPoly":
        """Elastic force [N] of an element with a table against its compression [m], extrapolated by its end pieces."""
        from scipy.interpolate import PPoly  # imported here because a scene without tables does not need SciPy

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
        """Elastic force [N] at compressions d (e) [m] with the preloads (e) [N]; zero for elements with a memory."""
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
        """Constant stiffness [N/m] of each element for modal analysis and step sizes, shape (e): the slope of a contact
        law at STAND_IN_FORCE, and that of a table at zero compression. Oil does not leak, and friction sticks."""
        stiffness = np.array(self.coefficient)
        for e, law in self.of_contacts:
            stiffness[e] = law.slope(law.depth(STAND_IN_FORCE))
        for e in self.with_table:
            stiffness[e] = self.curve(e, 0.0)(0.0, 1)
        return stiffness
