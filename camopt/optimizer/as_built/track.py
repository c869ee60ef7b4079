"""How much of its limits a cam uses in trains as built: every train with its own numbers and its own ground cam."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.settled import settled_metrics
from camopt.measure.as_built import TrainAsBuilt
from camopt.measure.limits import MotionLimit, motion_limits
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

WORKERS = 2
"""Threads, each with a train of its own."""


@dataclass(frozen=True)
class Track:
    """What every train is driven through: the cam as designed, cam speeds (s) [rad/s], and the states (s, 2n + r) in
    which the train as designed has settled there, from which the drawn ones settle sooner."""

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


def track(scene: Scene, lift: Lift, speeds_rpm: Sequence[float] | np.ndarray) -> Track:
    """The track of a scene's cam at crankshaft speeds (s) [r/min]."""
    train, speeds = build_train(scene), tuple(scene.cam_speed(speed) for speed in speeds_rpm)
    states = settled_metrics([train], [lift], speeds).states[0, 0]
    starts = np.where(np.isfinite(states), states, state_at_rest(train))
    return Track(lift, speeds, starts, motion_limits(scene.design))
