"""What every follower tells of its contact, and the frame in which it does.

The engine's frame: the cam's axis is the origin, the first coordinate runs along the valve's axis and is positive where
the valve opens to, the second lies across it. The cam turns from the second axis to the first, so that what lies in the
cam at the angle theta faces the opening at the cam angle theta. Derivatives are by cam angle.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from camopt.scene.shapes import Float


@dataclass(frozen=True)
class Touch:
    """A follower on its cam at k cam angles, in the engine's frame.

    `point` [m] of contact and the cam's outward `normal` there; signed `radius` of curvature [m] of the cam;
    `eccentricity` [m] of the contact on a flat face from the valve's axis, on a pad from where it is with the valve
    shut; `pressure_angle` [rad]; `ratio` of the valve's velocity to that of what rides on the cam; velocities of
    `entrainment` and of the cam's `sliding` over the follower [m/rad], to be multiplied by the cam's speed.
    """

    point: Float[np.ndarray, "k 2"]
    normal: Float[np.ndarray, "k 2"]
    radius: Float[np.ndarray, " k"]
    eccentricity: Float[np.ndarray, " k"]
    pressure_angle: Float[np.ndarray, " k"]
    ratio: Float[np.ndarray, " k"]
    entrainment: Float[np.ndarray, " k"]
    sliding: Float[np.ndarray, " k"]


class Follower(Protocol):
    """A follower's kinematics, both ways."""

    def touch(self, law: Float[np.ndarray, "3 k"]) -> Touch:
        """The contact at valve lifts, with their first two derivatives [m/rad^n]."""
        ...

    def lift_on(
        self, points: Float[np.ndarray, "k 2"], normals: Float[np.ndarray, "k 2"]
    ) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
        """Cam angles [rad], neither wrapped nor ordered, at which the follower touches these points [m] of a contour
        with these outward normals, both in the cam, and the valve lift [m] there."""
        ...


def quarter_turn(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 2) turned from the first axis towards the second by a right angle."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The product |a| |b| sin(angle from a to b) of vectors (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def turned(vectors: np.ndarray, angle) -> np.ndarray:
    """Vectors (..., 2) turned by angles [rad] from the first axis towards the second."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([x * cos - y * sin, x * sin + y * cos], axis=-1)


def direction(vectors: np.ndarray) -> np.ndarray:
    """Angle [rad] of vectors (..., 2) from the first axis, wrapped."""
    return np.arctan2(vectors[..., 1], vectors[..., 0])
