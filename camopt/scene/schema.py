"""What a scene file may say: masses, elements, operation, design limits and geometry, in the field's units."""

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
"""The optional parts of a scene that a reader may ask for."""
SIMULATED: tuple[Part, ...] = ("valve", "seat", "operation", "design")
"""What of a scene it takes to design a cam and to simulate it."""
Stated = TypeVar("Stated")


def _text_or_texts(value: Any) -> Any:
    texts = value if isinstance(value, tuple) else (value,)
    if not texts or not all(isinstance(text, str) for text in texts):
        raise ValueError('must be a text NAME.KEY, such as "spring.stiffness_N_per_m", or an array of such texts')
    return value


def _not_all_of_it(value: float) -> float:
    if value >= 1.0:
        raise ValueError("must be below 1: no number scatters by as much as itself")
    return value


class Tolerance(Table, frozen=True):
    """How one number, or several, scatter from train to train.

    `of` is NAME.KEY of a mass or an element; with wildcards in NAME, as in "*", it is each of them whose number under
    the key is not zero, every one with a draw of its own. Where `of` is an array, one draw moves all its numbers
    together.

    How far a draw moves the number is given as its share `relative`, or as `plus_minus` in the key's own unit. Either
    is the standard deviation under "normal", which is cut off at `camopt.scene.as_built.REACH` of them, and half the
    width under "uniform". Under "lognormal" a draw multiplies the number by exp(relative * a standard normal draw).
    A spring with a force_table has a stiffness and a preload too, those of the table with the valve closed: both in one
    array scatter its loads (`camopt.scene.parameters`). `name` is what results call the tolerance, by default `of`
    itself.
    """

    of: Annotated[str | tuple[str, ...], BeforeValidator(_text_or_texts)]
    relative: Annotated[Positive, AfterValidator(_not_all_of_it)] | None = None
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
        """The texts NAME.KEY of `of`."""
        return (self.of,) if isinstance(self.of, str) else self.of

    @property
    def label(self) -> str:
        """What results call it: its name, or the numbers that it is of."""
        first, *more = self.numbers
        return self.name or (f"{first} and {len(more)} more" if more else first)


class Grinding(Table, frozen=True):
    """The error of one ground cam: its largest value, and the harmonics of a revolution in it.

    Every harmonic from the lowest to the highest is drawn with equal expected size (`camopt.measure.as_built`).
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
    """A mass on the valve's axis.

    `damping_N_s_per_m` is a damper to ground. `force_N` is a constant force; a positive one opens the valve.
    """

    name: Name
    mass_kg: Positive
    damping_N_s_per_m: NonNegative = 0.0
    force_N: float = 0.0
    assumed: tuple[str, ...] = ()
    source: str = ""


class Force(Table, frozen=True):
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

    @property
    def required_operation(self) -> Operation:
        """The operation, for what makes no sense without it; InputError where the scene has none."""
        return self._required("operation", self.operation)

    @property
    def required_design(self) -> Design:
        """The same of the design."""
        return self._required("design", self.design)

    @property
    def required_geometry(self) -> Geometry:
        """The same of the geometry."""
        return self._required("geometry", self.geometry)

    def _required(self, part: Part, stated: Stated | None) -> Stated:
        if stated is None:
            raise InputError(f"scene {self.name!r}: this needs its [{part}], which is missing")
        return stated

    def cam_speed(self, speed_rpm: float) -> float:
        """Cam speed [rad/s] at a crankshaft speed [r/min]."""
        return speed_rpm * self.required_operation.cam_per_crank * RPM
