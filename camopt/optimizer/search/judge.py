"""The search's judge: event-exact settled motion at many speeds, each limited metric as a share of its limit."""

from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import MotionLimit, motion_limits
from camopt.scene.quantities import LESS_IS_WORSE
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.settled import PLAIN_REVOLUTIONS
from camopt.scene.train import build_train

USABLE_SHARE = 0.8
"""Part of every limit on the motion that a search may use: the rest is for speeds and neighbours it did not see."""
SETTLES, MEASURES = 16, 1
"""Revolutions that a motion may take to settle from the state of the cam judged before, and how many of a settled one
are measured: what repeats to a micrometre need not be measured four times before the verdict does. A train with
memories settles as everywhere else, since its oil leaks over more revolutions."""
CRITICAL = 2
"""Speeds judged before all others where only the answer counts: one per thread."""


@dataclass(frozen=True)
class Judged:
    """What the judge found: figures by metric (s), shares of the limits (l, s), settled states at -180 deg (s, 2n)."""

    speeds_rpm: np.ndarray
    figures: dict[str, np.ndarray]
    limited: tuple[str, ...]  # metric names, one per row of `share`
    limit: np.ndarray  # (l) their limits, in the metrics' units
    share: np.ndarray  # how much of the limit is used; infinite where the valve never seats or the motion is refused
    states: np.ndarray

    @property
    def holds(self) -> bool:
        """Whether every limit is used by at most USABLE_SHARE at every speed."""
        return bool(self.share.size == 0 or self.share.max() <= USABLE_SHARE)

    @property
    def worst_speed_rpm(self) -> float:
        """Speed at which a limit is used most."""
        return float(self.speeds_rpm[int(np.argmax(self.share.max(axis=0)))]) if self.share.size else np.nan

    def worst(self, name: str) -> float:
        """Worst value of a metric over the speeds."""
        return float((np.min if name in LESS_IS_WORSE else np.max)(self.figures[name]))

    @property
    def share_slopes(self) -> np.ndarray:
        """Derivative of every row of `share` by its metric (l), in one over the metrics' units."""
        return np.array([MotionLimit(*row).share_slope for row in zip(self.limited, self.limit, strict=True)])


def next_starts(states: np.ndarray, share: np.ndarray, anew: np.ndarray) -> np.ndarray:
    """Where the next cam's motions begin (s, 2n + r): where the last ones settled, or `anew` where these broke a limit,
    by their shares of the limits (l, s), or were refused.

    An adjuster that pumped up with one cam would hold the valve off its seat with every other.
    """
    holds = share.max(axis=0, initial=0.0)[:, None] <= 1.0
    return np.where(holds & np.isfinite(states), states, anew)


class Judge:
    """Judges cams of one scene at fixed speeds [crankshaft r/min]; remembers settled states to settle sooner.

    Every `stride`-th speed is judged first, and the others only for a cam that holds there. A call with `briefly` asks
    only whether the cam holds: the speeds at which cams used their limits most so far come before all others.
    """

    def __init__(self, scene: Scene, speeds_rpm, stride: int = 1, workers: int = 2):
        self.scene, self.speeds_rpm, self.stride = scene, np.asarray(speeds_rpm, dtype=float), stride
        train = build_train(scene)
        self._train, self._workers = train, workers
        self._start = state_at_rest(train)
        self._states = np.tile(self._start, (len(self.speeds_rpm), 1))
        self._used = np.zeros(len(self.speeds_rpm))  # largest share of a limit when last judged there
        self.calls = 0

    def __call__(self, lift: Lift, briefly: bool = False) -> Judged:
        self.calls += 1
        every = np.arange(len(self.speeds_rpm))
        critical = [np.sort(np.argsort(-self._used)[:CRITICAL])] if briefly else []
        found: dict[int, tuple[dict[str, float], np.ndarray]] = {}
        for group in (*critical, every[:: self.stride], every):
            found |= self._found(lift, np.setdiff1d(group, [*found]))
            judged = self._judged(found)
            if not judged.holds:
                break
        self.remember(judged)
        return judged

    def remember(self, judged: Judged) -> None:
        """Start the next settling from these states, or from rest: a resumed search settles as the unbroken one did."""
        at = np.searchsorted(self.speeds_rpm, judged.speeds_rpm)
        self._used[at] = judged.share.max(axis=0, initial=0.0)
        self._states[at] = next_starts(judged.states, judged.share, self._start)

    def _judged(self, found: dict[int, tuple[dict[str, float], np.ndarray]]) -> Judged:
        at = sorted(found)
        limits = motion_limits(self.scene.design).values()
        names, values = tuple(m.metric for m in limits), np.array([m.value for m in limits])
        figures = {name: np.array([found[i][0][name] for i in at]) for name in found[at[0]][0]}
        share = np.array([m.share(figures[m.metric]) for m in limits]).reshape(len(names), len(at))
        return Judged(self.speeds_rpm[at], figures, names, values, share, np.array([found[i][1] for i in at]))

    def _found(self, lift: Lift, at: np.ndarray) -> dict[int, tuple[dict[str, float], np.ndarray]]:
        """Figures and settled state at the speeds of the indices `at`."""
        if len(at) == 0:
            return {}
        names = dict.fromkeys(("bounce_mm", *(n for n, _ in motion_limits(self.scene.design).values())))
        speeds = [self.scene.cam_speed(s) for s in self.speeds_rpm[at]]
        most = PLAIN_REVOLUTIONS if self._train.memory else SETTLES
        found = settled_metrics(
            [self._train],
            [lift],
            speeds,
            starts=self._states[at],
            decay=np.inf,
            most=most,
            measured=MEASURES,
            workers=self._workers,
        )
        worst = {name: found.worst(name)[0, 0] for name in names}
        return {int(i): ({n: float(worst[n][k]) for n in names}, found.states[0, 0, k]) for k, i in enumerate(at)}
