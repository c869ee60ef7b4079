"""Drawn trains with a cam: how much of the limits each uses at each of its speeds.

Every train has its own numbers, its own ground cam and its own speeds, which are staggered from train to train, so that
the ensemble samples the band more finely than each train alone. A train remembers what it used and where
it settled, so that of the next cam, which differs little, only what matters need be judged, and settles sooner. A train
with an adjuster is judged from where the train as designed settles with the cam, if that holds its limits, else from
rest.
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
from camopt.optimizer.as_built.measured import WORKERS, first_look, used_by_looks, used_limits
from camopt.optimizer.search.judge import MEASURES, most_to_settle, next_starts
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

FOLDER, MET = "drawn", ("at", "used", "states")
"""Where a search keeps what trains met at its steps, and the names of the arrays."""
SPEEDS, STAGGER = 11, 4
"""Speeds at which a train is judged, and after how many trains the same speeds come again."""
CHORDS = 8
"""Chords of a curved law in drawn trains: half as many as elsewhere take two fifths of the time and change what a train
of race-nested uses of its limits by half a percent at most. The statement takes as many as elsewhere."""
UNJUDGED = 0.99
"""Part of a limit that a train counts as using before it is judged, so that it is."""
WATCHED = 0.6
"""A train is judged with every cam at the speeds where it last used more of a limit than this."""


@dataclass
class TrainEnsemble:
    """Trains (t) drawn for a search, each at its speeds (s) of the scene's band, and what they used of the limits (l).

    `used` (t, l, s) is one at the limit and more beyond it, `states` (t, s, 2n + r) is where the motions settled.
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
        """Cam speeds [rad/s] by place in the stagger and number (STAGGER, s); the last one is the top of the band."""
        fine = np.linspace(*self.scene.required_operation.band_rpm, STAGGER * SPEEDS)
        found = np.array([self.scene.cam_speed(rpm) for rpm in fine]).reshape(SPEEDS, STAGGER).T
        found[:, -1] = found[-1, -1]  # where most of them fail
        return found

    def speeds(self, train: int) -> np.ndarray:
        """Cam speeds (s) [rad/s] of the train of a number."""
        return self._cam_speeds[train % STAGGER]

    @property
    def worst(self) -> np.ndarray:
        """The largest part of a limit that each train uses (t), as far as it was judged."""
        return self.used.max(axis=(1, 2), initial=0.0)

    @property
    def failing(self) -> int:
        """How many trains break a limit, as far as they were judged."""
        return int(np.sum(self.worst > 1.0))

    @property
    def watched(self) -> np.ndarray:
        """Which trains are watched at which speeds (t, s: bool)."""
        return self.used.max(axis=1) > WATCHED

    def matters(self, part: float) -> np.ndarray:
        """The speeds at which more than this part of the trains is watched, and the top of the band (s: bool)."""
        matters = self.watched.mean(axis=0) > part
        matters[-1] = True
        return matters

    def settle(self, lift: Lift) -> None:
        """Lets trains drawn from now on, and with an adjuster all of them, begin where the one as designed settles with
        a cam, if it holds its limits."""
        train = build_train(self.scene)
        found = settled_metrics([train], [lift], self._cam_speeds.ravel().tolist())
        starts = next_starts(found.states[0, 0], used_limits(self.limits, found), state_at_rest(train))
        self._nominal = starts.reshape(self._nominal.shape)

    def draw(self, count: int, unsure: np.ndarray | None = None) -> None:
        """Draws trains until there are so many; they count as near their limits at the speeds that are `unsure` (s:
        bool), by default at all of them, until they are judged there."""
        first = len(self.trains)
        drawn = trains_as_built(self.scene, count - first, seed=self.seed, first=first)
        self.trains += [replace(one, train=with_chords(one.train, CHORDS)) for one in drawn]
        new = np.arange(first, count)
        self.states = np.concatenate([self.states, self._nominal[new % STAGGER]])
        self.used = np.concatenate([self.used, np.zeros((len(new), len(self.limits), SPEEDS))])
        self.used[first:, :, slice(None) if unsure is None else unsure] = UNJUDGED

    def doubt(self, unsure: np.ndarray) -> None:
        """Lets all trains count as near their limits at the speeds that are `unsure` (s: bool), until they are judged
        there with another cam."""
        self.used[:, :, unsure] = UNJUDGED

    def begin_anew(self, train: int, speed: int) -> None:
        """Lets a train begin at one of its speeds where the train as designed has settled: no motion leads back from an
        adjuster that has pumped up, nor from where a motion was refused."""
        self.states[train, speed] = self._nominal[train % STAGGER, speed]

    def judge(self, lift: Lift, wanted: np.ndarray) -> None:
        """Judges a cam with the trains at the speeds that are `wanted` (t, s: bool)."""
        rows = np.flatnonzero(wanted.any(axis=1))
        with ThreadPoolExecutor(WORKERS) as pool:
            list(pool.map(lambda t: self._one(lift, int(t), np.flatnonzero(wanted[t])), rows))

    def _one(self, lift: Lift, t: int, at: np.ndarray) -> None:
        one, speeds, rough = self.trains[t], self.speeds(t)[at], first_look(self.limits)
        if one.train.memory:  # what the cam before left in an adjuster would decide its motion, unlike the statement's
            starts, looks = self._nominal[t % STAGGER, at], (rough, {})
        else:
            how = {"decay": np.inf, "most": most_to_settle(one.train, speeds.max()), "measured": MEASURES}
            starts, looks = self.states[t, at], (rough | how, how)
        self.used[t][:, at], ends = used_by_looks(self.limits, one.train, one.cam(lift), speeds, starts, looks)
        self.states[t, at] = next_starts(ends, self.used[t][:, at], self._nominal[t % STAGGER, at])

    def met(self, judged: np.ndarray) -> dict[str, np.ndarray]:
        """What the trains met with a cam, for a file, at the speeds at which they were `judged` (t, s: bool)."""
        at = np.nonzero(judged)
        return {"at": np.stack(at), "used": self.used[at[0], :, at[1]], "states": self.states[at]}

    def take(self, met: Mapping[str, np.ndarray]) -> None:
        """Takes over what trains met."""
        trains, speeds = met["at"]
        self.used[trains, :, speeds], self.states[trains, speeds] = met["used"], met["states"]
