"""The record that describes a cam family. Each family has one, in its own file."""

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
"""Least and largest magnitude of a nonzero parameter, in field units; beyond them arithmetic fails, not cams."""

Parameters = dict[str, Any]
"""Arrays or numbers by name, in the unit that the name states."""
BuildEvent = Callable[[Parameters, Ramp, Ramp], tuple[Any, Any]]
"""From parameters (arrays of NumPy or JAX) and both ramps to borders (p + 1) [rad] and pieces (p, q) [m/rad^k]."""


def number(text: str) -> float:
    """Parses a number of a magnitude that a cam's parameter may have."""
    value = float(text)
    if not (value == 0 or LEAST <= abs(value) <= MOST):
        raise ValueError(f"zero or a size from {LEAST:g} to {MOST:g} is needed")
    return value


def numbers(text: str) -> tuple[float, ...]:
    """Parses numbers separated by slashes, as in 2/10/18."""
    return tuple(number(part) for part in text.split("/"))


def yes_or_no(text: str) -> bool:
    """Parses "yes" or "no"."""
    if text not in ("yes", "no"):
        raise ValueError("yes or no is needed")
    return text == "yes"


SIZE = f"of a size from {LEAST:g} to {MOST:g}, or zero"
EXPECTED = {number: f"a number {SIZE}", numbers: f"numbers like 2/10/18, each {SIZE}", yes_or_no: "yes or no"}
"""What each parser accepts, in the words of the sentence that refuses anything else."""


class Parameter(NamedTuple):
    """A parameter as given on the command line: the keyword of the family's function, and the parser of its text. A
    `searched` one is chosen by the search for the family's best member and may not be given there."""

    keyword: str
    parse: Callable[[str], object]
    searched: bool = True


@dataclass(frozen=True)
class Space:
    """The search space of a family: bounds of the search vector, and the member that belongs to a vector.

    `member` raises InputError for a vector to which no member belongs. `known` vectors join the first population of a
    search. `largest`, if the family has a method of its own for it, designs the member with the largest area within the
    limits on the shape alone, from (number of members, seed).
    """

    bounds: list[tuple[float, float]]
    member: Callable[[np.ndarray], Lift]
    known: Sequence[Sequence[float]] = ()
    largest: Callable[[int, int], Lift] | None = None


@dataclass(frozen=True)
class Family:
    """A cam family, as the command line, the gradients, the search for baselines and the figures use it.

    `design(scene, **keywords)` returns a member, and without keywords the default one; it is None if a member is
    defined by its coefficients alone. `parameters` are those of the command line, by name. `construction(scene, cam)`
    returns the parameters that only this family has and the function that builds its event from them; a family without
    it cannot be differentiated. The parameters of a `symmetric` family also include the design conditions, and it lies
    between two equal ramps; any other family has the design conditions of the scene. `space(scene, jerk, **keywords)`
    is the search space for the largest area, under the jerk limit only with `jerk`; without it the default member
    represents the family. `line` has colour and dashes in figures; a family without it gets a colour by its name.
    """

    name: str
    design: Callable[..., Lift] | None = None
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    construction: Callable[[Scene, Lift], tuple[Parameters, BuildEvent]] | None = None
    symmetric: bool = True
    space: Callable[..., Space] | None = None
    line: tuple[str, Any] | None = None


def family_named(name: str) -> Family:
    """The record of a family. Raises KeyError for an unknown name."""
    return resolve_name((FAMILIES | BY_COEFFICIENTS)[name])
