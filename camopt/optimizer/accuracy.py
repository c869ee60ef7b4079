"""The settings that each value of `--accuracy` selects for the optimiser and for its verdict: one table."""

from dataclasses import dataclass

import numpy as np

from camopt.scene.design import Operation
from camopt.scene.errors import InputError
from camopt.verifier import DRAFT, FINE, STANDARD
from camopt.verifier.accuracy import EFFORTS, Effort


@dataclass(frozen=True)
class Accuracy:
    """The settings of one accuracy."""

    knot_deg: float  # knot interval of the free cam
    program_speeds: int  # speeds of the search's programs over a band
    judged_speeds: int  # speeds over a band at which a cam must hold
    judge_stride: int  # stride over these speeds in the first judgement of a cam
    feedback_rounds: int  # programs with margins fed back from the judge
    verdict: Effort  # effort of the final verdict
    without_jerk_limit: bool  # whether the comparison also shows families without the jerk limit
    foretold_trains: int  # drawn trains whose predicted contact openings give the start of a search for yield
    shaping_trains: int  # drawn trains whose motions then shape the cam
    unseen_trains: int  # further drawn trains that decide how large its area may be
    stated_trains: int  # least number of fresh trains that state the yield
    stated_failing: int  # more are drawn until the wanted share lets this many of them fail
    stated_speeds: int  # speeds over the band at which these trains are judged
    stated_parts: tuple[float, ...]  # shares of these trains after which the count may end
    every_speed_drawn: bool = True  # whether figures show the valve at every listed speed, or at both ends only


LOOKS = (0.15, 0.5, 0.625, 0.75, 0.875)
"""Shares of its trains after which a statement may end. Of 4000 trains 3200 are judged on average where 99.4 % hold and
99 % are wanted; with only the first two of these shares and intervals of 99.9 % it would be 3900."""
ACCURACIES = {
    DRAFT: Accuracy(2.75, 9, 93, 2, 12, EFFORTS[DRAFT], False, 200, 500, 400, 200, 10, 11, (0.5,), False),
    STANDARD: Accuracy(1.75, 17, 373, 8, 24, EFFORTS[STANDARD], True, 300, 1500, 1500, 1000, 40, 11, LOOKS),
    FINE: Accuracy(1.5, 33, 745, 16, 40, EFFORTS[FINE], True, 600, 3000, 4000, 4000, 80, 21, LOOKS),
}
"""Settings by name. With 40 failing trains of 4000 a loss of one per cent is known to a sixth of itself."""

BEYOND = 1e-3
"""The judged band extends beyond the scene's by this share of a speed, to include the verdict's neighbouring speeds."""


def accuracy_named(name: str) -> Accuracy:
    """The settings of an accuracy; raises InputError for an unknown one."""
    if name not in ACCURACIES:
        raise InputError(f"accuracy {name!r}: expected one of {', '.join(ACCURACIES)}")
    return ACCURACIES[name]


def design_speeds(operation: Operation, speeds: str, accuracy: Accuracy) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [r/min] of the program and of the judge for `speeds` = "nominal" or "band".

    The judged grid of a band starts just outside it and shares no speed with grids of whole tens inside.
    """
    if speeds == "nominal":
        listed = np.array(operation.speeds_rpm)
        near = np.sort(np.concatenate([listed * (1 - BEYOND), listed, listed * (1 + BEYOND)]))
        return near, near
    low, high = operation.band_rpm[0] * (1 - BEYOND), operation.band_rpm[1] * (1 + BEYOND)
    return np.linspace(low, high, accuracy.program_speeds), np.linspace(low, high, accuracy.judged_speeds)


def drawn_speeds(operation: Operation, accuracy: Accuracy) -> tuple[float, ...]:
    """Listed speeds [r/min] at which the valve's motion is drawn."""
    listed = operation.speeds_rpm
    return tuple(listed) if accuracy.every_speed_drawn else tuple(dict.fromkeys((min(listed), max(listed))))
