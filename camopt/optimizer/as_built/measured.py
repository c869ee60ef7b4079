"""How much of its limits a cam uses in trains as built, each with its own numbers and its own ground cam.

What is measured is stored chunk by chunk, so that an interrupted statement goes on.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.settled import ERRORS, settled_metrics
from camopt.measure.as_built import TrainAsBuilt, trains_as_built
from camopt.measure.limits import MotionLimit, motion_limits
from camopt.optimizer.search.judge import IRREGULAR, MEASURES, SETTLES
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.settled import SettledMetrics
from camopt.scene.train import Train, build_train
from camopt.storage.journal import Records

CHUNK = 20
"""Trains that are measured between two entries in the journal."""
WORKERS = 2
"""Threads, each with a train of its own."""
ROUGH, PART = 20.0, 1.0 - 1.0 / IRREGULAR
"""A train is judged first by short motions, since most are far from its limits, on either side: they settle to ROUGH
times the tolerances of others, or to less where that may change what is used of a limit by more than PART of it, and a
train is judged by them alone where it keeps as much as that of every limit, or uses IRREGULAR times one."""


def first_look(limits: Iterable[MotionLimit]) -> dict[str, Any]:
    """How the motions settle by which a train is judged first, as arguments of `settled_metrics`."""
    room = min((limit.value / ERRORS[limit.metric] for limit in limits), default=np.inf)
    return {"most": SETTLES, "measured": MEASURES, "tolerance": float(np.clip(PART * room, 1.0, ROUGH))}


def used_limits(limits: Iterable[MotionLimit], found: SettledMetrics) -> np.ndarray:
    """How much of each limit (l) the settled motions of one train and cam use (s), the worst measured revolutions."""
    return np.array([limit.share(found.worst(limit.metric)[0, 0]) for limit in limits])


def used_by_looks(
    limits: Sequence[MotionLimit],
    train: Train,
    cam: Lift,
    cam_speeds: np.ndarray,
    starts: np.ndarray,
    looks: Iterable[Mapping[str, Any]],
) -> tuple[np.ndarray, np.ndarray]:
    """How much of each limit (l) a train with its cam uses at each of the cam speeds (s) [rad/s], and the states
    (s, 2n + r) in which the motions end that begin in `starts`.

    Each of the `looks`, arguments of `settled_metrics`, follows the motions on at the speeds at which the ones before
    leave open on which side of its limits the train is.
    """
    used, states, at = np.zeros((len(limits), len(cam_speeds))), starts.copy(), np.arange(len(cam_speeds))
    for look in looks:
        found = settled_metrics(
            [train], [cam], cam_speeds[at].tolist(), starts=states[at], workers=1, kept=False, **look
        )
        used[:, at], states[at] = used_limits(limits, found), found.states[0, 0]
        worst = used.max(axis=0)
        at = at[(worst[at] > 1.0 / IRREGULAR) & (worst[at] < IRREGULAR)]
        if not len(at):
            break
    return used, states


@dataclass(frozen=True)
class Track:
    """What every train is driven through: the cam as designed, cam speeds (s) [rad/s], and the states (s, 2n + r) in
    which the train as designed has settled there, from which the drawn ones settle sooner."""

    lift: Lift
    cam_speeds: tuple[float, ...]
    starts: np.ndarray
    limits: Mapping[str, MotionLimit]

    def used(self, trains: Sequence[TrainAsBuilt]) -> np.ndarray:
        """How much of each limit (l) each train (t) uses at each speed (s), the worst of the measured revolutions, by
        short motions and, where these leave it open, by full ones."""
        limits, speeds = tuple(self.limits.values()), np.array(self.cam_speeds)
        looks = first_look(limits), {}

        def of_train(one: TrainAsBuilt) -> np.ndarray:
            return used_by_looks(limits, one.train, one.cam(self.lift), speeds, self.starts, looks)[0]

        with ThreadPoolExecutor(WORKERS) as pool:
            return np.array(list(pool.map(of_train, trains)))


def track(scene: Scene, lift: Lift, speeds_rpm: Sequence[float] | np.ndarray) -> Track:
    """The track of a scene's cam at crankshaft speeds (s) [r/min]."""
    train, speeds = build_train(scene), tuple(scene.cam_speed(speed) for speed in speeds_rpm)
    states = settled_metrics([train], [lift], speeds).states[0, 0]
    starts = np.where(np.isfinite(states), states, state_at_rest(train))
    return Track(lift, speeds, starts, motion_limits(scene.design))


def cam_digest(cam: Lift) -> str:
    """What tells one cam from another."""
    return sha256(cam.borders.tobytes() + cam.coefficients.tobytes() + repr(cam.half_duration).encode()).hexdigest()


def measure_trains(
    scene: Scene,
    track: Track,
    count: int,
    journal: Records,
    *,
    seed: int,
    halved: str = "",
    advance: Callable[[int], object] = lambda trains: None,
) -> np.ndarray:
    """The used parts (t, l, s) of the first `count` trains of a scene, whose tolerance `halved` is already so.

    Trains that the journal knows are not judged again; `advance` is told how many others were.
    """
    cam = cam_digest(track.lift)
    missing = missing_trains(journal, cam, halved, count)
    for begin in range(0, len(missing), CHUNK):
        numbers = missing[begin : begin + CHUNK]
        drawn = [trains_as_built(scene, 1, seed=seed, first=i)[0] for i in numbers]
        used = [dict(zip(track.limits, parts, strict=True)) for parts in track.used(drawn)]
        same = {"cam": cam, "halved": halved}
        journal.add(*(same | {"train": i, "used": one} for i, one in zip(numbers, used, strict=True)))
        advance(len(numbers))
    rows = [[*(journal.get(cam, halved, i) or {})["used"].values()] for i in range(count)]
    return np.nan_to_num(np.array(rows, dtype=float), nan=np.inf)  # infinity is null in a journal


def trains_journal(path: Path | None) -> Records:
    """What was measured, in a file if named, by the cam, the tolerance that was halved ("" for none) and the train's
    number. What a file says of other cams counts for nothing."""
    return Records(path, "cam", "halved", "train")


def missing_trains(journal: Records, cam: str, halved: str, count: int) -> list[int]:
    """The numbers below `count` of the trains that were not measured yet."""
    return [i for i in range(count) if journal.get(cam, halved, i) is None]
