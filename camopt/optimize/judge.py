"""The search's judge: event-exact settled motion at many speeds, each limited metric as a share of its limit."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.engine import prepare
from camopt.scene.errors import MotionRefused
from camopt.scene.response import end_state
from camopt.scene.rest import rest_position
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.verify.limits import motion_limits
from camopt.verify.settle import settle

SHARE = 0.95
"""Part of every limit on the motion that a search may use: the rest is for speeds and neighbours it did not see."""
LEAST_LIMIT = 1e-6
"""Stands in for a limit of zero in its share: a nanometre, in metrics counted in mm."""


@dataclass(frozen=True)
class Judged:
    """What the judge found: figures by metric (s), shares of the limits (l, s), settled states at -180 deg (s, 2n)."""

    speeds_rpm: np.ndarray
    figures: dict[str, np.ndarray]
    limited: tuple[str, ...]  # metric names, one per row of `share`
    limit: np.ndarray  # (l) their limits, in the metrics' units
    share: np.ndarray  # value over limit; infinite where the valve never seats or the motion is refused
    states: np.ndarray

    @property
    def holds(self) -> bool:
        """Whether every limit is used by at most SHARE at every speed."""
        return bool(self.share.size == 0 or self.share.max() <= SHARE)

    @property
    def worst_speed_rpm(self) -> float:
        """Speed at which a limit is used most."""
        return float(self.speeds_rpm[int(np.argmax(self.share.max(axis=0)))]) if self.share.size else np.nan

    def worst(self, name: str) -> float:
        """Largest value of a metric over the speeds."""
        return float(np.max(self.figures[name]))


class Judge:
    """Judges cams of one scene at fixed speeds [crankshaft r/min]; remembers settled states to settle sooner."""

    def __init__(self, scene: Scene, speeds_rpm, workers: int = 2):
        self.scene, self.speeds_rpm = scene, np.asarray(speeds_rpm, dtype=float)
        train = build_train(scene)
        self._trains = [replace(train) for _ in range(workers)]  # each thread keeps its own propagators
        self._start = np.concatenate([rest_position(train), np.zeros(len(train.mass))])
        self._states = np.tile(self._start, (len(self.speeds_rpm), 1))
        self.calls = 0

    def __call__(self, lift: Lift) -> Judged:
        workers = len(self._trains)

        def deal(hand: int):
            own = range(hand, len(self.speeds_rpm), workers)
            return [self._at(self._trains[hand], lift, i) for i in own]

        with ThreadPoolExecutor(workers) as pool:
            hands = list(pool.map(deal, range(workers)))
        found = [hands[i % workers][i // workers] for i in range(len(self.speeds_rpm))]
        figures = {name: np.array([f[name] for f, _ in found]) for name in found[0][0]}
        states = np.array([s for _, s in found])
        self.calls += 1
        limits = motion_limits(self.scene.design)
        names, limit = tuple(n for n, _ in limits.values()), np.array([v for _, v in limits.values()])
        share = np.array([figures[n] / max(v, LEAST_LIMIT) for n, v in zip(names, limit, strict=True)])
        share = np.nan_to_num(share.reshape(len(limits), -1), nan=np.inf)
        judged = Judged(self.speeds_rpm, figures, names, limit, share, states)
        self.remember(judged)
        return judged

    def remember(self, judged: Judged) -> None:
        """Start the next settling from these states: a resumed search settles as the unbroken one did."""
        self._states = np.where(np.isfinite(judged.states), judged.states, self._start)

    def _at(self, train, lift: Lift, i: int) -> tuple[dict[str, float], np.ndarray]:
        names = dict.fromkeys(("bounce_mm", *(n for n, _ in motion_limits(self.scene.design).values())))
        try:
            settled = settle(prepare(train, lift, self.scene.cam_speed(self.speeds_rpm[i])), self._states[i])
        except MotionRefused:
            return dict.fromkeys(names, np.inf), np.full_like(self._start, np.nan)
        figures = settled.metrics(lift)
        return {n: figures.worst(n) for n in names}, end_state(settled.response)
