"""An event-exact motion with varying numbers, and its gradients by their names, for JAX's rule.

Let r = speed / speed'. With masses times r^2, and dampings and leaks times r, the train has the same positions and
forces by angle at speed', and its velocities are divided by r. Derivatives by the speed therefore follow from those by
masses, dampings and leaks.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from camopt.cam.lift import Lift, lift_with
from camopt.exact.adjoint.motion import Slopes, TracedMotion, rest_back
from camopt.exact.adjoint.slopes import ByTrainAndLaws
from camopt.exact.affine.lines import rest_of
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.laws import FRICTION, OIL
from camopt.scene.shapes import Float, State
from camopt.scene.train import LAW_PARAMETERS, TRAIN_PARAMETERS, Train

CAM_PARAMETERS = ("lift", "borders", "half_duration")
POSITIVE = ("mass", "stiffness", "cam_speed", "half_duration")
VELOCITY = "m_per_s"
"""Suffix of the names of metrics that are proportional to all velocities."""
Arrays = dict[str, np.ndarray]


@dataclass(frozen=True)
class Varying:
    """The constants of a motion of which JAX varies some numbers."""

    train: Train
    lift: Lift
    revolutions: int
    spacing: float | None
    least_speed: float  # rad/s

    def trace(self, numbers: Arrays, names: tuple[str, ...]) -> TracedMotion | None:
        """The motion with these numbers, to be differentiated by `names`; None if it cannot be computed."""
        if not all(usable(self.train, name, number) for name, number in numbers.items()):
            return None
        if numbers["cam_speed"] < self.least_speed:
            return None
        train = varied(self.train, tuple((n, numbers[n].tobytes()) for n in self.train.parameters if n in numbers))
        speed, mechanical = float(numbers["cam_speed"]), bool({*names} & MECHANICAL)
        try:
            lift = lift_with(self.lift, numbers)
            start = numbers["start"] if "start" in numbers else rest(train)
            return TracedMotion(train, lift, speed, start, self.revolutions, mechanical, self.spacing)
        except (MotionRefused, InputError):  # no bound, endless switching; no rest; no cam
            return None

    def swept(
        self,
        names: tuple[str, ...],
        numbers: Arrays,
        motion: TracedMotion,
        metrics: tuple[str, ...],
        revolution: int,
        weights: np.ndarray | None = None,
    ) -> tuple[np.ndarray, Arrays]:
        """Values (l) of metrics in a revolution, and their gradients (l, ...) by each of the names; with `weights` (l)
        the one gradient (1, ...) of their weighted sum, in which values of weight zero may be NaN."""
        values, slopes = motion.swept(metrics, revolution, weights)
        values, share = values[:, 0], np.eye(len(metrics)) if weights is None else weights[None]

        def total(parts: np.ndarray) -> np.ndarray:
            return np.where(share != 0.0, share * parts, 0.0).sum(axis=1)

        of_velocity = np.array([name.endswith(VELOCITY) for name in metrics], dtype=bool)
        by_window = motion.by_half_duration(metrics, revolution) if "half_duration" in names else np.zeros(len(values))
        moving = total(np.where(of_velocity, values, 0.0))
        gradients = self.by_names(names, numbers, motion, slopes, moving, total(by_window))
        for slope in gradients.values():
            slope[np.isnan(total(values))] = np.nan
        return values, gradients

    def by_names(
        self,
        names: tuple[str, ...],
        numbers: Arrays,
        motion: TracedMotion,
        slopes: Slopes,
        moving: np.ndarray,
        by_window: np.ndarray,
    ) -> Arrays:
        """Gradients (l, ...) by each of the names. `moving` (l) is the part of the values that is proportional to all
        velocities, `by_window` (l) are their gradients by half the duration."""
        by_train, gradients = slopes.by_train, {}
        if by_train is not None and "start" not in numbers:
            by_train = by_train + rest_back(motion.train, slopes.by_start)
        for name in names:
            if name == "lift":
                gradients[name] = slopes.by_coefficients
            elif name == "borders":
                gradients[name] = by_borders(motion.lift, slopes.by_coefficients)
            elif name == "half_duration":
                gradients[name] = by_window
            elif name == "start":
                gradients[name] = slopes.by_start
            elif name == "cam_speed":
                gradients[name] = by_speed(motion, slopes, numbers.get("start")) + moving / motion.cam_speed
            else:
                gradients[name] = getattr(by_train, name)
        return gradients


MECHANICAL = {*TRAIN_PARAMETERS, *LAW_PARAMETERS, "cam_speed"}
"""Variables whose gradients need the sweep over the train's parameters."""


def usable(train: Train, name: str, number: np.ndarray) -> bool:
    """Whether a motion can be computed with a number; of the laws' numbers those count that some law uses."""
    if not np.all(np.isfinite(number)):
        return False
    if name == "table":  # compressions ascend
        return bool(np.all(np.diff(number[..., 0]) > 0))
    if name in ("leak", "slip"):
        assert train.laws is not None, "no parameter of a linear train"
        return bool(np.all(number[train.laws.kind == (OIL if name == "leak" else FRICTION)] > 0))
    return name not in POSITIVE or bool(np.all(number > 0))


def by_borders(lift: Lift, by_coefficients: Float[np.ndarray, "l p q"]) -> Float[np.ndarray, "l p+1"]:
    """Gradients by the borders, across which lift and velocity are continuous: a piece moves with its start."""
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
        total = total + by_train.leak @ train.laws.leak + by_train.dissipation @ train.laws.dissipation
    if start is not None:
        n = len(train.mass)
        total = total - slopes.by_start[:, n : 2 * n] @ start[n : 2 * n]
    return total / motion.cam_speed


@lru_cache(maxsize=24)
def varied(train: Train, changes: tuple[tuple[str, bytes], ...]) -> Train:
    """A train with other numbers: the same object for the same numbers, because propagators are kept per train."""
    shapes = {name: number.shape for name, number in train.parameters.items()}
    numbers = {name: np.frombuffer(data).reshape(shapes[name]).copy() for name, data in changes}
    return train.with_parameters(numbers) if changes else train


rest = lru_cache(maxsize=24)(rest_of)
