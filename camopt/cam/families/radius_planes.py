"""The radii of a cam under a roller or pad: planes on the safe side of the limit, near a given cam.

At a lift s and a velocity v, the curvature of the centre's path relative to the cam is affine in the acceleration a and
decreases with a (`camopt.cam.followers`): it equals k at a = g(s, v; k). With the circle's radius r, a convex cam has
at least the radius rho if a >= g(s, v; 1 / (rho + r)), and a concave one if a <= g(s, v; -1 / (rho - r)). Neither
condition is linear in the lift. Near a given cam, g is replaced by a plane on the safe side: the tangent at the given
cam, shifted by the largest deviation of g from it within the neighbourhood. The planes approach g to second order in
its size.
"""

from dataclasses import dataclass

import numpy as np

from camopt.cam.followers import follower_of
from camopt.cam.lift import Lift
from camopt.scene.errors import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.units import MM

NODES = np.linspace(0.0, 1.0, 5)
"""Relative places within a neighbourhood at which a plane is compared with the limit that it replaces."""
ACCELERATION = 0.01
"""An acceleration of usual magnitude [m/rad^2], from which the slope of the curvature is computed."""


@dataclass(frozen=True)
class Neighbourhood:
    """Cams whose lift and velocity differ from a cam's by at most this `share` of the largest lift and velocity."""

    lift: Lift
    share: float

    def box(self, edges: np.ndarray, top: float) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest lift and velocity, both (2, k), between neighbouring `edges` (k + 1) [rad]. Lifts are
        limited to 0 to `top` [m]."""
        ends = np.stack([self.lift(edges), self.lift(edges, 1)])
        reach = self.share * np.array([[top], [np.abs(self.lift.extremes(1)).max()]])
        low, high = (pick(ends[:, 1:], ends[:, :-1]) for pick in (np.minimum, np.maximum))
        low, high = low - reach, high + reach
        low[0], high[0] = np.maximum(low[0], 0.0), np.minimum(high[0], top)
        return low, high


SIDES = {"nose_radius_min_mm": -1.0, "concave_radius_min_mm": 1.0}
"""Sign with which a limit on a radius bounds the acceleration from above."""


def planes(geometry: Geometry, key: str, radius: float, low: np.ndarray, high: np.ndarray):
    """Weights (2, k) of lift and velocity and levels (k), with which side * a + weights @ (s, v) <= level implies the
    limit in k neighbourhoods, and the derivatives of the levels by the radius."""
    side = SIDES[key]
    assert geometry.contact_radius_mm is not None, "by the schema"
    size = radius - side * geometry.contact_radius_mm * MM
    s, v = (a[:, None] + (b - a)[:, None] * NODES for a, b in zip(low, high, strict=True))
    zero, slope = _acceleration(geometry, s[:, :, None] + 0 * v[:, None, :], v[:, None, :] + 0 * s[:, :, None])
    limit = side * (zero - side * slope / size)  # the path's curvature is -side / size
    middle = len(NODES) // 2
    by_s = (limit[:, -1, middle] - limit[:, 0, middle]) / (high[0] - low[0])
    by_v = (limit[:, middle, -1] - limit[:, middle, 0]) / (high[1] - low[1])
    plane = by_s[:, None, None] * s[:, :, None] + by_v[:, None, None] * v[:, None, :]
    rest = limit - plane
    between = sum(np.abs(np.diff(rest, 2, axis=axis)).max(axis=(1, 2)) / 8 for axis in (1, 2))
    return -np.stack([by_s, by_v]), rest.min(axis=(1, 2)) - between, slope[:, middle, middle] / size**2


def _acceleration(geometry: Geometry, s: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The acceleration at which the centre's path is straight, and its derivative by the curvature of the path, which
    is negative; arrays of the shape of `s` [m] and `v` [m/rad]."""
    follower, circle = follower_of(geometry), (geometry.contact_radius_mm or 0.0) * MM
    laws = [np.stack([s.ravel(), v.ravel(), np.full(s.size, a)]) for a in (0.0, ACCELERATION)]
    radii = (follower.contact(law, np.zeros(s.size)).radius_of_curvature for law in laws)
    flat, bent = (1 / (radius + circle) for radius in radii)
    slope = ACCELERATION / (bent - flat)
    if not np.all(slope < 0):
        raise InputError("[geometry]: the pressure angle reaches 90 deg, where no cam drives: move the pivot")
    return (-flat * slope).reshape(s.shape), slope.reshape(s.shape)
