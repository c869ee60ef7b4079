"""Schema of a scene file: masses, elements, forces, operation, design limits, geometry and tolerances."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, field_validator

from camopt.scene.design import Design, Operation
from camopt.scene.element import Element
from camopt.scene.errors import InputError
from camopt.scene.geometry import Geometry as Geometry
from camopt.scene.table import Name, NonNegative, Positive, Table
from camopt.scene.units import RPM

HIGHEST_HARMONIC = 200
Part = Literal["valve", "seat", "operation", "design", "geometry"]
"""Optional tables and keys of a scene that a caller may require."""
SIMULATED: tuple[Part, ...] = ("valve", "seat", "operation", "design")
"""What a scene must have if a cam is to be designed for it and simulated."""
Stated = TypeVar("Stated")


def _text_or_texts(value: Any) -> Any:
    texts = value if isinstance(value, tuple) else (value,)
    if not texts or not all(isinstance(text, str) for text in texts):
        raise ValueError('must be a text NAME.KEY, such as "spring.stiffness_N_per_m", or an array of such texts')
    return value


def _below_one(value: float) -> float:
    if value >= 1.0:
        raise ValueError("must be below 1: no number scatters by as much as itself")
    return value


class Tolerance(Table, frozen=True):
    """Scatter of one number, or of several, from train to train.

    `of` is NAME.KEY of a mass or an element. With wildcards in NAME, as in "*", it refers to each of those whose number
    under the key is not zero, and every number has an independent draw. If `of` is an array, one draw changes them
    together.

    The width of the scatter is given as a share of the number, `relative`, or in the unit of the key, `plus_minus`.
    Under "normal" it is the standard deviation, and draws are cut off at `camopt.scene.as_built.REACH` standard
    deviations. Under "uniform" it is half the width of the interval. Under "lognormal" a draw multiplies the number by
    exp(relative * a standard normal draw).

    A spring with a force_table also has a stiffness and a preload, those of its table with the valve closed. Both in
    one array scatter its loads (`camopt.scene.parameters`). `name` is its label in results, by default `of` itself.
    """

    of: Annotated[str | tuple[str, ...], BeforeValidator(_text_or_texts)]
    relative: Annotated[Positive, AfterValidator(_below_one)] | None = None
    plus_minus: Positive | None = Field(default=None, validate_default=True)
    distribution: Literal["normal", "lognormal", "uniform"] = "normal"
    name: Annotated[str, Field(max_length=100)] = ""
    assumed: tuple[str, ...] = ()
    source: str = ""

    @field_validator("plus_minus")
    @classmethod
    def _one_of_both(cls, plus_minus, info: ValidationInfo):
        if "relative" in info.data and (info.data["relative"] is None) == (plus_minus is None):
            raise ValueError("give either relative or plus_minus")
        return plus_minus

    @field_validator("distribution")
    @classmethod
    def _a_factor(cls, distribution, info: ValidationInfo):
        if distribution == "lognormal" and info.data.get("plus_minus") is not None:
            raise ValueError('"lognormal" draws a factor: give relative in place of plus_minus')
        return distribution

    @property
    def numbers(self) -> tuple[str, ...]:
        """The texts NAME.KEY in `of`."""
        return (self.of,) if isinstance(self.of, str) else self.of

    @property
    def label(self) -> str:
        """Its label in results: its name, or the numbers that it changes."""
        first, *more = self.numbers
        return self.name or (f"{first} and {len(more)} more" if more else first)


class Grinding(Table, frozen=True):
    """The error of one ground cam: its largest value, and the harmonics of a revolution that it contains.

    All harmonics from the lowest to the highest are drawn with equal expected amplitude (`camopt.measure.as_built`).
    """

    error_um: Positive
    harmonics: tuple[int, int] = (2, 40)
    assumed: tuple[str, ...] = ()
    source: str = ""

    @field_validator("harmonics")
    @classmethod
    def _lower_first(cls, harmonics):
        if not 1 <= harmonics[0] <= harmonics[1] <= HIGHEST_HARMONIC:
            raise ValueError(f"must be [lowest, highest] with 1 <= lowest <= highest <= {HIGHEST_HARMONIC}")
        return harmonics


MOST_ROWS = {"mass": 200, "element": 400, "force": 20, "tolerance": 200}
AS_BUILT = {"tolerance", "grinding"}
"""Tables used only for manufacturing scatter."""


class Mass(Table, frozen=True):
    """A mass on the valve axis.

    `damping_N_s_per_m` is a damper to ground. `force_N` is a constant force; a positive one opens the valve.
    """

    name: Name
    mass_kg: Positive
    damping_N_s_per_m: NonNegative = 0.0
    force_N: float = 0.0
    assumed: tuple[str, ...] = ()
    source: str = ""


class Force(Table, frozen=True):
    """A force on a mass that is periodic in the cam angle, such as the gas force on a valve.

    `table` has rows of [cam_angle_deg, force_N] from -180 to 180 with the same force at both ends, between which the
    force is interpolated linearly. A positive force opens the valve.
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


class Scene(Table, frozen=True):
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
        if design is None or not {"operation", "geometry"} <= info.data.keys():  # a fault in either is reported alone
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

    @property
    def required_operation(self) -> Operation:
        """The operation; raises InputError if the scene has none."""
        return self._required("operation", self.operation)

    @property
    def required_design(self) -> Design:
        """The design; raises InputError if the scene has none."""
        return self._required("design", self.design)

    @property
    def required_geometry(self) -> Geometry:
        """The geometry; raises InputError if the scene has none."""
        return self._required("geometry", self.geometry)

    def _required(self, part: Part, stated: Stated | None) -> Stated:
        if stated is None:
            raise InputError(f"scene {self.name!r}: this needs its [{part}], which is missing")
        return stated

    def cam_speed(self, speed_rpm: float) -> float:
        """Cam speed [rad/s] at a crankshaft speed [r/min]."""
        return speed_rpm * self.required_operation.cam_per_crank * RPM
