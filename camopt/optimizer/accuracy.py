"""What `--accuracy` means in the optimiser and in the verdict it asks for: one table."""

from dataclasses import dataclass

import numpy as np

from camopt.scene.design import Operation
from camopt.scene.errors import InputError
from camopt.verifier import DRAFT, FINE, STANDARD
from camopt.verifier.accuracy import EFFORTS, Effort


@dataclass(frozen=True)
class Accuracy:
    """The effort that one accuracy stands for."""

    knot_deg: float  # knot interval of the free cam
    program_speeds: int  # speeds of the search over a band
    judged_speeds: int  # speeds over a band at which a cam must hold
    judge_stride: int  # one of these in so many is judged first
    feedback_rounds: int  # programs whose margins the judge feeds back
    verdict: Effort  # effort of the final verdict
    without_jerk_limit: bool  # whether the comparison shows the families without it as well
    foretold_trains: int  # drawn trains whose foretold openings lead to the neighbourhood of a cam for a yield
    shaping_trains: int  # drawn trains whose motions shape that cam
    unseen_trains: int  # others that say how large it may be
    stated_trains: int  # fresh ones that state the yield, unless a wanted share lets fewer than the next be expected
    stated_failing: int  # to fail of them
    stated_speeds: int  # speeds over the band at which they are judged
    stated_parts: tuple[float, ...]  # after what parts of them the count may end
    every_speed_drawn: bool = True  # whether the valve's motion is drawn at every listed speed, or at both ends alone


LOOKS = (0.15, 0.5, 0.625, 0.75, 0.875)
"""After what parts of its trains a statement may end. Of 4000 trains 3200 are judged on average where 99.4 % hold and
99 % are wanted, and 3900 by the first two looks and intervals of 99.9 %."""
ACCURACIES = {
    DRAFT: Accuracy(2.75, 9, 93, 2, 12, EFFORTS[DRAFT], False, 200, 500, 400, 200, 10, 11, (0.5,), False),
    STANDARD: Accuracy(1.75, 17, 373, 8, 24, EFFORTS[STANDARD], True, 300, 1500, 1500, 1000, 40, 11, LOOKS),
    FINE: Accuracy(1.5, 33, 745, 16, 40, EFFORTS[FINE], True, 600, 3000, 4000, 4000, 80, 21, LOOKS),
}
"""By name. 40 failing trains of 4000 tell a loss of one per cent to a sixth of itself."""

BEYOND = 1e-3
"""The judged band exceeds the scene's by this share of a speed, to include the verdict's neighbouring speeds."""


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
