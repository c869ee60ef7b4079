"""Two curved bodies that touch in a point: p = k u^n, n = 3/2 (H. Hertz, J. reine angew. Math. 92:156, 1882)."""

from camopt.scene.contact_laws.record import ContactLaw, LawNumbers, Number


def elastic(u: Number, n: LawNumbers) -> Number:
    """Force [N] at a depth [m]."""
    return n.stiffness * u**n.exponent


def slope(u: Number, n: LawNumbers) -> Number:
    """Stiffness [N/m] at a depth [m]."""
    return n.stiffness * n.exponent * u ** (n.exponent - 1.0)


def stored(u: Number, n: LawNumbers) -> Number:
    """Energy [J] at a depth [m]."""
    return n.stiffness * u ** (n.exponent + 1.0) / (n.exponent + 1.0)


def depth(force: Number, n: LawNumbers) -> Number:
    """Depth [m] at which the force [N] is reached."""
    return (force / n.stiffness) ** (1.0 / n.exponent)


LAW = ContactLaw(elastic, slope, stored, depth, keys=("exponent",))
