"""Laws of contacts that are curves, of which every path of camopt but the verifier's methods reads.

A contact's force is f = max(0, p(u) (1 + dissipation u')) at the depth u [m] beyond the touch, and 0 apart. A law has
two numbers of one contact, its stiffness and one of its own, and four functions of depths and forces, which are zero or
more. A complex step differentiates them in event-exact, and JAX on the smooth path, so that they are written in
arithmetic that all three have: + - * / and **.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

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


def laws_by_key() -> dict[str, tuple[str, ...]]:
    """The names of the laws of contacts to which each key belongs."""
    keys = dict.fromkeys(key for law in CONTACT_LAWS.values() for key in law.keys)
    return {key: tuple(name for name, law in CONTACT_LAWS.items() if key in law.keys) for key in keys}
