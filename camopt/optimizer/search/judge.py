"""The judge of a search: event-exact settled motion at many speeds, and the usage of every limit on the motion."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import MotionLimit, limited_metrics, motion_limits
from camopt.measure.settling import decay_per_revolution
from camopt.scene.quantities import LESS_IS_WORSE
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.settled import PLAIN_REVOLUTIONS, SettledMetrics, revolutions_needed
from camopt.scene.train import Train, build_train

WATCHED_SHARE = 0.4
"""Limit usage at a speed above which the speeds beside it are judged too, if only some of the speeds are judged."""
SETTLES, SETTLES_SLOWLY, MEASURES = 16, 120, 1
"""Largest number of revolutions in which a motion may settle from the state of the previous cam, the same for a train
whose slowest mode decays slowly, and number of settled revolutions that are measured: one periodic revolution suffices
during the search, and the verdict measures four. Trains with memory settle as elsewhere: oil leaks slowly."""
IRREGULAR = 1.5
"""Factor on the limit usage of an aperiodic motion, of whose range the measured revolutions cover only a part. In the
verdict the metrics of such motions differ by a quarter to three quarters between neighbouring cases."""
JUDGED, FIGURE = ("speeds_rpm", "limited", "limit", "share", "states", "spread"), "figure:"
"""Names of the stored arrays of `Judged`, and prefix of the names of its metrics' arrays."""
CRITICAL = 4
"""Number of speeds that are judged before all others if only some of the speeds are judged: two per thread."""


@dataclass(frozen=True)
class Judged:
    """Judged motions of a cam: values by metric (s), limit usage (l, s), and settled states at -180 deg (s, 2n + r)."""

    speeds_rpm: np.ndarray
    figures: dict[str, np.ndarray]
    limited: tuple[str, ...]  # metric names, one per row of `share`
    limit: np.ndarray  # (l) their limits, in the metrics' units
    share: np.ndarray  # limit usage; infinite where the valve never seats or the motion is refused
    states: np.ndarray
    spread: np.ndarray  # (s) IRREGULAR where the motion is aperiodic, else 1

    @property
    def used(self) -> float:
        """Largest limit usage at any speed, with the factor for aperiodic motions."""
        return float((self.spread * self.share).max(initial=0.0))

    @property
    def worst_speed_rpm(self) -> float:
        """Speed [r/min] of the largest limit usage."""
        return float(self.speeds_rpm[int(np.argmax(self.share.max(axis=0)))]) if self.share.size else np.nan

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """All arrays by name, for a file from which `of_arrays` restores them."""
        arrays = {name: np.array(getattr(self, name)) for name in JUDGED}
        return arrays | {FIGURE + name: values for name, values in self.figures.items()}

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, np.ndarray]) -> "Judged":
        """Restores the object from its `arrays`."""
        own: dict[str, Any] = {name: arrays[name] for name in JUDGED} | {"limited": tuple(map(str, arrays["limited"]))}
        figures = {name.removeprefix(FIGURE): values for name, values in arrays.items() if name.startswith(FIGURE)}
        return cls(figures=figures, **own)

    def joined(self, more: "Judged") -> "Judged":
        """The judged motions of both, in the order of their speeds."""
        order = np.argsort(np.concatenate([self.speeds_rpm, more.speeds_rpm]))

        def join(first: np.ndarray, second: np.ndarray, axis: int = 0) -> np.ndarray:
            return np.take(np.concatenate([first, second], axis), order, axis)

        return replace(
            self,
            speeds_rpm=join(self.speeds_rpm, more.speeds_rpm),
            figures={name: join(values, more.figures[name]) for name, values in self.figures.items()},
            share=join(self.share, more.share, axis=1),
            states=join(self.states, more.states),
            spread=join(self.spread, more.spread),
        )

    def worst(self, name: str) -> float:
        """Worst value of a metric over the speeds."""
        return float((np.min if name in LESS_IS_WORSE else np.max)(self.figures[name]))


def limit_usage(limits: Iterable[MotionLimit], metrics: SettledMetrics) -> np.ndarray:
    """Limit usage (l, s) of the settled motions of one train and cam, from the worst of the measured revolutions."""
    used = [limit.share(metrics.worst(limit.metric)[0, 0]) for limit in limits]
    return np.array(used).reshape(-1, len(metrics.cam_speeds))


def with_speeds_between(judged: Judged, band: Judged) -> Judged:
    """The judged motions in which each speed has the largest limit usage of the nearest speeds of the `band`."""
    nearest = np.searchsorted(0.5 * (judged.speeds_rpm[1:] + judged.speeds_rpm[:-1]), band.speeds_rpm)
    share, spread = judged.share.copy(), judged.spread.copy()
    np.maximum.at(share.T, nearest, band.share.T)
    np.maximum.at(spread, nearest, band.spread)
    return replace(judged, share=share, spread=spread)


def next_starts(states: np.ndarray, share: np.ndarray, anew: np.ndarray) -> np.ndarray:
    """Initial states (s, 2n + r) of the next cam's motions: the settled `states` of the last ones, or `anew` where
    these broke a limit, according to their usage `share` (l, s), or were refused.

    Otherwise an adjuster that pumped up with one cam would hold the valve off its seat with all later cams.
    """
    holds = share.max(axis=0, initial=0.0)[:, None] <= 1.0
    return np.where(holds & np.isfinite(states), states, anew)


def most_to_settle(train: Train, cam_speed: float) -> int:
    """Largest number of revolutions in which a motion at `cam_speed` [rad/s] may settle from the previous cam's state,
    whose transient decays with the slowest mode and would otherwise make the motion count as aperiodic.
    """
    if train.memory:
        return PLAIN_REVOLUTIONS
    needed = revolutions_needed(decay_per_revolution(train, cam_speed))
    return SETTLES if needed <= PLAIN_REVOLUTIONS else min(needed, SETTLES_SLOWLY)


class Judge:
    """Judges cams of one scene at fixed speeds [crankshaft r/min]; motions start from the last cam's settled states.

    With a `stride` above one, the speeds at which the limits were used most so far are judged first, then one speed in
    `stride`, then the speeds beside those with a large usage. Judging ends as soon as a usage exceeds `usable`.
    """

    def __init__(self, scene: Scene, speeds_rpm, stride: int = 1, usable: float = np.inf, workers: int = 2):
        self.scene, self.speeds_rpm, self.stride = scene, np.asarray(speeds_rpm, dtype=float), stride
        train = build_train(scene)
        self._train, self._workers, self._usable = train, workers, usable
        self._start = state_at_rest(train)
        self._states = np.tile(self._start, (len(self.speeds_rpm), 1))
        self._used = np.zeros(len(self.speeds_rpm))  # largest limit usage at each speed when it was last judged
        self.calls = 0

    def __call__(self, lift: Lift) -> Judged:
        self.calls += 1
        regular = np.arange(0, len(self.speeds_rpm), self.stride)
        done = np.sort(np.argsort(-self._used)[:CRITICAL]) if self.stride > 1 else regular
        judged = self._judged_at(lift, done)
        for beside in (False, True):
            if judged.used > self._usable:
                break
            at = np.setdiff1d(self._beside(judged) if beside else regular, done)
            if len(at):
                judged, done = judged.joined(self._judged_at(lift, at)), np.union1d(done, at)
        self.remember(judged)
        return judged

    def _beside(self, judged: Judged) -> np.ndarray:
        """Indices of the speeds beside those `judged` whose limit usage is large."""
        much = judged.share.max(axis=0, initial=0.0) > WATCHED_SHARE
        watched, indices = np.searchsorted(self.speeds_rpm, judged.speeds_rpm[much]), np.arange(len(self.speeds_rpm))
        return indices[(np.abs(indices[:, None] - watched) < self.stride).any(axis=1)]

    def remember(self, judged: Judged) -> None:
        """Sets the initial states of the next motions; a resumed search thus settles as an uninterrupted one."""
        at = np.searchsorted(self.speeds_rpm, judged.speeds_rpm)
        self._used[at] = judged.share.max(axis=0, initial=0.0)
        self._states[at] = next_starts(judged.states, judged.share, self._start)

    def _judged_at(self, lift: Lift, at: np.ndarray) -> Judged:
        """The judged motions at the speeds with the ascending indices `at`."""
        limits = tuple(motion_limits(self.scene.design).values())
        speeds = [self.scene.cam_speed(s) for s in self.speeds_rpm[at]]
        metrics = settled_metrics(
            [self._train],
            [lift],
            speeds,
            starts=self._states[at],
            decay=np.inf,
            most=most_to_settle(self._train, max(speeds)),
            measured=MEASURES,
            workers=self._workers,
        )
        return Judged(
            self.speeds_rpm[at],
            {name: metrics.worst(name)[0, 0] for name in limited_metrics(self.scene.design)},
            tuple(limit.metric for limit in limits),
            np.array([limit.value for limit in limits]),
            limit_usage(limits, metrics),
            metrics.states[0, 0],
            np.where(metrics.periodic[0, 0], 1.0, IRREGULAR),
        )
