"""The contact of a circle, a roller's or a pad's, whose centre runs along a known path over the turning cam.

Seen from the cam the centre runs along the pitch curve, with w = J C + C' the velocity of the centre C over the cam
(J a quarter turn). Its normal is the contour's, whose radius of curvature is less by the circle's (Norton 2009, ch. 7):
    n = -J w / |w|,   contour C - r n,   pitch radius |w|^3 / (w x (J w + w')).
The normal turns over the cam at psi' = (w x (J w + w')) / |w|^2, so that the contact runs along the cam at |w| - r psi'
and, on a pad whose body turns at gamma', along the pad at r (psi' - 1 - gamma').
"""

from dataclasses import dataclass

import numpy as np

from camopt.cam.followers.touch import Touch, cross, direction, quarter_turn


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
