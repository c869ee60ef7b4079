"""The followers of a scene's [geometry]: their contact with the cam for a valve lift, and their lift on a contour.

The frame of the engine is the complex plane. The cam axis is its origin. The real axis is parallel to the valve axis
and positive in the direction in which the valve opens; the imaginary axis is perpendicular to it. The cam turns from
the imaginary to the real axis, so that the point of the cam at the angle theta faces the opening direction at the cam
angle theta. Derivatives are by cam angle.

Relative to the cam, the centre C of a roller or pad moves along the pitch curve with the velocity w = i C + C'. The
normal of this curve is that of the contour, whose radius of curvature is smaller by the radius r of the circle (Norton
2009, ch. 7):
    n = -i w / |w|,   contour C - r n,   pitch radius |w|^3 / (w x (i w + w')).
The normal turns relative to the cam at psi' = (w x (i w + w')) / |w|^2, so that the contact moves along the cam at
|w| - r psi' and, on a pad whose body turns at gamma', along the pad at r (psi' - 1 - gamma').
"""

from collections.abc import Sequence

import numpy as np

from camopt.cam.contact import Contact
from camopt.scene.errors import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The product |a| |b| sin(angle from a to b) of complex numbers."""
    return np.imag(np.conj(a) * b)


def pairs(numbers: np.ndarray) -> np.ndarray:
    """Complex numbers (k) as coordinates (k, 2)."""
    return np.stack([np.real(numbers), np.imag(numbers)], axis=1)


def signed_radius(velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Radius of curvature (k) of a curve with these complex derivatives (k), positive to the left, infinite if
    straight."""
    with np.errstate(divide="ignore"):
        return np.abs(velocity) ** 3 / cross(velocity, acceleration)


def circle_contact(
    geometry: Geometry,
    theta: np.ndarray,
    centre: Sequence[np.ndarray],
    ahead: np.ndarray | float,
    turning: np.ndarray,
    ratio: np.ndarray,
    shut: float = 0.0,
) -> Contact:
    """The contact of a roller, which rolls without slip, or of a pad, which slides.

    `centre` has the centre of the circle (k) [m] and its first two derivatives, and `ahead` is the unit vector of its
    motion while the valve opens, both in the frame of the engine. The body of the circle turns by `turning` (k)
    [rad/rad]. `ratio` (k) is the velocity of the valve over that of the centre, and `shut` is the pressure angle [rad]
    at which the eccentricity on a pad is zero.
    """
    assert geometry.contact_radius_mm is not None, "by the schema"
    radius, rolls, (place, velocity, acceleration) = geometry.contact_radius_mm * MM, geometry.roller_radius_mm, centre
    w = 1j * place + velocity
    bend = 1j * (w + velocity) + acceleration
    speed = np.abs(w)
    normal = -1j * w / speed
    pressure = -np.angle(np.conj(ahead) * normal)
    turned = np.exp(1j * theta)
    turn = cross(w, bend) / speed**2
    over_cam = speed - radius * turn
    over_pad = radius * (turn - 1 - turning)
    return Contact(
        geometry,
        theta,
        radius_of_curvature=signed_radius(w, bend) - radius,
        eccentricity=np.zeros_like(pressure) if rolls else radius * (pressure - shut),
        pressure_angle=pressure,
        contour=pairs((place - radius * normal) * turned),
        normal=pairs(normal * turned),
        ratio=ratio,
        entrainment=over_cam if rolls else (over_cam - over_pad) / 2,
        sliding=np.zeros_like(pressure) if rolls else over_cam + over_pad,
    )


class Flat:
    """A flat face perpendicular to the valve axis, which passes through the cam axis.

    With the base radius R and the lift s of the follower (Norton, Cam Design and Manufacturing Handbook, 2009, ch. 7),
    the distance r = R + s of the face is the support function of the contour. The radius of curvature is therefore
    r + s'', and the contact is at the distance s' from the axis. The contact moves along the cam at r + s'' and along
    the face at s'' per radian; the mean of both, r/2 + s'', entrains oil.
    """

    def __init__(self, geometry: Geometry):
        self.geometry, self.base = geometry, geometry.base_radius_mm * MM

    def contact(self, law: Float[np.ndarray, "3 k"], theta: Float[np.ndarray, " k"]) -> Contact:
        """The contact for valve lifts, with their first two derivatives [m/rad^n], at cam angles [rad]."""
        s, velocity, acceleration = law / self.geometry.rocker_ratio
        r, none, turned = self.base + s, np.zeros_like(s), np.exp(1j * theta)
        return Contact(
            self.geometry,
            theta,
            radius_of_curvature=r + acceleration,
            eccentricity=velocity,
            pressure_angle=none,
            contour=pairs((r + 1j * velocity) * turned),
            normal=pairs(turned),
            ratio=none + self.geometry.rocker_ratio,
            entrainment=r / 2 + acceleration,
            sliding=r,
        )

    def lift_on(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cam angles (k) [rad], neither wrapped nor ordered, at which the follower touches the complex points (k) [m]
        of a contour with these outward normals, both relative to the cam, and the valve lift (k) [m] there."""
        distance = np.real(np.conj(normals) * points)
        return np.angle(normals), self.geometry.rocker_ratio * (distance - self.base)


class Roller:
    """A roller whose centre moves along the valve axis, through the cam axis, and which rolls without slip."""

    def __init__(self, geometry: Geometry):
        assert geometry.roller_radius_mm is not None, "by the schema"
        self.geometry, self.radius = geometry, geometry.roller_radius_mm * MM
        self.reach = geometry.base_radius_mm * MM + self.radius

    def contact(self, law: np.ndarray, theta: np.ndarray) -> Contact:
        s, velocity, acceleration = law / self.geometry.rocker_ratio
        none = np.zeros_like(s)
        centre = self.reach + s, velocity, acceleration
        return circle_contact(self.geometry, theta, centre, 1.0, none, none + self.geometry.rocker_ratio)

    def lift_on(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        centres = points + self.radius * normals
        return np.angle(centres), self.geometry.rocker_ratio * (np.abs(centres) - self.reach)


class Arm:
    """A body that swings about a pivot between cam and valve, in the frame of the engine. The valve of a finger is on
    the cam's side of the pivot, and that of a rocker is on the other side.

    The pad on the flat valve tip has its centre at a constant distance from the tip, so that the lift h of the valve is
    that of this centre. With the valve arm l and its angle beta to the perpendicular of the valve axis,
    h = l (sin beta - sin beta_0). The ratio of the velocity of the valve to that of the roller or pad on the cam, l cos
    beta over the cam arm, varies with the lift. The centre on the cam moves on a circle about the pivot. The triangle
    of cam axis, pivot and centre permits two places on the base circle; the centre is at the one from which it moves
    away from the cam as the valve opens.

    `pivot`, `centre` (of the roller or pad on the base circle) and `valve` (of the pad on the tip of the shut valve)
    are positions [m]. `radius` [m] is that of the roller or pad on the cam. `valve_side` (1 or -1) is the side of the
    pivot, across the valve axis, on which the valve lies.
    """

    def __init__(self, geometry: Geometry):
        assert geometry.pivot_mm and geometry.arm_mm and geometry.valve_arm_mm, "by the schema"
        assert geometry.contact_radius_mm is not None, "by the schema"
        self.geometry, self.radius = geometry, geometry.contact_radius_mm * MM
        self._arm, self._valve_arm = geometry.arm_mm * MM, geometry.valve_arm_mm * MM
        self._shut = geometry.valve_arm_deg * DEG
        across, along = geometry.pivot_mm
        self.pivot = complex(along, across) * MM
        self.valve_side = -1.0 if (across > 0) == (geometry.follower == "finger") else 1.0
        self.centre = self._centre_at(np.array([geometry.base_radius_mm * MM + self.radius]))[0]
        self.valve = self.pivot + self._valve_arm * complex(np.sin(self._shut), self.valve_side * np.cos(self._shut))

    def _centre_at(self, distance: np.ndarray) -> np.ndarray:
        """Centres (k) at these distances [m] from the cam axis, on the side to which the opening valve moves them."""
        away = abs(self.pivot)
        cos = (distance**2 + away**2 - self._arm**2) / (2 * distance * away)
        if np.any(np.abs(cos) > 1):
            raise InputError(
                "[geometry]: arm_mm does not reach along the whole contour: move the pivot or change the arm"
            )
        return distance * np.exp(1j * (np.angle(self.pivot) + self.valve_side * np.arccos(cos)))

    def swing(self, law: np.ndarray) -> np.ndarray:
        """Angle [rad] by which the body has turned since the valve was shut, and its first two derivatives (3, k).
        Raises InputError if the valve arm does not reach that far."""
        sine = np.sin(self._shut) + law[0] / self._valve_arm
        if np.any(np.abs(sine) >= 1):
            raise InputError(
                f"[geometry]: a valve arm of {self._valve_arm / MM:g} mm does not lift the valve by "
                f"{law[0].max() / MM:.4g} mm: enlarge valve_arm_mm or take a smaller valve_arm_deg"
            )
        beta = np.arcsin(sine)
        first = law[1] / (self._valve_arm * np.cos(beta))
        second = law[2] / (self._valve_arm * np.cos(beta)) + np.tan(beta) * first**2
        return -self.valve_side * np.stack([beta - self._shut, first, second])

    def contact(self, law: np.ndarray, theta: np.ndarray) -> Contact:
        shut = self._contact(np.zeros((3, 1)), np.zeros(1), 0.0).pressure_angle[0]
        return self._contact(law, theta, float(shut))

    def _contact(self, law: np.ndarray, theta: np.ndarray, shut: float) -> Contact:
        angle, first, second = self.swing(law)
        arm = (self.centre - self.pivot) * np.exp(1j * angle)
        across = 1j * arm
        centre = self.pivot + arm, first * across, second * across - first**2 * arm
        ahead = -self.valve_side * across / self._arm
        ratio = self._valve_arm * np.cos(self._shut - self.valve_side * angle) / self._arm
        return circle_contact(self.geometry, theta, centre, ahead, first, ratio, shut)

    def lift_on(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        centres = points + self.radius * normals
        here = self._centre_at(np.abs(centres))
        theta = np.angle(centres) - np.angle(here)
        beta = self._shut - self.valve_side * np.angle((here - self.pivot) / (self.centre - self.pivot))
        return theta, self._valve_arm * (np.sin(beta) - np.sin(self._shut))


FOLLOWERS = {"flat": Flat, "roller": Roller, "finger": Arm, "rocker": Arm}


def follower_of(geometry: Geometry) -> Flat | Roller | Arm:
    """The follower that a [geometry] describes; all followers have the methods of `Flat`."""
    return FOLLOWERS[geometry.follower](geometry)
