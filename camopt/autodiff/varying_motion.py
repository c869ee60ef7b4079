"""An event-exact motion some of whose numbers vary, and its gradients by their names: what JAX's rule calls.

Speed: with r = speed / speed', masses times r^2, dampings and leaks times r move through the same positions and forces
by angle at speed', at velocities divided by r. So derivatives by the speed are those by masses, dampings and leaks.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from camopt.cam.lift import Lift, lift_with
from camopt.exact.adjoint.gradient import rest_back
from camopt.exact.adjoint.motion import Slopes, TracedMotion
from camopt.exact.adjoint.slopes import ByTrainAndLaws
from camopt.exact.affine.lines import rest_of
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.shapes import Float, State
from camopt.scene.train import TRAIN_PARAMETERS, Train

CAM_PARAMETERS = ("lift", "borders", "half_duration")
POSITIVE = ("mass", "stiffness", "cam_speed", "half_duration")
Arrays = dict[str, np.ndarray]


@dataclass(frozen=True)
class Varying:
    """A motion of which JAX varies some numbers: what it keeps."""

    train: Train
    lift: Lift
    revolutions: int
    spacing: float | None
    least_speed: float  # rad/s

    def trace(self, given: Arrays, names: tuple[str, ...]) -> TracedMotion | None:
        """The motion under given numbers, to be differentiated by `names`; None where it cannot be followed."""
        if not all(np.all(np.isfinite(v)) and (k not in POSITIVE or np.all(v > 0)) for k, v in given.items()):
            return None
        if given["cam_speed"] < self.least_speed:
            return None
        train = varied(self.train, tuple((n, given[n].tobytes()) for n in TRAIN_PARAMETERS if n in given))
        speed, mechanical = float(given["cam_speed"]), bool({*names} & MECHANICAL)
        try:
            lift = lift_with(self.lift, given)
            start = given["start"] if "start" in given else rest(train)
            return TracedMotion(train, lift, speed, start, self.revolutions, mechanical, self.spacing)
        except (MotionRefused, InputError):  # no bound, endless switching; no rest; no cam
            return None

    def by_names(
        self,
        names: tuple[str, ...],
        given: Arrays,
        motion: TracedMotion,
        slopes: Slopes,
        moving: np.ndarray,
        by_window: np.ndarray | None,
    ) -> Arrays:
        """Gradients (l, ...) by each of the names; `moving` (l) is what of the numbers grows with all velocities,
        `by_window` (l) their gradients by half the duration."""
        by_train, found = slopes.by_train, {}
        if by_train is not None and "start" not in given:
            by_train = by_train + rest_back(motion.train, slopes.by_start)
        for name in names:
            if name == "lift":
                found[name] = slopes.by_coefficients
            elif name == "borders":
                found[name] = by_borders(motion.lift, slopes.by_coefficients)
            elif name == "half_duration":
                found[name] = by_window
            elif name == "start":
                found[name] = slopes.by_start
            elif name == "cam_speed":
                found[name] = by_speed(motion, slopes, given.get("start")) + moving / motion.cam_speed
            else:
                found[name] = getattr(by_train, name)
        return found


MECHANICAL = {*TRAIN_PARAMETERS, "cam_speed"}
"""Variables whose gradients need the sweep over the train's parameters."""


def by_borders(lift: Lift, by_coefficients: Float[np.ndarray, "l p q"]) -> Float[np.ndarray, "l p+1"]:
    """Gradients by the borders, where lift and velocity are continuous: a piece moves with its start."""
    derivative = np.arange(1, lift.coefficients.shape[1]) * lift.coefficients[:, 1:]
    starts = -np.sum(by_coefficients[:, :, :-1] * derivative, axis=2)
    return np.concatenate([starts, np.zeros((len(starts), 1))], axis=1)


def by_speed(motion: TracedMotion, slopes: Slopes, start: State | None) -> Float[np.ndarray, " l"]:
    """Gradients by the cam speed through masses, dampings, leaks and the start's velocities."""
    by_train, train = slopes.by_train, motion.train
    assert by_train is not None
    total = 2 * by_train.mass @ train.mass + by_train.mass_damping @ train.mass_damping
    total = total + by_train.damping @ train.damping
    if train.laws is not None and isinstance(by_train, ByTrainAndLaws):
        total = total + by_train.leak @ train.laws.leak
    if start is not None:
        n = len(train.mass)
        total = total - slopes.by_start[:, n : 2 * n] @ start[n : 2 * n]
    return total / motion.cam_speed


@lru_cache(maxsize=24)
def varied(train: Train, changes: tuple[tuple[str, bytes], ...]) -> Train:
    """A train with other numbers: the same object for the same numbers, because propagators are kept per train."""
    numbers: dict[str, Any] = {name: np.frombuffer(data).copy() for name, data in changes}
    if train.laws is not None and "stiffness" in numbers:  # that of a law's coefficients, as in `Train.parameters`
        numbers["laws"] = laws = replace(train.laws, coefficient=numbers["stiffness"])
        numbers["stiffness"] = laws.stand_in()
    return replace(train, **numbers) if changes else train


rest = lru_cache(maxsize=24)(rest_of)
