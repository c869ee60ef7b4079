"""An ensemble of drawn trains, and how much of each limit every train uses with a cam.

Every train has its own numbers, its own ground cam and its own speeds. The speeds are staggered from train to train, so
that the ensemble samples the band more finely than each train alone. The ensemble stores the limit usage and the
settled states of the last cam. The next cam differs little, so that only the trains and speeds near a limit need be
judged again, and their motions settle sooner from the stored states. A train with an adjuster starts where the train as
designed settles with the cam if that motion keeps its limits, else from rest.
"""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact import with_chords
from camopt.exact.settled import settled_metrics
from camopt.measure.as_built import TrainAsBuilt, trains_as_built
from camopt.measure.limits import MotionLimit, motion_limits
from camopt.optimizer.as_built.measured import WORKERS, short_motions, staged_usage
from camopt.optimizer.search.judge import MEASURES, limit_usage, most_to_settle, next_starts
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

FOLDER, STORED = "drawn", ("at", "used", "states")
"""Folder of a run in which a search stores the results of its trains at each step, and the names of the arrays."""
SPEEDS, STAGGER = 11, 4
"""Number of speeds at which each train is judged, and number of trains after which the same speeds recur."""
CHORDS = 8
"""Chords that replace a curved law in drawn trains. Half as many as elsewhere take two fifths of the time and change
the limit usage of a train of race-nested by half a percent at most. The statement uses the full number."""
UNJUDGED = 0.99
"""Limit usage assigned to a train that has not been judged yet; it is above WATCHED, so that the train is judged."""
WATCHED = 0.6
"""Limit usage at a speed above which a train is judged there with every cam."""


@dataclass
class TrainEnsemble:
    """Trains (t) drawn for a search, each at its speeds (s) of the scene's band, and their usage of the limits (l).

    The usage `used` (t, l, s) is one at the limit and larger beyond it; `states` (t, s, 2n + r) are the settled states.
    """

    scene: Scene
    seed: int
    trains: list[TrainAsBuilt] = field(default_factory=list)
    used: np.ndarray = field(init=False)
    states: np.ndarray = field(init=False)

    def __post_init__(self):
        rest = state_at_rest(build_train(self.scene))
        self._nominal = np.tile(rest, (STAGGER, SPEEDS, 1))
        self.used = np.zeros((0, len(self.limits), SPEEDS))
        self.states = np.zeros((0, SPEEDS, len(rest)))

    @cached_property
    def has_memory(self) -> bool:
        """Whether an adjuster, an oil column or friction remembers how the trains moved."""
        return bool(build_train(self.scene).memory)

    @cached_property
    def limits(self) -> tuple[MotionLimit, ...]:
        """The limits on the motion (l)."""
        return tuple(motion_limits(self.scene.design).values())

    @cached_property
    def _cam_speeds(self) -> np.ndarray:
        """Cam speeds [rad/s] by place in the stagger and by index (STAGGER, s); the last one is the top of the band."""
        fine = np.linspace(*self.scene.required_operation.band_rpm, STAGGER * SPEEDS)
        speeds = np.array([self.scene.cam_speed(rpm) for rpm in fine]).reshape(SPEEDS, STAGGER).T
        speeds[:, -1] = speeds[-1, -1]  # most trains fail at the top speed, so all of them have it
        return speeds

    def speeds(self, train: int) -> np.ndarray:
        """Cam speeds (s) [rad/s] of the train with this number."""
        return self._cam_speeds[train % STAGGER]

    @property
    def worst(self) -> np.ndarray:
        """Largest limit usage of each train (t) at the speeds judged so far."""
        return self.used.max(axis=(1, 2), initial=0.0)

    @property
    def failing(self) -> int:
        """Number of trains that break a limit at the speeds judged so far."""
        return int(np.sum(self.worst > 1.0))

    @property
    def watched(self) -> np.ndarray:
        """Whether each train is watched at each speed (t, s: bool): its limit usage there exceeds WATCHED."""
        return self.used.max(axis=1) > WATCHED

    def critical_speeds(self, fraction: float) -> np.ndarray:
        """Speeds at which more than this fraction of the trains is watched, and the top of the band (s: bool)."""
        critical = self.watched.mean(axis=0) > fraction
        critical[-1] = True
        return critical

    def settle(self, lift: Lift) -> None:
        """Sets the initial states of trains drawn from now on, and of all trains with memory, to the settled states of
        the train as designed with a cam, or to rest at the speeds where that motion breaks a limit."""
        train = build_train(self.scene)
        metrics = settled_metrics([train], [lift], self._cam_speeds.ravel().tolist())
        starts = next_starts(metrics.states[0, 0], limit_usage(self.limits, metrics), state_at_rest(train))
        self._nominal = starts.reshape(self._nominal.shape)

    def draw(self, count: int, unjudged: np.ndarray | None = None) -> None:
        """Draws trains until the ensemble has `count` of them.

        The new trains count as near their limits at the speeds `unjudged` (s: bool), by default at all of them.
        """
        first = len(self.trains)
        drawn = trains_as_built(self.scene, count - first, seed=self.seed, first=first)
        self.trains += [replace(built, train=with_chords(built.train, CHORDS)) for built in drawn]
        new = np.arange(first, count)
        self.states = np.concatenate([self.states, self._nominal[new % STAGGER]])
        self.used = np.concatenate([self.used, np.zeros((len(new), len(self.limits), SPEEDS))])
        self.used[first:, :, slice(None) if unjudged is None else unjudged] = UNJUDGED

    def mark_unjudged(self, unjudged: np.ndarray) -> None:
        """Marks all trains as near their limits at the speeds `unjudged` (s: bool), so that they are judged again."""
        self.used[:, :, unjudged] = UNJUDGED

    def reset_state(self, train: int, speed: int) -> None:
        """Resets the initial state of a train at one of its speeds to the settled state of the train as designed, since
        a motion does not recover from a pumped-up adjuster, nor from a state in which it was refused."""
        self.states[train, speed] = self._nominal[train % STAGGER, speed]

    def judge(self, lift: Lift, wanted: np.ndarray) -> None:
        """Updates the limit usage with a cam for the trains and speeds `wanted` (t, s: bool)."""
        rows = np.flatnonzero(wanted.any(axis=1))
        with ThreadPoolExecutor(WORKERS) as pool:
            list(pool.map(lambda t: self._judge_train(lift, int(t), np.flatnonzero(wanted[t])), rows))

    def _judge_train(self, lift: Lift, t: int, at: np.ndarray) -> None:
        built, speeds, rough = self.trains[t], self.speeds(t)[at], short_motions(self.limits)
        if built.train.memory:  # oil that the previous cam left in an adjuster would decide; the statement has none
            starts, looks = self._nominal[t % STAGGER, at], (rough, {})
        else:
            how = {"decay": np.inf, "most": most_to_settle(built.train, speeds.max()), "measured": MEASURES}
            starts, looks = self.states[t, at], (rough | how, how)
        self.used[t][:, at], ends = staged_usage(self.limits, built.train, built.cam(lift), speeds, starts, looks)
        self.states[t, at] = next_starts(ends, self.used[t][:, at], self._nominal[t % STAGGER, at])

    def stored_arrays(self, judged: np.ndarray) -> dict[str, np.ndarray]:
        """The arrays that are stored for a cam: limit usage and states where trains were `judged` (t, s: bool)."""
        at = np.nonzero(judged)
        return {"at": np.stack(at), "used": self.used[at[0], :, at[1]], "states": self.states[at]}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Restores limit usage and states from the stored arrays of a cam."""
        trains, speeds = arrays["at"]
        self.used[trains, :, speeds], self.states[trains, speeds] = arrays["used"], arrays["states"]
