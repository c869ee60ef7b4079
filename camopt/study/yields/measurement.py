"""The motions of drawn trains, train by train and chunk by chunk, stored as they are measured."""

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from camopt.cam.lift import Lift
from camopt.exact.settled import settled_metrics
from camopt.measure.as_built import TrainAsBuilt, trains_as_built
from camopt.measure.limits import MotionLimit, motion_limits
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.storage import append_line, plain, whole_lines

CHUNK = 20
"""Trains that are measured between two entries in the journal."""
WORKERS = 2
"""Threads, each with a train of its own."""


@dataclass(frozen=True)
class Track:
    """What every train is driven through: the cam as designed, cam speeds (s) [rad/s], and the states (s, 2n) [m], then
    [m/s], in which the train as designed has settled there, from which the drawn ones settle sooner."""

    lift: Lift
    cam_speeds: tuple[float, ...]
    starts: np.ndarray
    limits: Mapping[str, MotionLimit]

    def used(self, trains: Sequence[TrainAsBuilt]) -> np.ndarray:
        """How much of each limit (l) each train (t) uses at each speed (s), the worst of the measured revolutions."""
        with ThreadPoolExecutor(WORKERS) as pool:
            return np.array(list(pool.map(self._used_by, trains)))

    def _used_by(self, one: TrainAsBuilt) -> np.ndarray:
        lifts = [one.cam(self.lift)]
        found = settled_metrics([one.train], lifts, self.cam_speeds, starts=self.starts, workers=1)
        return np.array([limit.share(found.worst(limit.metric)[0, 0]) for limit in self.limits.values()])


def track(scene: Scene, lift: Lift, speeds_rpm: Sequence[float]) -> Track:
    """The track of a scene's cam at crankshaft speeds (s) [r/min]; InputError for laws that are not linear."""
    train, speeds = build_train(scene), tuple(scene.cam_speed(speed) for speed in speeds_rpm)
    states = settled_metrics([train], [lift], speeds).states[0, 0]
    starts = np.where(np.isfinite(states), states, state_at_rest(train))
    return Track(lift, speeds, starts, motion_limits(scene.design))


@dataclass
class TrainsJournal:
    """What was measured, by the tolerance that was halved ("" for none) and the train's number, in a file if named."""

    path: Path | None

    def __post_init__(self) -> None:
        self._rows: dict[tuple[str, int], dict] = {}
        for line in whole_lines(self.path) if self.path else ():
            row = json.loads(line)
            self._rows[row["halved"], row["train"]] = row

    def add(self, halved: str, number: int, used: Mapping[str, np.ndarray]) -> None:
        """Notes how much of each limit a train uses at each speed (s)."""
        row = plain({"halved": halved, "train": number, "used": used})
        self._rows[halved, number] = row
        if self.path is not None:
            append_line(self.path, json.dumps(row, allow_nan=False))

    def missing(self, halved: str, count: int) -> list[int]:
        """The numbers below `count` that were not measured yet."""
        return [i for i in range(count) if (halved, i) not in self._rows]

    def used(self, halved: str, count: int) -> np.ndarray:
        """The used parts (t, l, s) of the first `count` trains; what the file cannot tell, infinity, is null there."""
        rows = [[*self._rows[halved, i]["used"].values()] for i in range(count)]
        return np.nan_to_num(np.array(rows, dtype=float), nan=np.inf)


def measure_trains(
    scene: Scene, track: Track, count: int, journal: TrainsJournal, *, seed: int, halved: str, progress: bool
) -> np.ndarray:
    """The used parts (t, l, s) of the first `count` trains of a scene, whose tolerance `halved` is already so."""
    missing = journal.missing(halved, count)
    name = f"{halved} halved" if halved else "trains"
    with tqdm(total=count, initial=count - len(missing), disable=None if progress else True, desc=name) as bar:
        for begin in range(0, len(missing), CHUNK):
            numbers = missing[begin : begin + CHUNK]
            drawn = [trains_as_built(scene, 1, seed=seed, first=i)[0] for i in numbers]
            for number, used in zip(numbers, track.used(drawn), strict=True):
                journal.add(halved, number, dict(zip(track.limits, used, strict=True)))
            bar.update(len(numbers))
    return journal.used(halved, count)
