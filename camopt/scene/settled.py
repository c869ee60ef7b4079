"""Criteria for a settled motion (docs/model.md), shared by all ways of settling, and the metrics of settled motions."""

from dataclasses import dataclass

import numpy as np

from camopt.scene.quantities import LESS_IS_WORSE

SETTLED_POSITION = 1e-6
"""Largest distance that a position of a settled motion still has from the periodic motion [m] (docs/model.md)."""
SETTLED_VELOCITY = 1e-3
"""Largest difference that a velocity of a settled motion still has from the periodic motion [m/s]."""
STILL = 1e-4
"""Distance of two states a revolution apart, in these tolerances, up to which they are equal: 0.1 nm and 0.1 um/s."""
SHRUNK = 0.03
"""A motion settles if the distance between states a revolution apart falls to this share of its largest value since it
last came below the tolerances. If the motion wanders by less than the tolerances, the distance does not fall."""
PLAIN_REVOLUTIONS, WATCHED = 40, 120
"""Number of revolutions after which a motion of a well-damped train counts as wandering if it still changes by more
than the tolerances, and largest number over which one that changes by less is observed for the distance to shrink."""
FADED, MOST_REVOLUTIONS = 15.0, 1500
"""A lightly damped train may run until its slowest mode has decayed by the factor exp(FADED), from three millimetres to
a nanometre, but for at most MOST_REVOLUTIONS."""
MEASURED, APERIODIC, RANGED = 4, 8, 320
"""Number of revolutions measured of a periodic motion, of a wandering motion, and of a wandering motion whose range is
stated: 400 revolutions leave that range by less than its own width (experiments/wandering.py)."""
UNBOUND = 1e3
"""Position [m] beyond which a motion counts as unbounded; no valve has a lift of a kilometre."""


def way_left(decay: float) -> float:
    """Remaining distance to the periodic motion over the change in the last revolution, at least one. A change d that
    shrinks by the factor exp(-decay) per revolution leaves d / (exp(decay) - 1)."""
    return max(1.0, 1.0 / float(np.expm1(min(max(decay, 1e-9), 500.0))))


def revolutions_needed(decay: float) -> int:
    """Number of revolutions in which the slowest mode, which shrinks by exp(-decay) in each, decays by exp(FADED)."""
    return int(np.ceil(FADED / max(decay, 1e-9)))


def goes_on(revolutions: int, most: int, within: int) -> bool:
    """Whether a motion may still settle after this many revolutions, the last `within` of which changed by less than
    the tolerances. A motion that repeatedly falls below the tolerances and exceeds them again counts as wandering."""
    return revolutions < most or (0 < within < WATCHED and revolutions - most < RANGED)


def goes_back(settles: bool, late: int, within: int) -> bool:
    """Whether settling resumes for a motion that was given up `late` revolutions ago and appears to settle while it is
    measured. A motion for which this happens again and again counts as wandering."""
    return settles and late < RANGED and within < WATCHED


def shrinks(largest: float, start: float, before: float, last: float, turns: int) -> bool:
    """Whether the distance of states a revolution apart shrinks and leaves changes within the tolerances.

    All distances are in units of the tolerances: the `largest` since they fell below the tolerances, the one at the
    `start` of the measurement, and the last two, `before` and `last`, which come `turns` and `turns` + 1 revolutions
    after the largest. Near an unstable state the distance is small too, but grows. If it shrinks by the factor q per
    revolution, the changes from the start on sum up to start q / (1 - q).
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

    `lowest` and `highest` are the extremes over the measured revolutions, of which a periodic motion has four and any
    other eight. They are NaN if the valve did not seat in one of them, and if the motion was refused.
    """

    cam_speeds: np.ndarray  # (s) rad/s
    lowest: dict[str, np.ndarray]  # (t, c, s)
    highest: dict[str, np.ndarray]  # (t, c, s)
    periodic: np.ndarray  # (t, c, s) bool
    refused: np.ndarray  # (t, c, s) bool: endless switching, or a motion without bound
    revolutions: np.ndarray  # (t, c, s) number run before the measured ones
    states: np.ndarray  # (t, c, s, 2n + r) after the measured ones [m], [m/s], [m]; NaN where refused
    errors: dict[str, float]  # of a periodic motion whose contacts do not switch, by metric

    def worst(self, name: str) -> np.ndarray:
        """The worst value over the measured revolutions, shape (t, c, s)."""
        return (self.lowest if name in LESS_IS_WORSE else self.highest)[name]

    def __repr__(self) -> str:
        t, c, s = self.periodic.shape
        return f"SettledMetrics({t} trains, {c} cams, {s} speeds, {int(self.periodic.sum())} of them periodic)"
