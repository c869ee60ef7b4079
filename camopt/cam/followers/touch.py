"""The contact of a follower with its cam, and the contact of a circle whose centre runs along a known path.

The engine's frame: the cam's axis is the origin, the first coordinate runs along the valve's axis and is positive where
the valve opens to, the second lies across it. The cam turns from the second axis to the first, so that what lies in the
cam at the angle theta faces the opening at the cam angle theta. Derivatives are by cam angle.

Seen from the cam the centre of a roller or pad runs along the pitch curve, with w = J C + C' the velocity of the centre
C over the cam (J a quarter turn). Its normal is the contour's, whose radius of curvature is less by the circle's
(Norton 2009, ch. 7):
    n = -J w / |w|,   contour C - r n,   pitch radius |w|^3 / (w x (J w + w')).
The normal turns over the cam at psi' = (w x (J w + w')) / |w|^2, so that the contact runs along the cam at |w| - r psi'
and, on a pad whose body turns at gamma', along the pad at r (psi' - 1 - gamma').
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


@dataclass(frozen=True)
class Path:
    """The way of a circle's centre at k cam angles, in the engine's frame: `centre` [m] and its derivatives, the unit
    `ahead` in which it moves as the valve opens, `turning` of its body [rad/rad], and `ratio` of the valve's velocity
    to its own."""

    centre: np.ndarray  # (k, 2), as the next three
    velocity: np.ndarray
    acceleration: np.ndarray
    ahead: np.ndarray
    turning: np.ndarray  # (k), as the next
    ratio: np.ndarray


def signed_radius(velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Radius of curvature (k) of a curve with these derivatives (k, 2), positive where it bends to the left, infinite
    where it is straight."""
    with np.errstate(divide="ignore"):
        return np.hypot(*velocity.T) ** 3 / cross(velocity, acceleration)


def touch_of_circle(path: Path, radius: float, rolls: bool, shut: float = 0.0) -> Touch:
    """The contact of a circle of `radius` [m] that rolls without slip or slides; `shut` is the pressure angle [rad]
    from which the eccentricity on a pad counts."""
    w = quarter_turn(path.centre) + path.velocity
    bend = quarter_turn(w) + quarter_turn(path.velocity) + path.acceleration
    speed = np.hypot(*w.T)
    normal = -quarter_turn(w) / speed[:, None]
    pressure = -direction(np.stack([np.sum(path.ahead * normal, axis=1), cross(path.ahead, normal)], axis=1))
    turning = cross(w, bend) / speed**2
    over_cam = speed - radius * turning
    over_pad = radius * (turning - 1 - path.turning)
    return Touch(
        point=path.centre - radius * normal,
        normal=normal,
        radius=signed_radius(w, bend) - radius,
        eccentricity=np.zeros_like(pressure) if rolls else radius * (pressure - shut),
        pressure_angle=pressure,
        ratio=path.ratio,
        entrainment=over_cam if rolls else (over_cam - over_pad) / 2,
        sliding=np.zeros_like(pressure) if rolls else over_cam + over_pad,
    )
