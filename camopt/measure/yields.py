"""Yield: the share of drawn trains that keep every limit, with its interval, the first broken limits and their causes.

All results are computed from the trains' usage of each limit.

The share is tested several times (group-sequential test), and sampling ends when a test decides. An early test decides
only if a 99 % interval excludes the wanted share, in the manner of Haybittle (1971), British Journal of Radiology 44,
and Peto et al. (1976), British Journal of Cancer 34, whose intervals are wider. The interval stated at the end is
computed from the exact distribution of the stopping points, ordered by their share (Armitage 1958, Biometrika 45). With
a single test it is that of Clopper and Pearson (1934), Biometrika 26. Like theirs, it contains the true share in at
least 95 of 100 repetitions, whatever that share is.
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
"""Probability, two-sided, that one early test decides although the share equals the wanted one."""
TIE = 1e-12
"""Difference below which two shares are equal."""
EDGE = 1e-15
"""Distance from zero and one of the shares between which the ends of an interval are searched."""


@dataclass(frozen=True)
class Looks:
    """The plan of a group-sequential test: ascending numbers of trains (k) after which the share is tested.

    An early test decides whether the share is above or below `wanted`; after the last one sampling ends in any case.
    """

    trains: tuple[int, ...]
    wanted: float = 0.5

    def ends(self, holding: int, trains: int) -> bool:
        """Whether sampling ends if `holding` out of `trains`, one of the plan's numbers, keep every limit."""
        if trains >= self.trains[-1]:
            return True
        below, above = self._decision_bounds(trains)
        return holding <= below or holding >= above

    def interval(self, holding: int, trains: int) -> tuple[float, float]:
        """The interval of `CONFIDENCE` for the share if sampling ended with `holding` out of `trains`."""
        share, tail = holding / trains, (1.0 - CONFIDENCE) / 2

        def where(side: int) -> float:
            return float(cast(float, brentq(lambda p: self._tails(share, p)[side] - tail, EDGE, 1.0 - EDGE)))

        return 0.0 if holding == 0 else where(1), 1.0 if holding == trains else where(0)

    def coverage(self, p: float) -> float:
        """Probability that the interval contains the true share p."""
        ended = [(np.arange(len(mass)) / trains, mass) for trains, mass in self.ended(p)]
        shares, mass = (np.concatenate(arrays) for arrays in zip(*ended, strict=True))
        order = np.argsort(shares, kind="stable")
        shares, mass = shares[order], mass[order]
        first, last = np.searchsorted(shares, shares - TIE), np.searchsorted(shares, shares + TIE, "right")
        total = np.concatenate([[0.0], np.cumsum(mass)])
        tail = (1.0 - CONFIDENCE) / 2
        return float(mass[(total[last] > tail) & (total[-1] - total[first] > tail)].sum())

    def ended(self, p: float) -> Iterator[tuple[int, np.ndarray]]:
        """By test its number of trains n, and the probabilities (n + 1) that it ends with 0 to n holding, given p."""
        going, before = np.ones(1), 0
        for trains in self.trains:
            more = trains - before
            going = np.convolve(going, _binomial_probabilities(more, p))
            stops = np.ones(trains + 1, dtype=bool)
            if trains < self.trains[-1]:
                below, above = self._decision_bounds(trains)
                stops = (np.arange(trains + 1) <= below) | (np.arange(trains + 1) >= above)
            yield trains, np.where(stops, going, 0.0)
            going, before = np.where(stops, 0.0, going), trains

    def _decision_bounds(self, trains: int) -> tuple[int, int]:
        """Largest number of holding trains that decides for a smaller share, and smallest one for a larger share."""
        holding = np.arange(trains + 1)
        below = int(np.sum(bdtr(holding, trains, self.wanted) < EARLY / 2)) - 1
        return below, trains + 1 - int(np.sum(bdtrc(holding - 1, trains, self.wanted) < EARLY / 2))

    def _tails(self, share: float, p: float) -> tuple[float, float]:
        """Probabilities that sampling ends with at most, and with at least, this share if the true share is p."""
        low = high = 0.0
        for trains, mass in self.ended(p):
            shares = np.arange(trains + 1) / trains
            low += float(mass[shares <= share + TIE].sum())
            high += float(mass[shares >= share - TIE].sum())
        return low, high


@dataclass(frozen=True, repr=False)
class UsedLimits:
    """Usage of each limit (l) by each train (t) at each speed (s): one at the limit, more beyond it."""

    limits: tuple[str, ...]  # (l) keys of the design
    speeds_rpm: np.ndarray  # (s) ascending
    used: np.ndarray  # (t, l, s); infinite if the valve never seats or the motion is refused

    @property
    def worst(self) -> np.ndarray:
        """Largest usage of any limit by each train (t)."""
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
    """The share of trains (t) that hold, with its interval. `looks` is the plan of the tests after which sampling could
    have ended; without it the number of trains was fixed. Raises InputError without trains."""
    if not len(holds):
        raise InputError("yield: no train was measured: give one at least")
    count, trains = int(holds.sum()), len(holds)
    return Share(count / trains, *(looks or Looks((trains,))).interval(count, trains), trains)


def counted(used: UsedLimits) -> dict[str, dict]:
    """Numbers of trains that break each limit first, in all and by speed [r/min]; without limits that no train breaks.

    The limit that a train breaks first is the one that it exceeds most at the lowest speed at which it exceeds any.
    """
    by_limit: dict[str, Counter[float]] = defaultdict(Counter)
    for train in used.used:
        if len(broken := np.flatnonzero(train.max(axis=0) > 1.0)):
            limit = used.limits[int(np.argmax(train[:, broken[0]]))]
            by_limit[limit][float(used.speeds_rpm[broken[0]])] += 1
    order = sorted(by_limit.items(), key=lambda item: -item[1].total())
    return {
        limit: {"trains": speeds.total(), "speeds_rpm": {f"{speed:g}": speeds[speed] for speed in sorted(speeds)}}
        for limit, speeds in order
    }


def rank_correlation_shares(draws: dict[str, np.ndarray], worst: np.ndarray) -> dict[str, float]:
    """The share of every tolerance in the scatter of the trains' ranks, the largest first.

    It is the sum of the squared rank correlations (Spearman 1904) between each of a tolerance's draws (t, k) and the
    largest usage of a limit (t), minus its expectation k / (t - 1) without any correlation, and at least zero. It is
    too small for tolerances that matter only in combination, or that act alike in both directions.
    """
    t = len(worst)
    if t < 3 or np.all(worst == worst[0]):
        return dict.fromkeys(draws, 0.0)
    shares = {}
    for label, drawn in draws.items():
        rho = [np.corrcoef(_ranks(column), _ranks(worst))[0, 1] for column in drawn.T]
        shares[label] = max(0.0, float(np.sum(np.square(rho)) - len(rho) / (t - 1)))
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def yield_record(used: UsedLimits, share: Share, seed: int, to_blame: dict[str, float]) -> dict:
    """The keys common to "yield" in verification.json and to yield.json: the share, the limits that the other trains
    break first, and the tolerances that explain the scatter."""
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
    """Ranks of the values (t), from one; equal values have the mean of their ranks."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(count) - (count - 1) / 2)[place]


def _binomial_probabilities(trains: int, p: float) -> np.ndarray:
    """Binomial probabilities (n + 1) that 0 to n of n trains hold, each with probability p, by logarithms of
    factorials: `scipy.stats` takes long to load."""
    k = np.arange(trains + 1)
    ways = gammaln(trains + 1) - gammaln(k + 1) - gammaln(trains - k + 1)
    return np.exp(ways + xlogy(k, p) + xlog1py(trains - k, -p))
