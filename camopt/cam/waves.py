"""Waves of the acceleration: how often the jerk changes its sign inside a cam's duration.

The acceleration of a plain cam rises on the opening flank, falls to the nose, rises out of it and falls again: its jerk
changes its sign three times. Every ripple adds two changes. Stretches of constant acceleration have no sign.
"""

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.shapes import Float

SIGNLESS = 1e-6
"""A jerk that is no larger than this share of the largest one has no sign: rounding of a cam designed to have none."""
STEP = 1e-6
"""A step of the acceleration larger than this share of the largest one is a jerk beyond all others."""


def sign_changes(lift: Lift) -> Float[np.ndarray, " k"]:
    """The angles [rad] inside the duration at which the jerk changes its sign, from the roots of the pieces.

    Between two neighbours of all borders and roots of the snap the jerk goes one way, so that no change is missed.
    """
    half = lift.half_duration
    inside = lift.borders[(lift.borders > -half) & (lift.borders < half)]
    bends = lift.roots(4)
    marks = np.unique(np.concatenate([[-half, half], inside, bends[np.abs(bends) < half]]))
    piece = np.searchsorted(lift.borders, 0.5 * (marks[1:] + marks[:-1])) - 1
    ends, jerk = (lift.of_piece(piece, np.stack([marks[:-1], marks[1:]]), order).T for order in (2, 3))
    step = ends[1:, 0] - ends[:-1, 1]
    steep = np.where(np.abs(step) > STEP * np.abs(ends).max(), np.copysign(np.inf, step), 0.0)
    value = np.column_stack([jerk, np.append(steep, 0.0)]).ravel()
    angle = np.column_stack([marks[:-1], marks[1:], marks[1:]]).ravel()
    sign = np.where(np.abs(value) > SIGNLESS * np.abs(jerk).max(), np.sign(value), 0.0)
    signed = np.flatnonzero(sign)
    changed = np.flatnonzero(np.diff(sign[signed]))
    return 0.5 * (angle[signed[changed]] + angle[signed[changed + 1]])
