"""The share of drawn trains that holds every limit, with its interval, what breaks first, and by which tolerance.

Everything here is arithmetic on how much of each limit the trains use.

The share is looked at several times, and counting ends where a look decides. Early looks decide only where an interval
of 99 % leaves the wanted share out, in the manner of Haybittle (1971), British Journal of Radiology 44, and Peto et al.
(1976), British Journal of Cancer 34, whose intervals are wider. The interval that is stated at the end is made of the
exact distribution of where counting ends, with the ends ordered by their share (Armitage 1958, Biometrika 45). With one
look it is that of Clopper and Pearson (1934), Biometrika 26. Like theirs, it holds the true share in at least 95 of 100
repetitions, whatever that share is.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.optimize import brentq
from scipy.special import bdtr, bdtrc, gammaln, xlog1py, xlogy

from camopt.measure.yield_words import CONFIDENCE
from camopt.scene.errors import InputError

EARLY = 1e-2
"""Chance, to both sides together, that one early look decides against a share that is exactly the wanted one."""
TIE = 1e-12
"""Two shares that differ by less are the same."""
SURELY = 1e-15
"""Share next to zero or one at which the search for an end of an interval begins."""


@dataclass(frozen=True)
class Looks:
    """Numbers of trains (k), ascending, after which it is asked whether the share is above or below `wanted`.

    After the last one counting ends in any case.
    """

    trains: tuple[int, ...]
    wanted: float = 0.5

    def ends(self, holding: int, trains: int) -> bool:
        """Whether counting ends with so many of so many trains holding; `trains` is one of the looks."""
        if trains >= self.trains[-1]:
            return True
        below, above = self._borders(trains)
        return holding <= below or holding >= above

    def interval(self, holding: int, trains: int) -> tuple[float, float]:
        """The interval of `CONFIDENCE` for the share where counting ended with so many of so many trains holding."""
        share, tail = holding / trains, (1.0 - CONFIDENCE) / 2

        def where(side: int) -> float:
            return float(cast(float, brentq(lambda p: self._tails(share, p)[side] - tail, SURELY, 1.0 - SURELY)))

        return 0.0 if holding == 0 else where(1), 1.0 if holding == trains else where(0)

    def coverage(self, p: float) -> float:
        """How often the interval holds a true share p."""
        ended = [(np.arange(len(mass)) / trains, mass) for trains, mass in self.ended(p)]
        shares, mass = (np.concatenate(parts) for parts in zip(*ended, strict=True))
        order = np.argsort(shares, kind="stable")
        shares, mass = shares[order], mass[order]
        first, last = np.searchsorted(shares, shares - TIE), np.searchsorted(shares, shares + TIE, "right")
        total = np.concatenate([[0.0], np.cumsum(mass)])
        tail = (1.0 - CONFIDENCE) / 2
        return float(mass[(total[last] > tail) & (total[-1] - total[first] > tail)].sum())

    def ended(self, p: float) -> Iterator[tuple[int, np.ndarray]]:
        """By look its number of trains n, and how likely counting ends there with 0 to n of them holding (n + 1)."""
        going, before = np.ones(1), 0
        for trains in self.trains:
            more = trains - before
            going = np.convolve(going, _chances(more, p))
            stops = np.ones(trains + 1, dtype=bool)
            if trains < self.trains[-1]:
                below, above = self._borders(trains)
                stops = (np.arange(trains + 1) <= below) | (np.arange(trains + 1) >= above)
            yield trains, np.where(stops, going, 0.0)
            going, before = np.where(stops, 0.0, going), trains

    def _borders(self, trains: int) -> tuple[int, int]:
        """The most and the fewest holding trains with which an early look decides that the share is below or above."""
        holding = np.arange(trains + 1)
        below = int(np.sum(bdtr(holding, trains, self.wanted) < EARLY / 2)) - 1
        return below, trains + 1 - int(np.sum(bdtrc(holding - 1, trains, self.wanted) < EARLY / 2))

    def _tails(self, share: float, p: float) -> tuple[float, float]:
        """How likely counting ends at a share of at most this, and of at least this, if the true one is p."""
        low = high = 0.0
        for trains, mass in self.ended(p):
            shares = np.arange(trains + 1) / trains
            low += float(mass[shares <= share + TIE].sum())
            high += float(mass[shares >= share - TIE].sum())
        return low, high


@dataclass(frozen=True, repr=False)
class UsedLimits:
    """How much of each limit (l) each train (t) uses at each speed (s): one at the limit, more beyond it."""

    limits: tuple[str, ...]  # (l) keys of the design
    speeds_rpm: np.ndarray  # (s) ascending
    used: np.ndarray  # (t, l, s); infinite where the valve never seats or the motion is refused

    @property
    def worst(self) -> np.ndarray:
        """The largest part of a limit that each train uses (t)."""
        return self.used.max(axis=(1, 2))

    @property
    def holds(self) -> np.ndarray:
        """Whether each train keeps every limit at every speed (t)."""
        return self.worst <= 1.0

    def __repr__(self) -> str:
        return f"UsedLimits({len(self.used)} trains, {int(self.holds.sum())} of them hold {', '.join(self.limits)})"


@dataclass(frozen=True)
class Share:
    """A share of `trains` with its interval of `CONFIDENCE`."""

    share: float
    low: float
    high: float
    trains: int

    def __str__(self) -> str:
        interval = f"{100 * CONFIDENCE:g} % interval {100 * self.low:.1f} to {100 * self.high:.1f} %"
        return f"{100 * self.share:.1f} % ({interval})"


def share_of(holds: np.ndarray, looks: Looks | None = None) -> Share:
    """The share of trains (t) that hold, with its interval, where counting might have ended after each of the `looks`;
    without them so many trains were counted in any case."""
    if not len(holds):
        raise InputError("yield: no train was measured: give one at least")
    count, trains = int(holds.sum()), len(holds)
    return Share(count / trains, *(looks or Looks((trains,))).interval(count, trains), trains)


def counted(used: UsedLimits) -> dict[str, dict]:
    """By limit how many trains break it first, and at which speeds [r/min] how many; what none breaks is left out.

    A train breaks first the limit that it exceeds most at the lowest speed at which it exceeds any.
    """
    found: dict[str, Counter[float]] = defaultdict(Counter)
    for train in used.used:
        if len(broken := np.flatnonzero(train.max(axis=0) > 1.0)):
            limit = used.limits[int(np.argmax(train[:, broken[0]]))]
            found[limit][float(used.speeds_rpm[broken[0]])] += 1
    order = sorted(found.items(), key=lambda item: -item[1].total())
    return {
        limit: {"trains": speeds.total(), "speeds_rpm": {f"{speed:g}": speeds[speed] for speed in sorted(speeds)}}
        for limit, speeds in order
    }


def rank_correlation_shares(draws: dict[str, np.ndarray], worst: np.ndarray) -> dict[str, float]:
    """By tolerance its share of the scatter of the trains' ranks, the largest first.

    A share is the sum of the squared rank correlations (Spearman 1904) between each of a tolerance's draws (t, k) and
    the largest used share of a limit (t), less k / (t - 1), which is what chance alone gives; at least zero. It is too
    small for tolerances that only matter together, or to both sides alike.
    """
    t = len(worst)
    if t < 3 or np.all(worst == worst[0]):
        return dict.fromkeys(draws, 0.0)
    found = {}
    for label, drawn in draws.items():
        rho = [np.corrcoef(_ranks(column), _ranks(worst))[0, 1] for column in drawn.T]
        found[label] = max(0.0, float(np.sum(np.square(rho)) - len(rho) / (t - 1)))
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def yield_record(used: UsedLimits, share: Share, seed: int, to_blame: dict[str, float]) -> dict:
    """The keys that verification.json's "yield" and yield.json share: the share, what spoils the others, and why."""
    return {
        "share": share.share,
        "low": share.low,
        "high": share.high,
        "trains": share.trains,
        "seed": seed,
        "speeds_rpm": used.speeds_rpm.tolist(),
        "first_broken": counted(used),
        "blame": to_blame,
        "unexplained": max(0.0, 1.0 - sum(to_blame.values())),
    }


def _ranks(values: np.ndarray) -> np.ndarray:
    """The place of each value (t) among all of them from one on, the mean of their places for equal ones."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(count) - (count - 1) / 2)[place]


def _chances(trains: int, p: float) -> np.ndarray:
    """How likely 0 to n of n trains hold (n + 1), each with a chance of p, by logarithms of
    factorials: SciPy's statistics take long to load."""
    k = np.arange(trains + 1)
    ways = gammaln(trains + 1) - gammaln(k + 1) - gammaln(trains - k + 1)
    return np.exp(ways + xlogy(k, p) + xlog1py(trains - k, -p))
