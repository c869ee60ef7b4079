"""The trains and cams about which motions are linearised, and the record of the resulting paths."""

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
"""Relative step of a number to either side, or the step in units of its key where it is zero. Differences of a train's
arrays, which are proportional to it, are exact to round-off; those of ramps have an error of STEP squared."""
SAME_LIFT = 1e-9
"""Difference of lift [m] within which a cam counts as one of the scene's free cams."""
TrainAndCam = tuple[Train, Lift]
"""A train with its ground cam."""


@dataclass(frozen=True)
class LinearisedCase:
    """A train, and for each free number the trains one step below and one step above."""

    nominal: TrainAndCam
    steps: np.ndarray  # (f), in the keys' units
    beside: list[tuple[TrainAndCam, TrainAndCam]]


class LinearPaths(NamedTuple):
    """Paths of one train at s speeds and k angles: column 0 holds the values, the other columns the derivatives with
    respect to m coefficients [mm/deg^2] and f numbers [the key's unit]."""

    force: np.ndarray  # (s, k, c, 1 + m + f) N
    gap: np.ndarray  # (s, k, c, 1 + m + f) m
    seat_gap: np.ndarray  # (s, k, 1 + m + f) m
    moved: np.ndarray  # (s) m, change of the positions over the revolution


def free_cam_in(scene: Scene, cam: Lift) -> tuple[FreeCam, np.ndarray]:
    """The free cam of a scene and the coefficients z (m) that give `cam`; raises InputError where none do."""
    nearest = "by camopt.nearest_free_cam or one of camopt.free_cam(scene.design)"
    if cam.family != "free":
        raise InputError(f"linearised: the cam is of the family {cam.family!r}: take the nearest free one {nearest}")
    theta = np.linspace(-np.pi, np.pi, 721)
    try:
        free, z = free_cam_of(scene.required_design, cam)
        apart = np.abs(free.lift(z)(theta) - cam(theta)).max()
    except ValueError:  # the number of coefficients does not fit the scene's duration and these knots
        apart = np.inf
    if not apart < SAME_LIFT:
        raise InputError(
            f"linearised: the cam has not the duration and ramps of scene {scene.name}: take the nearest one {nearest}"
        )
    return free, z


def cases_of(
    scene: Scene, cam: Lift, z: np.ndarray, trains: int, seed: int, free: Sequence[str]
) -> tuple[list[LinearisedCase], list[FreeNumber]]:
    """The train as designed, or this many drawn ones, and the free numbers by name; z (m) is the cam's."""
    numbers = [free_number(scene, name) for name in free]
    if not trains:
        return [_case(scene, cam, z, numbers, lambda lift: lift)], numbers
    built = trains_as_built(scene, trains, seed=seed)
    return [_case(train.scene, cam, z, numbers, train.cam) for train in built], numbers


def _case(scene: Scene, cam: Lift, z: np.ndarray, numbers: Sequence[FreeNumber], ground) -> LinearisedCase:
    def built(moved: Scene) -> TrainAndCam:
        return build_train(moved), ground(free_cam_of(moved.required_design, cam)[0].lift(z))

    values = [number.of(scene) for number in numbers]
    steps = np.array([STEP * (abs(value) or 1.0) for value in values])
    sides = [
        (built(number.put(scene, value - step)), built(number.put(scene, value + step)))
        for number, value, step in zip(numbers, values, steps, strict=True)
    ]
    return LinearisedCase((build_train(scene), ground(cam)), steps, sides)
