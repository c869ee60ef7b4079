"""A flat face at right angles to its axis, which is the valve's and passes through the cam's.

With R the base radius and s the follower's lift (Norton, Cam Design and Manufacturing Handbook, 2009, ch. 7): the
distance r = R + s of the face is the contour's support function, so that its radius of curvature is r + s'' and the
contact lies at s' from the axis. The contact runs along the cam at r + s'' and along the face at s'' a radian, of which
the mean, r/2 + s'', entrains oil.
"""

from dataclasses import dataclass

import numpy as np

from camopt.cam.followers.touch import Touch, direction
from camopt.scene.geometry import Geometry
from camopt.scene.units import MM


@dataclass(frozen=True)
class Flat:
    """The follower `flat` of a [geometry]."""

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
