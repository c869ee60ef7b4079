"""What a scene file may say of trains as built: how its numbers scatter, and the error of a ground cam."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, field_validator

from camopt.scene.table import Positive, Table

HIGHEST_HARMONIC = 200


def _text_or_texts(value: Any) -> Any:
    texts = value if isinstance(value, tuple) else (value,)
    if not texts or not all(isinstance(text, str) for text in texts):
        raise ValueError('must be a text NAME.KEY, such as "spring.stiffness_N_per_m", or an array of such texts')
    return value


def _not_all_of_it(value: float) -> float:
    if value >= 1.0:
        raise ValueError("must be below 1: no number scatters by as much as itself")
    return value


class Tolerance(Table):
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


class Grinding(Table):
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
