"""The contact between a cam and its follower at every cam angle, and whether the cam can be made and run.

Radii of curvature are positive where the cam is convex and negative where it is concave.
"""

from dataclasses import dataclass, field

import numpy as np

from camopt.scene.errors import InputError
from camopt.scene.geometry import SWINGING, Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM


@dataclass(frozen=True)
class Contact:
    """The contact of a follower with its cam at cam angles `theta` [rad].

    `contour` [m] and its outward `normal` are Cartesian coordinates fixed in the cam, with their origin on its axis,
    for a cam that turns against the angle (mirror them for the other direction). The nose points towards +x; for a
    finger or rocker it is rotated by the angle at which that touches the cam. `radius_of_curvature` [m] has a sign, and
    is infinite where the cam is straight. `eccentricity` [m] is the distance of the contact from the valve axis on a
    flat face, its distance from the place with the valve shut on a pad, and zero for a roller. `pressure_angle` [rad]
    is zero for a flat follower. `ratio` is the velocity of the valve over that of the part that touches the cam.
    `entrainment` and `sliding`, the velocity of the cam over the follower, are in [m/rad], per cam speed.
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
        """Smallest concave radius of curvature, as a positive length [m]; None if the cam is nowhere concave. A cusp
        (flat follower) and an undercut (roller, pad) appear as a concave radius too; `faults` distinguishes them."""
        concave = self.radius_of_curvature[self.radius_of_curvature <= 0]
        return float(-concave.max()) if len(concave) else None

    @property
    def face_width(self) -> float:
        """Width of a centred flat face that the contact requires [m], without the width of the contact itself."""
        return 2 * float(np.abs(self.eccentricity).max())

    def figures(self) -> dict[str, float | None]:
        """The contact in field units; None if a value does not apply to the follower."""
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
        """Why no contour produces this lift with this follower, as a sentence; None if one does."""
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
        """Raises InputError, whose sentence begins with `what`, if no contour produces this lift with this follower."""
        if self.contour_fault is not None:
            raise InputError(f"{what}: {self.contour_fault}")

    def faults(self) -> list[str]:
        """One sentence per reason why the cam cannot be made or run with this follower."""
        faults = [] if self.contour_fault is None else [self.contour_fault]
        width = self.geometry.face_width_mm
        if self.geometry.follower == "flat" and width is not None and self.face_width > width * MM:
            faults.append(f"the contact needs a face {self.face_width / MM:.2f} mm wide, but it is {width:g} mm wide")
        return faults
