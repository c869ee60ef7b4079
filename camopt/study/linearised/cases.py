"""The trains and cams about which motions are linearised, and the paths that come of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from camopt.cam.families.free import FreeCam, free_cam_of
from camopt.cam.lift import Lift
from camopt.measure.as_built import trains_as_built
from camopt.optimizer.free_numbers import FreeNumber, free_number
from camopt.scene import InputError, Scene, Train, build_train

STEP = 1e-4
"""Share by which a number moves to either side, of itself, or of one unit of its key where it is zero: differences of a
train's arrays, in proportion to it, are right to round-off, those of ramps to STEP squared."""
SAME_LIFT = 1e-9
"""Difference of lift [m] within which a cam is one of the scene's free cams."""
TrainAndCam = tuple[Train, Lift]
"""A train with the cam that is ground for it."""


@dataclass(frozen=True)
class LinearisedCase:
    """A train, and beside it by free number what it is a step below and a step above."""

    nominal: TrainAndCam
    steps: np.ndarray  # (f), in the keys' units
    beside: list[tuple[TrainAndCam, TrainAndCam]]


class LinearPaths(NamedTuple):
    """Of one train at s speeds, at k angles: column 0 the values, then their derivatives by m coefficients [mm/deg^2]
    and f numbers [the key's unit]."""

    force: np.ndarray  # (s, k, c, 1 + m + f) N
    gap: np.ndarray  # (s, k, c, 1 + m + f) m
    seat_gap: np.ndarray  # (s, k, 1 + m + f) m
    moved: np.ndarray  # (s) m, change of the positions over the revolution


def free_cam_in(scene: Scene, cam: Lift) -> tuple[FreeCam, np.ndarray]:
    """The free cam of a scene and the coefficients z (m) at which it is `cam`; raises InputError where none are."""
    nearest = "by camopt.nearest_free_cam or one of camopt.free_cam(scene.design)"
    if cam.family != "free":
        raise InputError(f"linearised: the cam is of the family {cam.family!r}: take the nearest free one {nearest}")
    theta = np.linspace(-np.pi, np.pi, 721)
    try:
        free, z = free_cam_of(scene.required_design, cam)
        apart = np.abs(free.lift(z)(theta) - cam(theta)).max()
    except ValueError:  # as many coefficients as the scene's duration and these knots do not have
        apart = np.inf
    if not apart < SAME_LIFT:
        raise InputError(
            f"linearised: the cam has not the duration and ramps of scene {scene.name}: take the nearest one {nearest}"
        )
    return free, z


def cases_of(
    scene: Scene, cam: Lift, z: np.ndarray, trains: int, seed: int, free: Sequence[str]
) -> tuple[list[LinearisedCase], list[FreeNumber]]:
    """The train as designed, or so many drawn ones, with the free numbers of the names; z (m) is the cam's."""
    numbers = [free_number(scene, name) for name in free]
    if not trains:
        return [_case(scene, cam, z, numbers, lambda lift: lift)], numbers
    built = trains_as_built(scene, trains, seed=seed)
    return [_case(one.scene, cam, z, numbers, one.cam) for one in built], numbers


def _case(scene: Scene, cam: Lift, z: np.ndarray, numbers: Sequence[FreeNumber], ground) -> LinearisedCase:
    def built(moved: Scene) -> TrainAndCam:
        return build_train(moved), ground(free_cam_of(moved.required_design, cam)[0].lift(z))

    at = [number.of(scene) for number in numbers]
    steps = np.array([STEP * (abs(value) or 1.0) for value in at])
    sides = [
        (built(number.put(scene, value - step)), built(number.put(scene, value + step)))
        for number, value, step in zip(numbers, at, steps, strict=True)
    ]
    return LinearisedCase((build_train(scene), ground(cam)), steps, sides)
