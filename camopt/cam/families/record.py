"""What camopt knows of a cam family: one record, which stands in the family's own file."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pkgutil import resolve_name
from typing import Any, NamedTuple

import numpy as np

from camopt.cam.families.registry import BY_COEFFICIENTS, FAMILIES
from camopt.cam.lift import Lift
from camopt.cam.ramps import Ramp
from camopt.scene.schema import Scene

LEAST, MOST = 1e-6, 1e6
"""Smallest size of a parameter but zero, and its largest, in field units: beyond them arithmetic fails, not cams."""

Parameters = dict[str, Any]
"""Arrays or numbers by name, in the unit that the name states."""
Event = Callable[[Parameters, Ramp, Ramp], tuple[Any, Any]]
"""From parameters in arrays of NumPy or JAX, and both ramps, to borders (p + 1) [rad] and pieces (p, q) [m/rad^k]."""


def number(text: str) -> float:
    """A number of a size that a cam may have."""
    value = float(text)
    if not (value == 0 or LEAST <= abs(value) <= MOST):
        raise ValueError(f"zero or a size from {LEAST:g} to {MOST:g} is needed")
    return value


def numbers(text: str) -> tuple[float, ...]:
    """Numbers between slashes, as in 2/10/18."""
    return tuple(number(part) for part in text.split("/"))


def yes_or_no(text: str) -> bool:
    """yes or no."""
    if text not in ("yes", "no"):
        raise ValueError("yes or no is needed")
    return text == "yes"


SIZE = f"of a size from {LEAST:g} to {MOST:g}, or zero"
EXPECTED = {number: f"a number {SIZE}", numbers: f"numbers like 2/10/18, each {SIZE}", yes_or_no: "yes or no"}
"""What each parser takes, in the words of the sentence that refuses anything else."""


class Parameter(NamedTuple):
    """A parameter as the command line gives it: the keyword of the family's function, and the parser of its text; a
    `searched` one is chosen by the search for the family's best member, and nobody may give it there."""

    keyword: str
    parse: Callable[[str], object]
    searched: bool = True


@dataclass(frozen=True)
class Space:
    """What may be searched in a family: bounds of the search vector, and the member that belongs to a vector.

    `member` raises InputError for a vector to which no member belongs. `known` vectors join the first population of a
    search. `largest` designs the largest area within the limits on the shape alone, from (number of members, seed),
    where the family has a method of its own for that.
    """

    bounds: list[tuple[float, float]]
    member: Callable[[np.ndarray], Lift]
    known: Sequence[Sequence[float]] = ()
    largest: Callable[[int, int], Lift] | None = None


@dataclass(frozen=True)
class Family:
    """A cam family, as the command line, the gradients, the search for baselines and the figures know it.

    `design(scene, **keywords)` gives a member, without keywords the plain one; it is None where a member comes from its
    coefficients alone. `parameters` are those of the command line by name. `construction(scene, cam)` gives a cam's own
    parameters and the function that builds its event from them; a family without it cannot be differentiated. A
    `symmetric` family is also built for the scene's design conditions, between two equal ramps; another one keeps the
    scene's. `space(scene, jerk, **keywords)` is what a search for the largest area may choose, under the jerk limit
    only with `jerk`; without it the plain member stands for the family. `line` holds colour and dashes in figures; a
    family without gets a colour by its name.
    """

    name: str
    design: Callable[..., Lift] | None = None
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    construction: Callable[[Scene, Lift], tuple[Parameters, Event]] | None = None
    symmetric: bool = True
    space: Callable[..., Space] | None = None
    line: tuple[str, Any] | None = None


def family_named(name: str) -> Family:
    """The record of a family; KeyError for a name that is none."""
    return resolve_name((FAMILIES | BY_COEFFICIENTS)[name])
