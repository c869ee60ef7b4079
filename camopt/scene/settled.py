"""When a motion counts as settled (docs/model.md), in numbers that every way of settling reads, and its metrics."""

from dataclasses import dataclass

import numpy as np

from camopt.scene.quantities import LESS_IS_WORSE

SETTLED_POSITION = 1e-6
"""Largest change that a position of a settled motion still has before it [m] (docs/model.md)."""
SETTLED_VELOCITY = 1e-3
"""Largest change that a velocity of a settled motion still has before it [m/s]."""
STILL = 1e-4
"""Distance, in the tolerances above, of two states a revolution apart that count as one: 0.1 nm and 0.1 um/s."""
SHRUNK = 0.03
"""Share of its largest value, since it last came below the tolerances, to which the distance of states a revolution
apart falls where the motion settles. Where it wanders by less than the tolerances, the distance stays of one size."""
PLAIN_REVOLUTIONS, WATCHED = 40, 120
"""Revolutions after which a motion of a well damped train that still changes by more than the tolerances wanders, and
those over which it is watched at most for the distance to shrink once it changes by less."""
FADED, MOST_REVOLUTIONS = 15.0, 1500
"""A lightly damped train may run until its slowest mode has faded by FADED e-folds (from three millimetres to a
nanometre), at most MOST_REVOLUTIONS."""
MEASURED, APERIODIC, RANGED = 4, 8, 320
"""Revolutions that are measured where the motion is periodic, where it wanders, and where the range of a wandering
motion is stated: 400 revolutions leave that range by less than its own width (experiments/wandering.py)."""
UNBOUND = 1e3
"""Position [m] beyond which a motion has no bound: a kilometre of valve lift is no motion of a valve train."""


def way_left(decay: float) -> float:
    """The way still to go to the periodic motion, in changes over the last revolution, never less than one: a change d
    that shrinks by exp(-decay) from each to the next leaves d / (exp(decay) - 1)."""
    return max(1.0, 1.0 / float(np.expm1(min(max(decay, 1e-9), 500.0))))


def revolutions_needed(decay: float) -> int:
    """Revolutions until the slowest mode has faded."""
    return int(np.ceil(FADED / max(decay, 1e-9)))


def goes_on(revolutions: int, most: int, within: int) -> bool:
    """Whether a motion that has run so many revolutions, `within` of them up to now within the tolerances, may yet be
    seen to settle. One that comes within them again and again, and leaves them as often, wanders."""
    return revolutions < most or (0 < within < WATCHED and revolutions - most < RANGED)


def goes_back(settles: bool, late: int, within: int) -> bool:
    """Whether a motion that was given up `late` revolutions ago, and seems to settle while it is measured, is given
    another chance; one that seems so again and again wanders."""
    return settles and late < RANGED and within < WATCHED


def shrinks(largest: float, start: float, before: float, last: float, turns: int) -> bool:
    """Whether the distance of states a revolution apart is seen to shrink, and what it leaves is within the tolerances.

    All distances are in the tolerances: the `largest` since they came within them, the one at the `start` of what is
    measured, and the two last ones, `turns` revolutions and one more after the largest. Near an unstable state the
    distance is small too, but grows. If it shrinks by the ratio q in a revolution, the changes from the start on add up
    to start q / (1 - q).
    """
    late = max(before, last)
    if late <= STILL:
        return True
    if late > SHRUNK * largest or last > before or turns < 1:
        return False
    q = (late / largest) ** (1.0 / turns)
    return start * q < 1.0 - q


@dataclass(frozen=True, repr=False)
class SettledMetrics:
    """Metrics of settled motions by train (t), cam (c) and speed (s), in the units of their names.

    `lowest` and `highest` are over the measured revolutions, four of a periodic motion and eight of another one; they
    are NaN where the valve did not seat in one of them, and where the motion is refused.
    """

    cam_speeds: np.ndarray  # (s) rad/s
    lowest: dict[str, np.ndarray]  # (t, c, s)
    highest: dict[str, np.ndarray]  # (t, c, s)
    periodic: np.ndarray  # (t, c, s) bool
    refused: np.ndarray  # (t, c, s) bool: endless switching, or a motion without bound
    revolutions: np.ndarray  # (t, c, s) run before the measured ones
    states: np.ndarray  # (t, c, s, 2n + r) after the measured ones [m], [m/s], [m]; NaN where refused
    errors: dict[str, float]  # of a periodic motion whose contacts do not switch, by metric

    def worst(self, name: str) -> np.ndarray:
        """The worst of the measured revolutions (t, c, s)."""
        return (self.lowest if name in LESS_IS_WORSE else self.highest)[name]

    def __repr__(self) -> str:
        t, c, s = self.periodic.shape
        return f"SettledMetrics({t} trains, {c} cams, {s} speeds, {int(self.periodic.sum())} of them periodic)"
