"""Laws of contacts that are curves, of which every path of camopt but the verifier's methods reads.

A contact's force is f = max(0, p(u) (1 + dissipation u')) at the depth u [m] beyond the touch, and 0 apart. A law has
the numbers of one contact, and four functions of depths and forces, which are zero or more. A complex step
differentiates them in event-exact, and JAX on the smooth path, so that they are written in arithmetic that all three
have: + - * / and **.
"""

from typing import Any, NamedTuple

Number = Any  # of NumPy, real or complex, or of JAX
DISSIPATION = "dissipation_s_per_m"
"""The key of a law that loses energy by itself, and takes no damper beside it."""
POINT_CONTACT = 1.5
"""Exponent of a law of contacts where the scene gives none."""


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


CONTACT_LAWS = {"hertz": (Hertz, ("exponent",)), "hunt-crossley": (HuntCrossley, ("exponent", DISSIPATION))}
"""Every law of contacts by its name in a scene file, with the keys of an element that belong to it."""


def laws_with(key: str) -> tuple[str, ...]:
    """Names of the laws of contacts to which a key of an element belongs."""
    return tuple(name for name, (_, keys) in CONTACT_LAWS.items() if key in keys)
