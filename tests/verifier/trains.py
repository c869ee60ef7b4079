"""Trains with analytic motions, written as arrays so that no loader stands between them and the methods."""

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.laws import Laws
from camopt.scene.train import GROUND, Train

COLUMNS = ("a", "b", "contact", "cam_driven", "stiffness", "damping", "preload", "gap")
"""Numbers of an element."""


def train(mass, elements, force=0.0, mass_damping=0.0, valve=-1, seat=-1, **others) -> Train:
    """`elements` have a value for each of COLUMNS; `others` are fields of a train, such as its laws."""
    full = np.ones(len(mass))
    return Train(
        mass=np.array(mass),
        mass_damping=mass_damping * full,
        mass_force=force * full,
        **{name: np.array(values) for name, *values in zip(COLUMNS, *elements, strict=True)},
        valve=valve,
        seat=seat,
        mass_names=tuple(f"m{i}" for i in range(len(mass))),
        element_names=tuple(f"e{i}" for i in range(len(elements))),
        **{"cam_side": ()} | others,
    )


def laws(kind, coefficient, exponent=1.0, table=None, leak=0.0, travel=0.0, slip=0.0, dissipation=0.0) -> Laws:
    """The laws of elements: kinds (e) and coefficients (e); the other numbers are one for all, or (e) each.

    `table` (q, 2) is that of every element that has one.
    """
    elements = len(kind)
    rows = np.array([[0.0, 1.0]] if table is None else table)
    numbers = (np.broadcast_to(q, elements).astype(float) for q in (coefficient, exponent, dissipation))
    others = (np.broadcast_to(q, elements).astype(float) for q in (leak, travel, slip))
    return Laws(np.array(kind), *numbers, np.stack([rows] * elements), *others, rows=np.full(elements, len(rows)))


def two_springs() -> Train:
    """Two masses on bilateral springs, one driven by the cam: linear and smooth, every term of the law present."""
    return train(
        [1.0, 0.5],
        [
            (GROUND, 0, False, True, 300.0, 2.0, 1.5, 0.1),
            (0, 1, False, False, 150.0, 1.0, -0.5, 0.05),
            (1, GROUND, False, False, 80.0, 0.5, 0.7, 0.0),
        ],
        force=0.3,
        mass_damping=0.4,
    )


def ball_on_seat(stiffness: float, damping: float) -> Train:
    """1 kg pressed by 10 N towards a seat that it touches at x = 0."""
    return train([1.0], [(GROUND, 0, True, False, stiffness, damping, 0.0, 0.0)], force=-10.0, valve=0, seat=0)


def smooth_lift(height: float) -> Lift:
    """(u (2 pi - u))^4 over the whole revolution, scaled to `height` [m]; u = theta + pi."""
    bump = np.polynomial.Polynomial([0.0, 2 * np.pi, -1.0]) ** 4 * (height / np.pi**8)
    return Lift(np.array([-np.pi, np.pi]), bump.coef[None], np.pi / 2)


def no_lift() -> Lift:
    return Lift(np.array([-np.pi, np.pi]), np.zeros((1, 7)), np.pi / 2)
