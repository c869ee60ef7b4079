"""The tables [design] and [operation] of a scene: design conditions and limits of the cam, and the speeds it is for."""

from typing import Annotated, Self

from pydantic import Field, PrivateAttr, ValidationInfo, field_validator, model_validator

from camopt.scene.geometry import SWINGING, Geometry
from camopt.scene.table import NonNegative, Positive, Table, Usable
from camopt.scene.units import RPM

MOST_WINDOWS = 20
"""Largest number of rows in `lift_at` and in `duration_at`."""
NARROWEST = 1e-3
"""Least width of a window, in mm or deg; no cam can be ground to a narrower one."""
FEWEST_WAVES = 3
"""Number of sign changes that the jerk of every cam between two ramps has at least."""
RADII = ("nose_radius_min_mm", "concave_radius_min_mm")
"""Limits on the cam's radius of curvature, where it is convex and where it is concave."""
ROUNDING = 1e-9
"""Slack of a limit on the shape, relative to its size, in every check of a cam. Linear programs and projections tighten
the limit by the same amount, so that their rounding does not violate it."""
REACH = 1e-5
"""The same for reach_max_lift, 0.1 um of 10 mm. Linear programs keep the lift below its maximum on control points,
which lie above the lift by up to this much near the peak, so no program can come closer to the maximum."""
DRAWN_FOR = {
    "nose_radius_min_mm": ("flat", "roller", *SWINGING),
    "concave_radius_min_mm": ("roller", *SWINGING),
    "entrainment_min_m_per_s": ("flat",),
}
"""Limits that depend on the follower -> the followers for which they are defined."""
FROM_DURATION_AT = "from duration_at"
"""Value of duration_deg in a scene's text that leaves the choice of the duration to camopt."""
Window = tuple[float, float, float]
Windows = Annotated[tuple[Window, ...], Field(max_length=MOST_WINDOWS)]


class Operation(Table, frozen=True):
    """Speeds of the crankshaft [r/min]; the cam turns at `cam_per_crank` times these speeds."""

    speeds_rpm: Annotated[tuple[Positive, ...], Field(min_length=1, max_length=1000)]
    band_rpm: tuple[Positive, Positive]
    cam_per_crank: Positive = 0.5

    @field_validator("speeds_rpm")
    @classmethod
    def _ascending(cls, speeds):
        if list(speeds) != sorted(set(speeds)):
            raise ValueError("must be ascending without repeats")
        return speeds

    @field_validator("band_rpm")
    @classmethod
    def _lower_first(cls, band):
        if band[0] >= band[1]:
            raise ValueError("must be [lower, upper] with lower < upper")
        return band


class Piston(Table, frozen=True):
    """The piston, driven by a crank and a rod, that the valve must not touch.

    `gap_at_top_mm` is the distance between the closed valve and the piston's valve pocket when the piston is highest,
    and `clearance_mm` is the least distance that must remain; both are measured along the valve axis. `valve_angle_deg`
    is the angle between the valve axis and the cylinder axis.

    `lobe_centre_deg` is the crank angle at which the cam angle is zero, counted from the highest position of the piston
    and negative before it. `pin_offset_mm` is the distance between the cylinder axis and the crank axis, positive on
    the side to which the crank leans in the quarter turn after the top. `stroke_mm` is twice the radius of the crank.
    """

    stroke_mm: Positive
    rod_mm: Positive
    gap_at_top_mm: Positive
    clearance_mm: NonNegative
    lobe_centre_deg: Annotated[float, Field(ge=-360, le=360)]
    pin_offset_mm: float = 0.0
    valve_angle_deg: Annotated[float, Field(ge=0, lt=90)] = 0.0

    @model_validator(mode="after")
    def _turns(self):
        if self.rod_mm <= self.stroke_mm / 2 + abs(self.pin_offset_mm):
            raise ValueError("the rod must be longer than half of stroke_mm and pin_offset_mm together")
        if self.gap_at_top_mm <= self.clearance_mm:
            raise ValueError("gap_at_top_mm must exceed clearance_mm: the closed valve is closer than that already")
        return self


class Design(Table, frozen=True):
    """Design conditions and limits of the cam. A limit that is left out does not apply.

    `waves_max` is the largest number of sign changes of the jerk inside the duration. A cam whose acceleration has no
    ripple has 3, and each ripple adds two.

    `lift_at` has rows of [angle_deg, min_mm, max_mm]: the least and the largest lift at a cam angle. `duration_at` has
    rows of [lift_mm, min_deg, max_deg]: the least and the largest angle, in cam degrees, between the first and the last
    point at which the cam has that lift. If a scene's text states duration_deg = "from duration_at", the duration
    between the ramp tops is chosen when the scene is read: it is a fiftieth longer than the shortest one with which a
    cam within the limits on the shape has these durations.
    """

    duration_deg: Annotated[float, Field(gt=0, lt=300), Usable]
    max_lift_mm: Positive
    reach_max_lift: bool = False
    ramp_height_mm: Positive
    ramp_velocity_mm_per_deg: Positive
    ramp_foot_deg: NonNegative = 10.0
    closing_ramp_height_mm: Positive | None = None
    closing_ramp_velocity_mm_per_deg: Positive | None = None
    acceleration_max_mm_per_deg2: Positive | None = None
    acceleration_min_mm_per_deg2: Annotated[float, Field(lt=0), Usable] | None = None
    jerk_max_mm_per_deg3: Positive | None = None
    snap_max_mm_per_deg4: Positive | None = None
    nose_deg: NonNegative | None = None
    waves_max: Annotated[int, Field(ge=FEWEST_WAVES, le=99)] | None = None
    lift_at: Windows = ()
    duration_at: Windows = ()
    piston: Piston | None = None
    nose_radius_min_mm: Positive | None = None
    concave_radius_min_mm: Positive | None = None
    entrainment_min_m_per_s: Positive | None = None
    bounce_max_mm: NonNegative | None = None
    jump_max_mm: NonNegative | None = None
    jump_max_deg: NonNegative | None = None
    seating_velocity_max_m_per_s: Positive | None = None
    contact_force_min_N: Positive | None = None
    contact_force_max_N: Positive | None = None
    _geometry: Geometry | None = PrivateAttr(None)
    _operation: Operation | None = PrivateAttr(None)
    _chosen: bool = PrivateAttr(False)

    @property
    def geometry(self) -> Geometry | None:
        """Cam body and follower of the scene, which the limits on radii and widths need."""
        return self._geometry

    @property
    def cam_per_crank(self) -> float | None:
        """Turns of the cam per turn of the crank; None without [operation]."""
        return None if self._operation is None else self._operation.cam_per_crank

    @property
    def slowest(self) -> float | None:
        """Lowest cam speed [rad/s] of the scene's listed speeds and its band; None without [operation]."""
        if self._operation is None:
            return None
        return min(*self._operation.speeds_rpm, *self._operation.band_rpm) * self._operation.cam_per_crank * RPM

    @property
    def duration_chosen(self) -> bool:
        """Whether camopt chose `duration_deg`, from `duration_at`."""
        return self._chosen

    def of_duration(self, duration_deg: float) -> Self:
        """The design with a duration that camopt has chosen for it."""
        design = self.model_copy(update={"duration_deg": duration_deg})
        design._chosen = True  # pyright: ignore[reportAttributeAccessIssue]  # private, so not frozen
        return design

    def within(self, geometry: Geometry | None, operation: Operation | None) -> Self:
        """A copy of the design that refers to these tables of its scene."""
        design = self.model_copy()
        design._geometry, design._operation = geometry, operation  # pyright: ignore[reportAttributeAccessIssue]
        return design

    def missing(self) -> list[str]:
        """Sentences on limits without the geometry or operation they need, and on radii that the follower excludes."""
        follower = None if self._geometry is None else self._geometry.follower
        faults = []
        for key, followers in DRAWN_FOR.items():
            if getattr(self, key) is not None and follower is None:
                faults.append(f"{key} needs [geometry] with the follower and the base circle's radius")
            elif getattr(self, key) is not None and follower not in followers:
                kinds = ", ".join(followers[:-1]) + " and " * (len(followers) > 1) + followers[-1]
                faults.append(f"{key} is for {kinds} followers, and that of [geometry] is {follower}: leave it out")
        if (geometry := self._geometry) is not None and (circle := geometry.contact_radius_mm) is not None:
            what = "roller" if geometry.roller_radius_mm is not None else "pad"
            least, nose, base = self.concave_radius_min_mm, self.nose_radius_min_mm, geometry.base_radius_mm
            if least is not None and least <= circle:
                faults.append(
                    f"concave_radius_min_mm must exceed {what}_radius_mm = {circle:g}, or the {what} undercuts"
                )
            if nose is not None and nose > base:
                faults.append(f"nose_radius_min_mm must be at most base_radius_mm = {base:g}, which every cam has")
        if (self.piston or self.entrainment_min_m_per_s) and self._operation is None:
            faults.append("piston and entrainment_min_m_per_s need [operation] with the speeds and cam_per_crank")
        return faults

    @field_validator("nose_deg")
    @classmethod
    def _within_the_duration(cls, nose, info: ValidationInfo):
        duration = info.data.get("duration_deg")
        if nose is not None and duration is not None and nose >= duration / 2:
            raise ValueError("must be below half of duration_deg")
        return nose

    @field_validator("lift_at", "duration_at")
    @classmethod
    def _ordered_windows(cls, rows, info: ValidationInfo):
        lift, duration = info.data.get("max_lift_mm"), info.data.get("duration_deg")
        if lift is None or duration is None:
            return rows
        at_angle = info.field_name == "lift_at"
        for at, least, most in rows:
            if not 0 <= least <= most - NARROWEST:
                raise ValueError(f"the row of {at:g} needs a least value of 0 or more, and a largest one above it")
            if at_angle and (abs(at) >= duration / 2 or least > lift):
                raise ValueError(
                    f"the row of {at:g} deg must lie within duration_deg, and its least lift in max_lift_mm"
                )
            if not at_angle and (not 0 < at < lift or least >= duration):
                raise ValueError(f"the row of {at:g} mm must lie below max_lift_mm, its least duration in duration_deg")
        return rows

    @model_validator(mode="after")
    def _consistent(self):
        faults = [
            f"duration_at: its lift of {at:g} mm must be above both ramps"
            for at, _, _ in self.duration_at
            if at <= max(height for height, _, _ in self.ramps())
        ]
        least, most = self.contact_force_min_N, self.contact_force_max_N
        if least is not None and most is not None and least >= most:
            faults.append("contact_force_min_N must be below contact_force_max_N")
        for height, velocity, side in self.ramps():
            if height >= self.max_lift_mm:
                faults.append(f"the {side} ramp height must be below max_lift_mm")
            if height < velocity * self.ramp_foot_deg / 2:
                faults.append(
                    f"the {side} ramp is too low for its foot: the height must be at least "
                    f"velocity * ramp_foot_deg / 2 = {velocity * self.ramp_foot_deg / 2:g} mm"
                )
            length = self.duration_deg / 2 + height / velocity + self.ramp_foot_deg / 2
            if length >= 180:
                faults.append(f"the {side} side is {length:.1f} deg long and must end before 180 deg")
        if faults:
            raise ValueError("; ".join(faults))
        return self

    def ramps(self) -> tuple[tuple[float, float, str], tuple[float, float, str]]:
        """Height [mm], velocity [mm/deg] and name of the opening and the closing ramp."""
        height = self.closing_ramp_height_mm or self.ramp_height_mm
        velocity = self.closing_ramp_velocity_mm_per_deg or self.ramp_velocity_mm_per_deg
        return (self.ramp_height_mm, self.ramp_velocity_mm_per_deg, "opening"), (height, velocity, "closing")
