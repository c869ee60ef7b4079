"""What all tables of a scene file have in common: the numbers and names that they accept, and no unknown keys."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, Field, field_validator

SMALLEST, LARGEST = 1e-12, 1e15
"""Range of the magnitude of a nonzero number in its key's unit. A number outside is a mistake, and double precision
could not represent it beside the others."""


def _not_too_small(value: float) -> float:
    if 0.0 < abs(value) < SMALLEST:
        raise ValueError(f"is smaller than any quantity of a scene ({SMALLEST:g}): check the unit in the key")
    return value


Usable = AfterValidator(_not_too_small)
Positive = Annotated[float, Field(gt=0), Usable]
NonNegative = Annotated[float, Field(ge=0), Usable]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,63}$")]


class Table(BaseModel, extra="forbid", strict=True, frozen=True, allow_inf_nan=False):
    """Base of all tables of a scene file: no unknown keys, no coercion, no NaN, no change after loading."""

    @field_validator("*")
    @classmethod
    def _not_too_large(cls, value):
        parts = list(value) if isinstance(value, tuple) else [value]
        while parts:
            part = parts.pop()
            if isinstance(part, tuple):
                parts += part
            elif isinstance(part, float) and abs(part) > LARGEST:
                raise ValueError(f"is larger than any quantity of a scene ({LARGEST:g}): check the unit in the key")
        return value
