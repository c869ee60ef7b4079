"""What drawn trains tell of a cam: the share that holds every limit, what breaks first, which tolerance is to blame.

Everything here is arithmetic on the parts of the limits that the trains use; whoever computes motions brings these.
"""

from dataclasses import dataclass

import numpy as np

from camopt.measure.looks import Looks
from camopt.measure.yield_words import CONFIDENCE
from camopt.scene.errors import InputError


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

    def first_broken(self) -> list[tuple[str, float] | None]:
        """By train the limit that is exceeded most at the lowest speed at which any is, and that speed; None: holds."""
        found: list[tuple[str, float] | None] = []
        for train in self.used:
            broken = np.flatnonzero(train.max(axis=0) > 1.0)
            if not len(broken):
                found.append(None)
                continue
            s = broken[0]
            found.append((self.limits[int(np.argmax(train[:, s]))], float(self.speeds_rpm[s])))
        return found

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
    """The share of trains (t) that hold, with its interval, where counting might have ended after each of the `looks`.

    Without them so many trains were counted in any case, and the interval is that of Clopper and Pearson (1934),
    Biometrika 26. It holds the true share in at least 95 of 100 draws, whatever the share and the number of trains are.
    """
    if not len(holds):
        raise InputError("yield: no train was measured: give one at least")
    count, trains = int(holds.sum()), len(holds)
    return Share(count / trains, *(looks or Looks((trains,))).interval(count, trains), trains)


def counted(used: UsedLimits) -> dict[str, dict]:
    """By limit how many trains break it first, and at which speeds [r/min] how many; what none breaks is left out."""
    found: dict[str, dict] = {}
    for broken in filter(None, used.first_broken()):
        limit, speed = broken
        entry = found.setdefault(limit, {"trains": 0, "speeds_rpm": {}})
        entry["trains"] += 1
        entry["speeds_rpm"][f"{speed:g}"] = entry["speeds_rpm"].get(f"{speed:g}", 0) + 1
    order = sorted(found, key=lambda limit: -found[limit]["trains"])
    return {limit: found[limit] | {"speeds_rpm": _ascending(found[limit]["speeds_rpm"])} for limit in order}


def blame(draws: dict[str, np.ndarray], worst: np.ndarray) -> dict[str, float]:
    """By tolerance its part in how the trains differ, the largest first.

    Part: the squares of the rank correlations (Spearman 1904) between each of a tolerance's draws (t, k) and the worst
    used part of a limit (t), summed, less k / (t - 1), which is what chance alone gives; at least zero. It is the share
    of the scatter of ranks that follows that tolerance's draws one by one. Tolerances that only matter together, or to
    both sides alike, get less than they deserve.
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


def _ascending(counts: dict[str, int]) -> dict[str, int]:
    return dict(sorted(counts.items(), key=lambda item: float(item[0])))
