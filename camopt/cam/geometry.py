"""Contact of a cam with its follower: curvature, eccentricity, pressure angle, contour, and durations above a lift.

The follower translates towards the cam's axis and moves as the lift law says, over the rocker ratio; flat, with its
face at right angles to its axis, or a roller whose centre moves along it. With R the base radius and s the follower's
lift (Norton, Cam Design and Manufacturing Handbook, 2009, ch. 7):
    flat     radius of curvature R + s + s'', eccentricity of the contact s', pressure angle 0
    roller   pitch curve r = R + roller radius + s with radius of curvature (r^2 + r'^2)^(3/2) / (r^2 + 2 r'^2 - r r''),
             the cam's less by the roller radius, and pressure angle atan(r' / r)
Radii are positive where the cam is convex and negative where it is concave.
"""

from dataclasses import dataclass, field

import numpy as np

from camopt.cam.lift import Lift, mirrored_pieces
from camopt.scene import InputError
from camopt.scene.schema import Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM

STEP = 0.05 * DEG
"""Widest spacing of the samples; every piece is sampled at both its ends, from inside. An extreme between two samples
is missed by about step^2 / 8 times its second derivative, 1e-7 of it."""
DURATION_LIFTS_MM = {"1_mm": 1.0, "0.050_in": 1.27}
"""Lifts at which durations are quoted; they are compared at 0.050 in where inches are used."""


@dataclass(frozen=True)
class Contact:
    """A cam and its follower at cam angles `theta` [rad], twice at piece borders.

    `radius_of_curvature` [m], infinite where the cam is straight; `eccentricity` [m] of the contact from the follower's
    axis, zero for a roller; `pressure_angle` [rad], zero for a flat follower; `contour` [m], Cartesian about the
    cam's axis in the cam, the nose towards +x, for a cam that turns against the angle (mirror it for the other sense).
    """

    theta: Float[np.ndarray, " k"] = field(repr=False)
    radius_of_curvature: Float[np.ndarray, " k"] = field(repr=False)
    eccentricity: Float[np.ndarray, " k"] = field(repr=False)
    pressure_angle: Float[np.ndarray, " k"] = field(repr=False)
    contour: Float[np.ndarray, "k 2"] = field(repr=False)
    geometry: Geometry

    @property
    def polar(self) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
        """The contour's angle [rad], ascending from about -pi, and radius [m]."""
        x, y = self.contour.T
        angle = np.unwrap(np.arctan2(y, x))
        return angle - 2 * np.pi * np.round((angle[0] + np.pi) / (2 * np.pi)), np.hypot(x, y)

    @property
    def smallest_convex(self) -> float:
        """Smallest convex radius of curvature [m]."""
        return float(self.radius_of_curvature[self.radius_of_curvature > 0].min())

    @property
    def smallest_concave(self) -> float | None:
        """Smallest concave radius of curvature, as a positive length [m]; None where the cam is nowhere concave.

        A cusp (flat follower) or an undercut (roller) shows as a concave radius too; `faults` tells them apart.
        """
        concave = self.radius_of_curvature[self.radius_of_curvature <= 0]
        return float(-concave.max()) if len(concave) else None

    @property
    def face_width(self) -> float:
        """Width of a centred flat face that the contact needs [m], without the width of the contact itself."""
        return 2 * float(np.abs(self.eccentricity).max())

    def figures(self) -> dict[str, float | None]:
        """The contact in the field's units; None where a figure does not apply."""
        flat = self.geometry.follower == "flat"
        concave = self.smallest_concave
        return {
            "smallest_convex_radius_mm": self.smallest_convex / MM,
            "smallest_concave_radius_mm": None if concave is None else concave / MM,
            "eccentricity_max_mm": float(self.eccentricity.max()) / MM if flat else None,
            "eccentricity_min_mm": float(self.eccentricity.min()) / MM if flat else None,
            "face_width_needed_mm": self.face_width / MM if flat else None,
            "pressure_angle_max_deg": None if flat else float(np.abs(self.pressure_angle).max()) / DEG,
        }

    @property
    def contour_fault(self) -> str | None:
        """Why no contour gives this lift to this follower, as a sentence; None where one does."""
        concave, roller = self.smallest_concave, self.geometry.roller_radius_mm
        if roller is None:
            sentence = "a flat follower needs a contour without cusp or concave flank: enlarge the base radius"
            return None if concave is None else sentence
        sentence = "the roller undercuts the cam: enlarge the base radius or take a smaller roller"
        return sentence if concave is not None and concave <= roller * MM else None

    def faults(self) -> list[str]:
        """What keeps the cam from being made or run with this follower, a sentence each."""
        found = [] if self.contour_fault is None else [self.contour_fault]
        width = self.geometry.face_width_mm
        if self.geometry.follower == "flat" and width is not None and self.face_width > width * MM:
            found.append(f"the contact needs a face {self.face_width / MM:.2f} mm wide, which has {width:g} mm")
        return found


def contact(lift: Lift, geometry: Geometry, theta: Float[np.ndarray, " k"] | None = None) -> Contact:
    """The contact of a cam with the follower of a scene's [geometry].

    At `theta` [rad], any turn, from the right where a derivative steps; by default over one turn, every piece
    sampled at both its ends and at least every `STEP`.
    """
    if theta is None:
        theta, *law = _sampled(lift)
    else:
        law = [lift(theta, order) for order in range(3)]
    s, velocity, acceleration = (values / geometry.rocker_ratio for values in law)
    base = geometry.base_radius_mm * MM
    if geometry.roller_radius_mm is None:
        r = base + s
        contour = _from_axis(theta, r, velocity)
        return Contact(theta, r + acceleration, velocity, np.zeros_like(s), contour, geometry)
    roller = geometry.roller_radius_mm * MM
    r = base + roller + s
    angle = np.arctan(velocity / r)
    radius = pitch_radius(r, velocity, acceleration) - roller
    contour = _from_axis(theta, r - roller * np.cos(angle), roller * np.sin(angle))
    return Contact(theta, radius, np.zeros_like(s), angle, contour, geometry)


def pitch_radius(
    r: Float[np.ndarray, " k"], velocity: Float[np.ndarray, " k"], acceleration: Float[np.ndarray, " k"]
) -> Float[np.ndarray, " k"]:
    """Signed radius of curvature [m] of a polar curve r(theta) [m] with r' and r''; infinite where it is straight."""
    bend = r**2 + 2 * velocity**2 - r * acceleration
    with np.errstate(divide="ignore"):
        return (r**2 + velocity**2) ** 1.5 / bend


def durations(lift: Lift) -> dict[str, tuple[float, float]]:
    """First and last cam angle [rad] at `DURATION_LIFTS_MM`; InputError where the lift does not reach one."""
    return {name: crossing(lift, height * MM) for name, height in DURATION_LIFTS_MM.items()}


def crossing(lift: Lift, height: float) -> tuple[float, float]:
    """Cam angles [rad] at which the lift first rises to and last falls from `height` [m] > 0."""
    if not 0 < height < lift.max_lift:
        raise InputError(
            f"duration: {height / MM:g} mm is not below the maximum lift, {lift.max_lift / MM:g} mm, and above zero"
        )
    pieces = mirrored_pieces(lift.coefficients, np.diff(lift.borders))
    mirror = Lift(-lift.borders[::-1], pieces, lift.half_duration)
    return -mirror.closing_angle(height), lift.closing_angle(height)


def _sampled(lift: Lift) -> tuple[np.ndarray, ...]:
    """Angles (k) [rad], lift and its first two derivatives, one-sided at both ends of every piece."""
    rows = []
    for c, start, end in zip(lift.coefficients, lift.borders[:-1], lift.borders[1:], strict=True):
        local = np.linspace(0.0, end - start, int(np.ceil((end - start) / STEP)) + 1)
        piece = np.polynomial.Polynomial(c)
        rows.append([start + local, piece(local), piece.deriv()(local), piece.deriv(2)(local)])
    return tuple(np.concatenate(column) for column in zip(*rows, strict=True))


def _from_axis(theta: np.ndarray, along: np.ndarray, across: np.ndarray) -> Float[np.ndarray, "k 2"]:
    """Cartesian points at distances along and across the follower's axis, the axis at the angle theta."""
    cos, sin = np.cos(theta), np.sin(theta)
    return np.stack([along * cos - across * sin, along * sin + across * cos], axis=1)
