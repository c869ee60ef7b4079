"""How many trains a share needs: it is looked at several times, and counting ends where a look decides.

A share that is far from the wanted one is decided by few trains, one next to it by none. Early looks decide only where
an interval of 99.9 % leaves the wanted share out (Haybittle 1971, British Journal of Radiology 44; Peto et al. 1976,
British Journal of Cancer 34). The interval that is stated at the end knows of the looks: it is made of the exact
distribution of where counting ends, with the ends ordered by their share (Armitage 1958, Biometrika 45). With one look
it is that of Clopper and Pearson (1934), Biometrika 26. Like theirs, it holds the true share in at least 95 of 100
repetitions, whatever that share is.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.optimize import brentq
from scipy.special import bdtr, bdtrc, gammaln, xlog1py, xlogy

from camopt.measure.yield_words import CONFIDENCE

EARLY = 1e-3
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


def _chances(trains: int, p: float) -> np.ndarray:
    """How likely 0 to n of n trains hold (n + 1), each with a chance of p.

    By logarithms of factorials, without SciPy's statistics, which take longer to load than all of this.
    """
    k = np.arange(trains + 1)
    ways = gammaln(trains + 1) - gammaln(k + 1) - gammaln(trains - k + 1)
    return np.exp(ways + xlogy(k, p) + xlog1py(trains - k, -p))
