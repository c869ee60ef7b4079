"""A roller whose centre moves along the valve's axis, through the cam's, and which rolls without slip."""

from dataclasses import dataclass

import numpy as np

from camopt.cam.followers.circle import Path, touch_of_circle
from camopt.cam.followers.touch import Touch, direction
from camopt.scene.geometry import Geometry
from camopt.scene.units import MM


@dataclass(frozen=True)
class Roller:
    """The follower `roller` of a [geometry]."""

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
