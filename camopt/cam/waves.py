"""Waves of the acceleration: how often the jerk changes its sign inside a cam's duration, and rows that hold a pattern.

The acceleration of a plain cam rises on the opening flank, falls to the nose, rises out of it and falls again: its jerk
changes its sign three times. Every ripple adds two changes. Stretches of constant acceleration have no sign.
"""

from typing import TYPE_CHECKING

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM_PER_DEG3

if TYPE_CHECKING:
    from camopt.cam.families.free import FreeCam

SIGNLESS = 1e-6
"""A jerk that is no larger than this share of the largest one has no sign: rounding of a cam designed to have none."""
STEP = 1e-6
"""A step of the acceleration larger than this share of the largest one is a jerk beyond all others."""
CELL = 1.0 * DEG
"""Least distance at which a program tells two sign changes apart."""
FREE = 100 * MM_PER_DEG3
"""A jerk that no cam has, for the rows of the sign that is allowed."""


def sign_changes(lift: Lift) -> Float[np.ndarray, " k"]:
    """The angles [rad] inside the duration at which the jerk changes its sign, from the roots of the pieces.

    Between two neighbours of all borders and roots of the snap the jerk goes one way, so that no change is missed.
    """
    half = lift.half_duration
    inside = lift.borders[(lift.borders > -half) & (lift.borders < half)]
    bends = lift.roots(4)
    marks = np.unique(np.concatenate([[-half, half], inside, bends[np.abs(bends) < half]]))
    jerk = np.stack([_at_ends(lift, marks, 3, right) for right in (True, False)], axis=1)
    ends = np.stack([_at_ends(lift, marks, 2, right) for right in (True, False)], axis=1)
    step = ends[1:, 0] - ends[:-1, 1]
    steep = np.where(np.abs(step) > STEP * np.abs(ends).max(), np.copysign(np.inf, step), 0.0)
    value = np.column_stack([jerk, np.append(steep, 0.0)]).ravel()
    angle = np.column_stack([marks[:-1], marks[1:], marks[1:]]).ravel()
    sign = np.where(np.abs(value) > SIGNLESS * np.abs(jerk).max(), np.sign(value), 0.0)
    signed = np.flatnonzero(sign)
    changed = np.flatnonzero(np.diff(sign[signed]))
    return 0.5 * (angle[signed[changed]] + angle[signed[changed + 1]])


def _at_ends(lift: Lift, marks: np.ndarray, order: int, right: bool) -> np.ndarray:
    """A derivative at the left or the right end of every interval between marks (k), from inside it (k - 1)."""
    piece = np.searchsorted(lift.borders, 0.5 * (marks[1:] + marks[:-1])) - 1
    at = (marks[:-1] if right else marks[1:]) - lift.borders[piece]
    falling = np.ones(lift.coefficients.shape[1])
    powers = np.arange(len(falling))
    for k in range(order):
        falling = falling * (powers - k)
    value = np.zeros(len(at))
    for p in range(order, len(powers)):
        value += falling[p] * lift.coefficients[piece, p] * at ** (p - order)
    return value


def cells(cam: "FreeCam") -> Float[np.ndarray, " k"]:
    """The angles [rad] at which a program may change the sign of the jerk, from end to end of the duration."""
    low, high = cam.breaks[[0, -1]]
    return np.linspace(low, high, round((high - low) / CELL) + 1)


def sign_rows(cam: "FreeCam", switches: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Rows (r, m) and bounds (r) that hold a jerk of one sign between neighbouring `switches` [rad], positive first.

    The left sides are the same for all switches at `cells`: rows of the sign that is allowed do not bind.
    """
    edges = np.sort(np.concatenate([cells(cam), cam.breaks]))
    edges = edges[np.append(True, np.diff(edges) > 1e-12)]
    matrix, offset = cam.control_points(3, edges)
    positive = np.searchsorted(switches, 0.5 * (edges[1:] + edges[:-1])) % 2 == 0
    width = (len(offset) - 1) // len(positive)
    may = []
    for sign in (positive, ~positive):
        within = np.append(np.repeat(sign, width), sign[-1])
        within[width:-1:width] &= sign[:-1]  # a control point that two intervals share
        may.append(within)
    bound = np.concatenate([np.where(may[0], FREE, 0.0) - offset, np.where(may[1], FREE, 0.0) + offset])
    return np.vstack([matrix, -matrix]), bound
