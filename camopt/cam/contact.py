"""The contact of a cam with its follower: what it is at every angle, and whether the cam can be made and run.

Radii are positive where the cam is convex and negative where it is concave.
"""

from dataclasses import dataclass, field

import numpy as np

from camopt.scene.errors import InputError
from camopt.scene.geometry import SWINGING, Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM


@dataclass(frozen=True)
class Contact:
    """A follower on its cam at cam angles `theta` [rad].

    `contour` [m] and its outward `normal`, Cartesian about the cam's axis in the cam, the nose towards +x (for a finger
    or rocker turned by where that touches), for a cam that turns against the angle (mirror it for the other sense).
    Signed `radius_of_curvature` [m], infinite where the cam is straight; `eccentricity` [m] of the contact on a flat
    face from the valve's axis, on a pad from where it is with the valve shut, zero for a roller; `pressure_angle`
    [rad], zero for a flat follower; `ratio` of the valve's velocity to that of what rides on the cam; velocities of
    `entrainment` and of the cam's `sliding` over the follower [m/rad], to be multiplied by the cam's speed.
    """

    geometry: Geometry
    theta: Float[np.ndarray, " k"] = field(repr=False)
    radius_of_curvature: Float[np.ndarray, " k"] = field(repr=False)
    eccentricity: Float[np.ndarray, " k"] = field(repr=False)
    pressure_angle: Float[np.ndarray, " k"] = field(repr=False)
    contour: Float[np.ndarray, "k 2"] = field(repr=False)
    normal: Float[np.ndarray, "k 2"] = field(repr=False)
    ratio: Float[np.ndarray, " k"] = field(repr=False)
    entrainment: Float[np.ndarray, " k"] = field(repr=False)
    sliding: Float[np.ndarray, " k"] = field(repr=False)

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

    def require_contour(self, what: str) -> None:
        """Raises InputError, whose sentence begins with `what`, where no contour gives this lift to this follower."""
        if self.contour_fault is not None:
            raise InputError(f"{what}: {self.contour_fault}")

    def faults(self) -> list[str]:
        """What keeps the cam from being made or run with this follower, a sentence each."""
        found = [] if self.contour_fault is None else [self.contour_fault]
        width = self.geometry.face_width_mm
        if self.geometry.follower == "flat" and width is not None and self.face_width > width * MM:
            found.append(f"the contact needs a face {self.face_width / MM:.2f} mm wide, which has {width:g} mm")
        return found
