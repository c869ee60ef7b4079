"""The kinematics of the followers that a scene's [geometry] names."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from camopt.cam.followers.touch import Follower, Path, Touch, cross, direction, quarter_turn, touch_of_circle, turned
from camopt.scene.errors import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM


@dataclass(frozen=True)
class Flat:
    """A flat face at right angles to its axis, which is the valve's and passes through the cam's.

    With R the base radius and s the follower's lift (Norton, Cam Design and Manufacturing Handbook, 2009, ch. 7): the
    distance r = R + s of the face is the contour's support function, so that its radius of curvature is r + s'' and the
    contact lies at s' from the axis. The contact runs along the cam at r + s'' and along the face at s'' a radian, of
    which the mean, r/2 + s'', entrains oil.
    """

    base: float  # radius of the base circle [m]
    ratio: float  # valve lift over follower lift

    @classmethod
    def of(cls, geometry: Geometry) -> "Flat":
        return cls(geometry.base_radius_mm * MM, geometry.rocker_ratio)

    def touch(self, law: np.ndarray) -> Touch:
        s, velocity, acceleration = law / self.ratio
        r, none = self.base + s, np.zeros_like(s)
        return Touch(
            point=np.stack([r, velocity], axis=1),
            normal=np.stack([none + 1, none], axis=1),
            radius=r + acceleration,
            eccentricity=velocity,
            pressure_angle=none,
            ratio=none + self.ratio,
            entrainment=r / 2 + acceleration,
            sliding=r,
        )

    def lift_on(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return direction(normals), self.ratio * (np.sum(points * normals, axis=-1) - self.base)


@dataclass(frozen=True)
class Roller:
    """A roller whose centre moves along the valve's axis, through the cam's, and which rolls without slip."""

    base: float  # radius of the base circle [m]
    radius: float  # of the roller [m]
    ratio: float  # valve lift over follower lift

    @classmethod
    def of(cls, geometry: Geometry) -> "Roller":
        assert geometry.roller_radius_mm is not None, "by the schema"
        return cls(geometry.base_radius_mm * MM, geometry.roller_radius_mm * MM, geometry.rocker_ratio)

    def touch(self, law: np.ndarray) -> Touch:
        s, velocity, acceleration = law / self.ratio
        none = np.zeros_like(s)
        along = [
            np.stack([one, none], axis=1) for one in (self.base + self.radius + s, velocity, acceleration, none + 1)
        ]
        return touch_of_circle(Path(*along, turning=none, ratio=none + self.ratio), self.radius, rolls=True)

    def lift_on(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        centres = points + self.radius * normals
        return direction(centres), self.ratio * (np.hypot(centres[:, 0], centres[:, 1]) - self.base - self.radius)


@dataclass(frozen=True)
class Arm:
    """A body that swings about a pivot between cam and valve, in the engine's frame: a finger, whose valve is on the
    cam's side, or a rocker, whose valve is on the other one.

    The pad on the flat valve tip keeps its distance to the tip, so that the valve's lift h is that of the pad's centre:
    with l the valve arm and beta its angle against the square to the valve's axis, h = l (sin beta - sin beta_0). The
    ratio of the valve's velocity to that of the roller or pad on the cam, l cos beta over the cam arm, varies with the
    lift. The centre on the cam swings on a circle about the pivot; of the two places that the triangle of cam axis,
    pivot and centre allows on the base circle it has the one from which the opening valve takes it away from the cam.
    """

    geometry: Geometry

    @classmethod
    def of(cls, geometry: Geometry) -> "Arm":
        return cls(geometry)

    @cached_property
    def radius(self) -> float:
        """Radius [m] of the roller or pad on the cam."""
        assert self.geometry.contact_radius_mm is not None, "by the schema"
        return self.geometry.contact_radius_mm * MM

    @cached_property
    def pivot(self) -> np.ndarray:
        """The pivot (2) [m]."""
        assert self.geometry.pivot_mm is not None, "by the schema"
        across, along = self.geometry.pivot_mm
        return np.array([along, across]) * MM

    @cached_property
    def valve_side(self) -> float:
        """Side of the pivot on which the valve lies, across its axis: 1 or -1."""
        towards_cam = -1.0 if self.pivot[1] > 0 else 1.0
        return towards_cam if self.geometry.follower == "finger" else -towards_cam

    @cached_property
    def centre(self) -> np.ndarray:
        """Centre (2) [m] of the roller or pad on the base circle."""
        return self._centre_at(np.array([self._reach]))[0]

    @cached_property
    def valve(self) -> np.ndarray:
        """Centre (2) [m] of the pad on the shut valve's tip."""
        return self.pivot + self._valve_arm * np.array([np.sin(self._shut), self.valve_side * np.cos(self._shut)])

    @property
    def _reach(self) -> float:
        return self.geometry.base_radius_mm * MM + self.radius

    @property
    def _valve_arm(self) -> float:
        assert self.geometry.valve_arm_mm is not None, "by the schema"
        return self.geometry.valve_arm_mm * MM

    @property
    def _cam_arm(self) -> float:
        assert self.geometry.arm_mm is not None, "by the schema"
        return self.geometry.arm_mm * MM

    @property
    def _shut(self) -> float:
        return self.geometry.valve_arm_deg * DEG

    def _centre_at(self, distance: np.ndarray) -> np.ndarray:
        """Centres (k, 2) at these distances [m] from the cam's axis, on the side to which the opening valve moves."""
        away = np.hypot(*self.pivot)
        cos = (distance**2 + away**2 - self._cam_arm**2) / (2 * distance * away)
        if np.any(np.abs(cos) > 1):
            raise InputError(
                "[geometry]: arm_mm does not reach along the whole contour: move the pivot or change the arm"
            )
        angle = direction(self.pivot) + self.valve_side * np.arccos(cos)
        return distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def swing(self, law: np.ndarray) -> np.ndarray:
        """Angle [rad] by which the body has turned from where it is with the valve shut, and its derivatives (3, k).

        Raises InputError where the valve arm does not reach so far.
        """
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

    def touch(self, law: np.ndarray) -> Touch:
        shut = self._touch(np.zeros((3, 1)), 0.0).pressure_angle[0]
        return self._touch(law, float(shut))

    def _touch(self, law: np.ndarray, shut: float) -> Touch:
        angle, first, second = self.swing(law)
        arm = turned(self.centre - self.pivot, angle)
        across = quarter_turn(arm)
        path = Path(
            centre=self.pivot + arm,
            velocity=first[:, None] * across,
            acceleration=second[:, None] * across - first[:, None] ** 2 * arm,
            ahead=-self.valve_side * across / self._cam_arm,
            turning=first,
            ratio=self._valve_arm * np.cos(self._shut - self.valve_side * angle) / self._cam_arm,
        )
        return touch_of_circle(path, self.radius, rolls=self.geometry.roller_radius_mm is not None, shut=shut)

    def lift_on(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        centres = points + self.radius * normals
        here = self._centre_at(np.hypot(centres[:, 0], centres[:, 1]))
        theta = direction(centres) - direction(here)
        rest = self.centre - self.pivot
        angle = np.arctan2(cross(rest, here - self.pivot), (here - self.pivot) @ rest)
        beta = self._shut - self.valve_side * angle
        return theta, self._valve_arm * (np.sin(beta) - np.sin(self._shut))


FOLLOWERS = {"flat": Flat, "roller": Roller, "finger": Arm, "rocker": Arm}


def follower_of(geometry: Geometry) -> Follower:
    """The follower that a [geometry] describes."""
    return FOLLOWERS[geometry.follower].of(geometry)
