"""When a motion counts as settled (docs/model.md), in numbers that every way of settling reads."""

import numpy as np

SETTLED_POSITION = 1e-6
"""Largest change that a position of a settled motion still has before it [m] (docs/model.md)."""
SETTLED_VELOCITY = 1e-3
"""Largest change that a velocity of a settled motion still has before it [m/s]."""
PLAIN_REVOLUTIONS = 40
"""Revolutions after which a motion of a well damped train that still changes counts as aperiodic."""
FADED, MOST_REVOLUTIONS = 15.0, 1500
"""A lightly damped train may run until its slowest mode has faded by FADED e-folds (from three millimetres to a
nanometre), at most MOST_REVOLUTIONS."""
MEASURED, APERIODIC = 4, 8
"""Revolutions that are measured where the motion is periodic, and where it is not."""
UNBOUND = 1e3
"""Position [m] beyond which a motion has no bound: a kilometre of valve lift is no motion of a valve train."""


def way_left(decay: float) -> float:
    """The way still to go to the periodic motion, in changes over the last revolution, never less than one of them.

    A change d over a revolution that shrinks by exp(-decay) from each to the next leaves d / (exp(decay) - 1).
    """
    return max(1.0, 1.0 / float(np.expm1(min(max(decay, 1e-9), 500.0))))


def revolutions_needed(decay: float) -> int:
    """Revolutions until the slowest mode has faded."""
    return int(np.ceil(FADED / max(decay, 1e-9)))
