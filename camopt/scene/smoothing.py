"""Smoothing of the contacts on the smooth path: the arguments that the public functions have in common."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from camopt.scene.errors import InputError
from camopt.scene.units import UM

FEWEST_STEPS, MOST_STEPS = 360, 28800
"""Least and largest number of steps per revolution: one per degree, and one per eightieth of a degree."""
NAMES = "width_um", "tie", "steps_per_revolution"
"""Names of the arguments."""


class Smoothing(NamedTuple):
    """Width of the layer over which the force of a contact sets in, share of the law between cam and valve that is
    bilateral, and number of equal steps per revolution."""

    width: float = 1e-6  # m
    tie: float = 1.0
    steps: int = 1440

    @property
    def as_asked(self) -> dict[str, Any]:
        """The values that differ from the defaults, by the names of the arguments."""
        numbers = self.width / UM, self.tie, self.steps
        entries = zip(NAMES, numbers, self, Smoothing(), strict=True)
        return {name: number for name, number, value, usual in entries if value != usual}


def smoothing(verb: str, width_um, tie, steps_per_revolution) -> Smoothing:
    """The smoothing for the arguments of a public function `verb`; None stands for the default. Raises InputError for a
    width that is not a positive number [um], a share outside 0 to 1, and steps outside the limits above."""
    usual = Smoothing()
    width_um, tie = usual.width / UM if width_um is None else width_um, usual.tie if tie is None else tie
    steps = usual.steps if steps_per_revolution is None else steps_per_revolution
    if not (_number(width_um) and width_um > 0):
        raise InputError(f"{verb}: width_um {width_um!r}: expected a width of the contacts' layer above 0, such as 1")
    if not (_number(tie) and 0.0 <= tie <= 1.0):
        raise InputError(f"{verb}: tie {tie!r}: expected a share from 0 to 1")
    if not (_number(steps) and int(steps) == steps and FEWEST_STEPS <= steps <= MOST_STEPS):
        raise InputError(
            f"{verb}: steps_per_revolution {steps!r}: expected an integer from {FEWEST_STEPS} to {MOST_STEPS}"
        )
    return Smoothing(float(width_um) * UM, float(tie), int(steps))


def smoothing_in(settings: Mapping[str, Any]) -> Smoothing:
    """The smoothing in the settings of a run (`Smoothing.as_asked`). Raises InputError if it differs from the default
    in a run without a smoothed motion, or in a search for a yield."""
    chosen = smoothing("optimize", *(settings.get(name) for name in NAMES))
    if chosen != Smoothing() and (settings.get("gradient") == "exact" or "yield" in settings):
        raise InputError(
            "optimize: width_um, tie or steps_per_revolution with source 'exact' or a wanted yield: leave them out"
        )
    return chosen


def _number(value: Any) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and bool(np.isfinite(value))
