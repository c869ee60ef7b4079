"""What camopt needs to know of a law of contacts: its force by the depth, and which keys of the scene it reads."""

from collections.abc import Callable
from typing import Any, NamedTuple

Number = Any  # of NumPy, real or complex, or of JAX
"""What a law computes with. A complex step differentiates it in event-exact, and JAX on the smooth path, so that it is
written in arithmetic that all three have: + - * / and **."""


class LawNumbers(NamedTuple):
    """The numbers of one contact that a law reads."""

    stiffness: Number  # N/m^exponent
    exponent: Number


class ContactLaw(NamedTuple):
    """A law of contacts: f = max(0, p(u) (1 + dissipation u')) at the depth u [m] beyond the touch, and 0 apart.

    Every function takes what its comment names first, and the contact's `LawNumbers` second. Depths and forces are
    zero or more.
    """

    elastic: Callable[[Number, LawNumbers], Number]  # p [N] by the depth [m]
    slope: Callable[[Number, LawNumbers], Number]  # its derivative [N/m] by the depth [m]
    stored: Callable[[Number, LawNumbers], Number]  # its integral [J] by the depth [m]
    depth: Callable[[Number, LawNumbers], Number]  # depth [m] by the elastic force [N]
    keys: tuple[str, ...]  # keys of the scene's element that belong to it, besides stiffness_N_per_m
