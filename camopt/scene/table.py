"""What every table of a scene file has in common: which numbers and names it takes, and that it says nothing else."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, Field, field_validator

SMALLEST, LARGEST = 1e-12, 1e15
"""Size of a number of a scene in its key's unit, where it may not be zero: what lies beyond is a slip, and double
precision does not hold it beside the others."""


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
