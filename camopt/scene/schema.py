"""What a scene file may say: masses, elements, operation, design limits and geometry, in the field's units."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationInfo, field_validator

from camopt.scene.design import Design
from camopt.scene.element import Element
from camopt.scene.geometry import Geometry as Geometry
from camopt.scene.table import Name, NonNegative, Positive, Table
from camopt.scene.tolerances import Grinding, Tolerance

MOST_ROWS = {"mass": 200, "element": 400, "force": 20, "tolerance": 200}
AS_BUILT = {"tolerance", "grinding"}
"""Tables used only for manufacturing scatter."""


class Mass(Table):
    """A mass on the valve's axis.

    `damping_N_s_per_m` is a damper to ground. `force_N` is a constant force; a positive one opens the valve.
    """

    name: Name
    mass_kg: Positive
    damping_N_s_per_m: NonNegative = 0.0
    force_N: float = 0.0
    assumed: tuple[str, ...] = ()
    source: str = ""


class Force(Table):
    """A force on a mass that repeats with the cam angle, such as that of the gas on a valve.

    `table` has rows of [cam_angle_deg, force_N], joined by straight lines, from -180 to 180 with the same force at
    both. A positive force opens the valve.
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


class Scene(Table):
    """A valve train with its operation and design conditions, as a scene file states them."""

    format: Literal[1]
    name: Name
    title: str = ""
    reference: str = ""
    valve: str | None = None
    seat: str | None = None
    operation: Operation | None = None
    geometry: Geometry | None = None
    design: Design | None = None
    mass: Annotated[tuple[Mass, ...], Field(min_length=1, max_length=MOST_ROWS["mass"])]
    element: Annotated[tuple[Element, ...], Field(min_length=1, max_length=MOST_ROWS["element"])]
    force: Annotated[tuple[Force, ...], Field(max_length=MOST_ROWS["force"])] = ()
    tolerance: Annotated[tuple[Tolerance, ...], Field(max_length=MOST_ROWS["tolerance"])] = ()
    grinding: Grinding | None = None

    @field_validator("design")
    @classmethod
    def _in_its_scene(cls, design, info: ValidationInfo):
        if design is None or not {"operation", "geometry"} <= info.data.keys():  # a faulty table hides nothing
            return design
        design = design.within(info.data["geometry"], info.data["operation"])
        if faults := design.missing():
            raise ValueError("; ".join(faults))
        return design

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with some tables replaced; its design refers to the copy's own geometry and operation."""
        copy = super().model_copy(update=update, deep=deep)
        if copy.design is not None:
            object.__setattr__(copy, "design", copy.design.within(copy.geometry, copy.operation))  # it is frozen
        return copy

    def cam_speed(self, speed_rpm: float) -> float:
        """Cam speed [rad/s] at a crankshaft speed [r/min]."""
        from camopt.scene.units import RPM

        assert self.operation is not None, "load_scene(..., need='operation') guarantees it"
        return speed_rpm * self.operation.cam_per_crank * RPM
