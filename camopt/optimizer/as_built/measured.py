"""Limit usage of a cam in trains as built, each with its own numbers and its own ground cam.

The results are stored chunk by chunk, so that an interrupted statement can be resumed.
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
from camopt.optimizer.search.judge import IRREGULAR, MEASURES, SETTLES, limit_usage
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train
from camopt.storage.journal import Records

CHUNK = 20
"""Number of trains that are measured between two writes to the journal."""
WORKERS = 2
"""Number of threads; each works on one train at a time."""
ROUGH, PART = 20.0, 1.0 - 1.0 / IRREGULAR
"""Settings of the first, short motions of a train, which decide for most trains, since these are far from their limits
on either side. The motions settle to ROUGH times the usual tolerances, or to tighter ones where that might change a
limit usage by more than PART. They decide where every usage is at most 1 - PART or the largest is IRREGULAR or more."""


def short_motions(limits: Iterable[MotionLimit]) -> dict[str, Any]:
    """Settings of the short motions by which a train is judged first, as arguments of `settled_metrics`."""
    room = min((limit.value / ERRORS[limit.metric] for limit in limits), default=np.inf)
    return {"most": SETTLES, "measured": MEASURES, "tolerance": float(np.clip(PART * room, 1.0, ROUGH))}


def staged_usage(
    limits: Sequence[MotionLimit],
    train: Train,
    cam: Lift,
    cam_speeds: np.ndarray,
    starts: np.ndarray,
    stages: Iterable[Mapping[str, Any]],
) -> tuple[np.ndarray, np.ndarray]:
    """Limit usage (l, s) of a train with its cam at the cam speeds (s) [rad/s], and the states (s, 2n + r) in which the
    motions that begin in `starts` end.

    Each of the `stages` is a set of arguments of `settled_metrics`. It continues the motions at those speeds where the
    previous stages do not decide whether the train keeps its limits.
    """
    used, states, at = np.zeros((len(limits), len(cam_speeds))), starts.copy(), np.arange(len(cam_speeds))
    for settings in stages:
        metrics = settled_metrics(
            [train], [cam], cam_speeds[at].tolist(), starts=states[at], workers=1, kept=False, **settings
        )
        used[:, at], states[at] = limit_usage(limits, metrics), metrics.states[0, 0]
        worst = used.max(axis=0)
        at = at[(worst[at] > 1.0 / IRREGULAR) & (worst[at] < IRREGULAR)]
        if not len(at):
            break
    return used, states


@dataclass(frozen=True)
class Track:
    """Conditions under which every train is measured: the cam as designed, the cam speeds (s) [rad/s], the limits, and
    the settled states (s, 2n + r) of the train as designed, from which the drawn trains settle sooner."""

    lift: Lift
    cam_speeds: tuple[float, ...]
    starts: np.ndarray
    limits: Mapping[str, MotionLimit]

    def used(self, trains: Sequence[TrainAsBuilt]) -> np.ndarray:
        """Limit usage (t, l, s) of the trains, from the worst measured revolutions: of short motions or, if these do
        not decide, of full ones."""
        limits, speeds = tuple(self.limits.values()), np.array(self.cam_speeds)
        stages = short_motions(limits), {}

        def of_train(built: TrainAsBuilt) -> np.ndarray:
            return staged_usage(limits, built.train, built.cam(self.lift), speeds, self.starts, stages)[0]

        with ThreadPoolExecutor(WORKERS) as pool:
            return np.array(list(pool.map(of_train, trains)))


def track(scene: Scene, lift: Lift, speeds_rpm: Sequence[float] | np.ndarray) -> Track:
    """The `Track` of a scene and a cam at crankshaft speeds (s) [r/min]."""
    train, speeds = build_train(scene), tuple(scene.cam_speed(speed) for speed in speeds_rpm)
    states = settled_metrics([train], [lift], speeds).states[0, 0]
    starts = np.where(np.isfinite(states), states, state_at_rest(train))
    return Track(lift, speeds, starts, motion_limits(scene.design))


def cam_digest(cam: Lift) -> str:
    """A digest that identifies a cam."""
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
    """Limit usage (t, l, s) of the first `count` trains of a scene, in which the tolerance `halved` is already halved.

    Trains that are in the journal are not measured again; `advance` receives the number of trains that were.
    """
    cam = cam_digest(track.lift)
    missing = missing_trains(journal, cam, halved, count)
    for begin in range(0, len(missing), CHUNK):
        numbers = missing[begin : begin + CHUNK]
        drawn = [trains_as_built(scene, 1, seed=seed, first=i)[0] for i in numbers]
        used = [dict(zip(track.limits, usage, strict=True)) for usage in track.used(drawn)]
        same = {"cam": cam, "halved": halved}
        journal.add(*(same | {"train": i, "used": parts} for i, parts in zip(numbers, used, strict=True)))
        advance(len(numbers))
    rows = [[*(journal.get(cam, halved, i) or {})["used"].values()] for i in range(count)]
    return np.nan_to_num(np.array(rows, dtype=float), nan=np.inf)  # infinity is null in a journal


def trains_journal(path: Path | None) -> Records:
    """The journal of measured trains, in a file if a path is given. Its keys are the cam's digest, the tolerance that
    was halved ("" for none) and the train's number; records of other cams are ignored."""
    return Records(path, "cam", "halved", "train")


def missing_trains(journal: Records, cam: str, halved: str, count: int) -> list[int]:
    """Numbers below `count` of the trains that have not been measured yet."""
    return [i for i in range(count) if journal.get(cam, halved, i) is None]
