"""Contact of a cam with its follower: curvature, eccentricity, pressure angle, contour, and durations above a lift.

Each follower tells where it touches the cam (`camopt.cam.followers`); here that is laid along a lift law and turned
into the cam, judged, and stated in the field's units. Radii are positive where the cam is convex and negative where it
is concave.
"""

from dataclasses import dataclass, field

import numpy as np

from camopt.cam.followers.kinds import follower_of
from camopt.cam.followers.touch import turned
from camopt.cam.lift import Lift
from camopt.scene import InputError
from camopt.scene.geometry import SWINGING, Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM

STEP = 0.05 * DEG
"""Widest spacing of the samples; every piece is sampled at both its ends, from inside. An extreme between two samples
is missed by about step^2 / 8 times its second derivative, 1e-7 of it."""
CLOSER = 20
"""Parts of `STEP` in which the extremes of the curvature are looked for."""
DURATION_LIFTS_MM = {"1_mm": 1.0, "0.050_in": 1.27}
"""Lifts at which durations are quoted; they are compared at 0.050 in where inches are used."""


@dataclass(frozen=True)
class Contact:
    """A cam and its follower at cam angles `theta` [rad], twice at piece borders.

    `contour` [m] and its outward `normal`, Cartesian about the cam's axis in the cam, the nose towards +x (for a finger
    or rocker turned by where that touches), for a cam that turns against the angle (mirror it for the other sense). The
    rest as in `camopt.cam.followers.touch.Touch`: signed `radius_of_curvature` [m], infinite where the cam is straight;
    `eccentricity` [m], zero for a roller; `pressure_angle` [rad], zero for a flat follower; `ratio`; `entrainment` and
    `sliding` [m/rad].
    """

    theta: Float[np.ndarray, " k"] = field(repr=False)
    radius_of_curvature: Float[np.ndarray, " k"] = field(repr=False)
    eccentricity: Float[np.ndarray, " k"] = field(repr=False)
    pressure_angle: Float[np.ndarray, " k"] = field(repr=False)
    contour: Float[np.ndarray, "k 2"] = field(repr=False)
    normal: Float[np.ndarray, "k 2"] = field(repr=False)
    ratio: Float[np.ndarray, " k"] = field(repr=False)
    entrainment: Float[np.ndarray, " k"] = field(repr=False)
    sliding: Float[np.ndarray, " k"] = field(repr=False)
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
        return float(self.radius_of_curvature[self.radius_of_curvature > 0].min(initial=np.inf))

    @property
    def smallest_concave(self) -> float | None:
        """Smallest concave radius of curvature, as a positive length [m]; None where the cam is nowhere concave.

        A cusp (flat follower) or an undercut (roller, pad) shows as a concave radius too; `faults` tells them apart.
        """
        concave = self.radius_of_curvature[self.radius_of_curvature <= 0]
        return float(-concave.max()) if len(concave) else None

    @property
    def face_width(self) -> float:
        """Width of a centred flat face that the contact needs [m], without the width of the contact itself."""
        return 2 * float(np.abs(self.eccentricity).max())

    def figures(self) -> dict[str, float | None]:
        """The contact in the field's units; None where a figure does not apply."""
        flat, slides = self.geometry.follower == "flat", self.geometry.roller_radius_mm is None
        concave = self.smallest_concave
        figures = {
            "smallest_convex_radius_mm": self.smallest_convex / MM,
            "smallest_concave_radius_mm": None if concave is None else concave / MM,
            "eccentricity_max_mm": float(self.eccentricity.max()) / MM if slides else None,
            "eccentricity_min_mm": float(self.eccentricity.min()) / MM if slides else None,
            "face_width_needed_mm": self.face_width / MM if flat else None,
            "pressure_angle_max_deg": None if flat else float(np.abs(self.pressure_angle).max()) / DEG,
        }
        if self.geometry.follower in SWINGING:
            figures |= {"valve_ratio_min": float(self.ratio.min()), "valve_ratio_max": float(self.ratio.max())}
        return figures

    @property
    def contour_fault(self) -> str | None:
        """Why no contour gives this lift to this follower, as a sentence; None where one does."""
        concave, radius = self.smallest_concave, self.geometry.contact_radius_mm
        if radius is None:
            sentence = "a flat follower needs a contour without cusp or concave flank: enlarge the base radius"
            return None if concave is None else sentence
        what = "pad" if self.geometry.roller_radius_mm is None else "roller"
        if concave is not None and concave <= radius * MM:
            return f"the {what} undercuts the cam: enlarge the base radius or take a smaller {what}"
        largest = float(np.abs(self.pressure_angle).max()) / DEG
        if largest >= 90:
            return f"the pressure angle reaches {largest:.0f} deg, where no cam drives the follower: move its pivot"
        return None

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
    sampled at both its ends and at least every `STEP`. Raises InputError where a finger or rocker cannot follow.
    """
    if theta is None:
        theta, *law = _sampled(lift)
    else:
        law = [lift(theta, order) for order in range(3)]
    touch = follower_of(geometry).touch(np.stack(law))
    return Contact(
        theta=theta,
        radius_of_curvature=touch.radius,
        eccentricity=touch.eccentricity,
        pressure_angle=touch.pressure_angle,
        contour=turned(touch.point, theta),
        normal=turned(touch.normal, theta),
        ratio=touch.ratio,
        entrainment=touch.entrainment,
        sliding=touch.sliding,
        geometry=geometry,
    )


def smallest_radii(lift: Lift, geometry: Geometry) -> tuple[float, float | None]:
    """`Contact.smallest_convex` and `Contact.smallest_concave` of a cam, with closer samples about every extreme.

    What is missed is `CLOSER`^2 times less than by `contact`. Raises InputError where a finger or rocker cannot follow.
    """
    found = contact(lift, geometry)
    turns = np.diff(1 / found.radius_of_curvature)
    at = found.theta[1 + np.flatnonzero(turns[1:] * turns[:-1] < 0)]
    if len(at) == 0:
        return found.smallest_convex, found.smallest_concave
    closer = contact(lift, geometry, (at[:, None] + STEP * np.linspace(-1, 1, 2 * CLOSER + 1)).ravel())
    concave = [size for one in (found, closer) if (size := one.smallest_concave) is not None]
    return min(found.smallest_convex, closer.smallest_convex), min(concave, default=None)


def durations(lift: Lift) -> dict[str, tuple[float, float]]:
    """First and last cam angle [rad] at `DURATION_LIFTS_MM`; InputError where the lift does not reach one."""
    return {name: crossing(lift, height * MM) for name, height in DURATION_LIFTS_MM.items()}


def crossing(lift: Lift, height: float) -> tuple[float, float]:
    """Cam angles [rad] at which the lift first rises to and last falls from `height` [m] > 0; those of the whole turn
    where it never lies so low."""
    if not 0 < height < lift.max_lift:
        raise InputError(
            f"duration: {height / MM:g} mm is not below the maximum lift: give a lift between zero and "
            f"{lift.max_lift / MM:g} mm"
        )
    roots = lift.roots(0, height)
    return (float(roots.min()), float(roots.max())) if len(roots) else (-np.pi, np.pi)


def _sampled(lift: Lift) -> tuple[np.ndarray, ...]:
    """Angles (k) [rad], lift and its first two derivatives, one-sided at both ends of every piece."""
    rows = []
    for c, start, end in zip(lift.coefficients, lift.borders[:-1], lift.borders[1:], strict=True):
        local = np.linspace(0.0, end - start, int(np.ceil((end - start) / STEP)) + 1)
        piece = np.polynomial.Polynomial(c)
        rows.append([start + local, piece(local), piece.deriv()(local), piece.deriv(2)(local)])
    return tuple(np.concatenate(column) for column in zip(*rows, strict=True))
