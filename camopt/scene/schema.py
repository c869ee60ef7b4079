"""What a scene file may say: masses, elements, operation, design limits and geometry, in the field's units."""

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from camopt.scene.element import Element
from camopt.scene.geometry import Geometry as Geometry
from camopt.scene.table import Name, NonNegative, Positive, Table, Usable
from camopt.scene.tolerances import Grinding, Tolerance

MOST_ROWS = {"mass": 200, "element": 400, "force": 20, "tolerance": 200}
AS_BUILT = {"tolerance", "grinding"}
"""The tables of a scene that say how trains differ: whoever takes the train as given reads none of them."""


class Mass(Table):
    """A mass on the valve axis; `damping_N_s_per_m` acts to ground, `force_N` is constant and positive opens."""

    name: Name
    mass_kg: Positive
    damping_N_s_per_m: NonNegative = 0.0
    force_N: float = 0.0
    assumed: tuple[str, ...] = ()
    source: str = ""


class Force(Table):
    """A force on a mass that repeats with the cam angle, such as that of the gas on a valve.

    `table` has rows of [cam_angle_deg, force_N], joined by straight lines, from -180 to 180 with the same force at
    both; positive opens.
    """

    on: str
    table: Annotated[tuple[tuple[float, float], ...], Field(min_length=2, max_length=1000)]
    assumed: tuple[str, ...] = ()
    source: str = ""

    @field_validator("table")
    @classmethod
    def _periodic(cls, table):
        if any(a[0] >= b[0] for a, b in pairwise(table)):
            raise ValueError("the cam angles of its rows must ascend without repeats")
        if table[0][0] != -180.0 or table[-1][0] != 180.0 or table[0][1] != table[-1][1]:
            raise ValueError(
                "must begin at -180 and end at 180 cam degrees with the same force, because it repeats every revolution"
            )
        return table


class Operation(Table):
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


class Design(Table):
    """Design conditions and limits of the cam; a limit that is left out does not limit."""

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
    bounce_max_mm: NonNegative | None = None
    jump_max_mm: NonNegative | None = None
    jump_max_deg: NonNegative | None = None
    seating_velocity_max_m_per_s: Positive | None = None
    contact_force_min_N: Positive | None = None
    contact_force_max_N: Positive | None = None

    @field_validator("nose_deg")
    @classmethod
    def _within_the_duration(cls, nose, info: ValidationInfo):
        duration = info.data.get("duration_deg")
        if nose is not None and duration is not None and nose >= duration / 2:
            raise ValueError("must be below half of duration_deg")
        return nose

    @model_validator(mode="after")
    def _consistent(self):
        faults = []
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


class Scene(Table):
    """A valve train with its operation and design conditions, as a scene file states them."""

    format: Literal[1]
    name: Name
    title: str = ""
    reference: str = ""
    valve: str | None = None
    seat: str | None = None
    operation: Operation | None = None
    design: Design | None = None
    geometry: Geometry | None = None
    mass: Annotated[tuple[Mass, ...], Field(min_length=1, max_length=MOST_ROWS["mass"])]
    element: Annotated[tuple[Element, ...], Field(min_length=1, max_length=MOST_ROWS["element"])]
    force: Annotated[tuple[Force, ...], Field(max_length=MOST_ROWS["force"])] = ()
    tolerance: Annotated[tuple[Tolerance, ...], Field(max_length=MOST_ROWS["tolerance"])] = ()
    grinding: Grinding | None = None

    def cam_speed(self, speed_rpm: float) -> float:
        """Cam speed [rad/s] at a crankshaft speed [r/min]."""
        from camopt.scene.units import RPM

        assert self.operation is not None, "load_scene(..., need='operation') guarantees it"
        return speed_rpm * self.operation.cam_per_crank * RPM
