"""The search's judge: event-exact settled motion at many speeds, each limited metric as a share of its limit."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import motion_limits
from camopt.measure.settling import decay_per_revolution
from camopt.scene.quantities import LESS_IS_WORSE
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.settled import PLAIN_REVOLUTIONS, revolutions_needed
from camopt.scene.train import Train, build_train

WATCHED_SHARE = 0.4
"""Part of a limit from whose use on the speeds beside one are judged too, where not all are."""
SETTLES, SETTLES_SLOWLY, MEASURES = 16, 120, 1
"""Revolutions that a motion may take to settle from the state of the cam judged before, those of a train whose slowest
mode fades slowly, and how many of a settled one are measured: one periodic revolution suffices during the search, and
the verdict measures four. A train with memories settles as everywhere else, since its oil leaks over more revolutions.
"""
IRREGULAR = 1.5
"""What a motion that does not repeat itself uses of its limits counts so many times: it met only a part of what it
may. The verdict finds that figures of such motions differ by a quarter to three quarters between neighbours."""
JUDGED, FIGURE = ("speeds_rpm", "limited", "limit", "share", "states", "spread"), "figure:"
"""Names of the arrays of `Judged`, and what stands before those of its figures."""
CRITICAL = 4
"""Speeds judged before all others where not all are: two per thread."""


@dataclass(frozen=True)
class Judged:
    """What the judge found: figures by metric (s), shares of the limits (l, s), settled states at -180 deg (s, 2n)."""

    speeds_rpm: np.ndarray
    figures: dict[str, np.ndarray]
    limited: tuple[str, ...]  # metric names, one per row of `share`
    limit: np.ndarray  # (l) their limits, in the metrics' units
    share: np.ndarray  # how much of the limit is used; infinite where the valve never seats or the motion is refused
    states: np.ndarray
    spread: np.ndarray  # (s) IRREGULAR where the motion does not repeat itself, else 1

    @property
    def used(self) -> float:
        """The largest share of a limit at any speed, with room for what a motion that wanders has not met yet."""
        return float((self.spread * self.share).max(initial=0.0))

    @property
    def worst_speed_rpm(self) -> float:
        """Speed at which a limit is used most."""
        return float(self.speeds_rpm[int(np.argmax(self.share.max(axis=0)))]) if self.share.size else np.nan

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """All of it by name, for a file; `of_arrays` reads it."""
        own = {name: np.array(getattr(self, name)) for name in JUDGED}
        return own | {FIGURE + name: values for name, values in self.figures.items()}

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, np.ndarray]) -> "Judged":
        """What was found, from its `arrays`."""
        own: dict[str, Any] = {name: arrays[name] for name in JUDGED} | {"limited": tuple(map(str, arrays["limited"]))}
        figures = {name.removeprefix(FIGURE): values for name, values in arrays.items() if name.startswith(FIGURE)}
        return cls(figures=figures, **own)

    def worst(self, name: str) -> float:
        """Worst value of a metric over the speeds."""
        return float((np.min if name in LESS_IS_WORSE else np.max)(self.figures[name]))


def with_speeds_between(judged: Judged, band: Judged) -> Judged:
    """What was judged, each speed standing for those of the band nearest to it, with the largest of their shares."""
    nearest = np.searchsorted(0.5 * (judged.speeds_rpm[1:] + judged.speeds_rpm[:-1]), band.speeds_rpm)
    share, spread = judged.share.copy(), judged.spread.copy()
    np.maximum.at(share.T, nearest, band.share.T)
    np.maximum.at(spread, nearest, band.spread)
    return replace(judged, share=share, spread=spread)


def next_starts(states: np.ndarray, share: np.ndarray, anew: np.ndarray) -> np.ndarray:
    """Where the next cam's motions begin (s, 2n + r): where the last ones settled, or `anew` where these broke a limit,
    by their shares of the limits (l, s), or were refused.

    An adjuster that pumped up with one cam would hold the valve off its seat with every other.
    """
    holds = share.max(axis=0, initial=0.0)[:, None] <= 1.0
    return np.where(holds & np.isfinite(states), states, anew)


def most_to_settle(train: Train, cam_speed: float) -> int:
    """Revolutions that a motion at `cam_speed` [rad/s] may take to settle from the state of the cam judged before.

    What is left of the motion with that cam counts as a motion that wanders, and it fades with the slowest mode.
    """
    if train.memory:
        return PLAIN_REVOLUTIONS
    needed = revolutions_needed(decay_per_revolution(train, cam_speed))
    return SETTLES if needed <= PLAIN_REVOLUTIONS else min(needed, SETTLES_SLOWLY)


class Judge:
    """Judges cams of one scene at fixed speeds [crankshaft r/min]; remembers settled states to settle sooner.

    With a `stride` one speed in so many is judged, those at which cams used their limits most so far before all others,
    and then those beside the ones where much is used; it ends where more than `usable` of a limit is used.
    """

    def __init__(self, scene: Scene, speeds_rpm, stride: int = 1, usable: float = np.inf, workers: int = 2):
        self.scene, self.speeds_rpm, self.stride = scene, np.asarray(speeds_rpm, dtype=float), stride
        train = build_train(scene)
        self._train, self._workers, self._usable = train, workers, usable
        self._start = state_at_rest(train)
        self._states = np.tile(self._start, (len(self.speeds_rpm), 1))
        self._used = np.zeros(len(self.speeds_rpm))  # largest share of a limit when last judged there
        self.calls = 0

    def __call__(self, lift: Lift) -> Judged:
        self.calls += 1
        critical = np.sort(np.argsort(-self._used)[:CRITICAL]) if self.stride > 1 else []
        found: dict[int, tuple[dict[str, float], np.ndarray, bool]] = {}
        judged = None
        for group in (critical, np.arange(0, len(self.speeds_rpm), self.stride), None):
            if group is None:
                assert judged is not None, "there are speeds"
                group = self._beside(judged)
            at = np.setdiff1d(group, [*found])
            if len(at):
                found |= self._found(lift, at)
                judged = self._judged(found)
                if judged.used > self._usable:
                    break
        assert judged is not None, "there are speeds"
        self.remember(judged)
        return judged

    def _beside(self, judged: Judged) -> np.ndarray:
        """Indices of the speeds beside those `judged` at which much of a limit is used."""
        much = judged.share.max(axis=0, initial=0.0) > WATCHED_SHARE
        watched, every = np.searchsorted(self.speeds_rpm, judged.speeds_rpm[much]), np.arange(len(self.speeds_rpm))
        return every[(np.abs(every[:, None] - watched) < self.stride).any(axis=1)]

    def remember(self, judged: Judged) -> None:
        """Start the next settling from these states, or from rest: a resumed search settles as the unbroken one did."""
        at = np.searchsorted(self.speeds_rpm, judged.speeds_rpm)
        self._used[at] = judged.share.max(axis=0, initial=0.0)
        self._states[at] = next_starts(judged.states, judged.share, self._start)

    def _judged(self, found: Mapping[int, tuple[dict[str, float], np.ndarray, bool]]) -> Judged:
        at = sorted(found)
        limits = motion_limits(self.scene.design).values()
        names, values = tuple(m.metric for m in limits), np.array([m.value for m in limits])
        figures = {name: np.array([found[i][0][name] for i in at]) for name in found[at[0]][0]}
        share = np.array([m.share(figures[m.metric]) for m in limits]).reshape(-1, len(at))
        states, spread = np.array([found[i][1] for i in at]), np.array([1.0 if found[i][2] else IRREGULAR for i in at])
        return Judged(self.speeds_rpm[at], figures, names, values, share, states, spread)

    def _found(self, lift: Lift, at: np.ndarray) -> dict[int, tuple[dict[str, float], np.ndarray, bool]]:
        """Figures, settled state and whether the motion repeats itself, at the speeds of the indices `at`."""
        names = dict.fromkeys(("bounce_mm", *(n for n, _ in motion_limits(self.scene.design).values())))
        speeds = [self.scene.cam_speed(s) for s in self.speeds_rpm[at]]
        found = settled_metrics(
            [self._train],
            [lift],
            speeds,
            starts=self._states[at],
            decay=np.inf,
            most=most_to_settle(self._train, max(speeds)),
            measured=MEASURES,
            workers=self._workers,
        )
        worst = {name: found.worst(name)[0, 0] for name in names}
        rows = [{n: float(worst[n][k]) for n in names} for k in range(len(at))]
        each = zip(rows, found.states[0, 0], found.periodic[0, 0], strict=True)
        return {int(i): one for i, one in zip(at, each, strict=True)}
