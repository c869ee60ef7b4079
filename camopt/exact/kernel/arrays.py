"""Train and cam as the compiled kernel reads them: plain arrays under names."""

from typing import NamedTuple

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.train import Train


class TrainArrays(NamedTuple):
    """A train of n masses and e elements with linear laws, SI units; fields as in `camopt.scene.train.Train`."""

    mass: np.ndarray  # (n)
    mass_damping: np.ndarray  # (n)
    mass_force: np.ndarray  # (n)
    a: np.ndarray  # (e) mass or GROUND
    b: np.ndarray  # (e) mass or GROUND
    contact: np.ndarray  # (e) bool
    cam_driven: np.ndarray  # (e) bool
    stiffness: np.ndarray  # (e)
    damping: np.ndarray  # (e)
    preload: np.ndarray  # (e)
    gap: np.ndarray  # (e)


class CamArrays(NamedTuple):
    """A lift law of p pieces and the speed at which it turns."""

    borders: np.ndarray  # (p + 1) rad
    pieces: np.ndarray  # (p, q) m/rad^k
    speed: float  # rad/s


def train_arrays(train: Train) -> TrainArrays:
    """The train as the kernel reads it; raises InputError for laws that are not linear."""
    train.require_linear("event-exact", 'simulate with method "dop853", "rkg" or "smooth"')
    return TrainArrays(*(getattr(train, name) for name in TrainArrays._fields))


def cam_arrays(lift: Lift, cam_speed: float) -> CamArrays:
    """The lift law at a cam speed [rad/s] as the kernel reads it."""
    return CamArrays(lift.borders, lift.coefficients, float(cam_speed))
