"""Settling to the periodic motion, and the revolutions that are measured."""

from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.metrics import measure
from camopt.scene.errors import MotionRefused
from camopt.scene.response import Response, Revolve, end_state, joined

SETTLED_POSITION = 1e-6
"""Largest change of a position over a revolution of a settled motion [m] (docs/model.md)."""
SETTLED_VELOCITY = 1e-3
"""Largest change of a velocity over a revolution of a settled motion [m/s]."""
LESS_IS_WORSE = {"contact_force_min_N", "dynamic_area_mm_deg"}


@dataclass(frozen=True)
class Settled:
    """The measured revolutions of a motion, and one more for the last bounce window."""

    response: Response  # measured + 1 revolutions
    revolutions: int  # run before the measured ones
    periodic: bool

    def metrics(self, lift: Lift) -> "Figures":
        """The metrics of the measured revolutions."""
        return Figures(measure(self.response, lift))


@dataclass(frozen=True)
class Figures:
    """Metrics by revolution: name -> shape (R), in the units of their names."""

    by_revolution: dict[str, np.ndarray]

    def worst(self, name: str) -> float:
        """The worst revolution's value; NaN where the valve did not seat in one of them."""
        values = self.by_revolution[name]
        return float(np.min(values) if name in LESS_IS_WORSE else np.max(values))

    def range(self, name: str) -> tuple[float, float]:
        """Smallest and largest value over the measured revolutions."""
        return float(np.min(self.by_revolution[name])), float(np.max(self.by_revolution[name]))


def settle(
    revolve: Revolve,
    state: np.ndarray,
    most: int = 40,
    measured: int = 4,
    aperiodic: int = 8,
    position: float = SETTLED_POSITION,
) -> Settled:
    """Run revolutions from `state` (2n) until the state one revolution apart stands, then the measured ones.

    It stands where no position moves by more than `position` [m] and no velocity by SETTLED_VELOCITY in proportion. At
    most `most` revolutions; a motion that has not settled by then is reported as aperiodic and measured over
    `aperiodic` revolutions. Raises MotionRefused where the motion has no bound (a step past the stability limit).
    """
    n, velocity = len(state) // 2, SETTLED_VELOCITY * position / SETTLED_POSITION
    periodic, revolutions = False, 0
    while not periodic and revolutions < most:
        after = _next_state(revolve, state)
        change = np.abs(after - state)
        periodic = bool(change[:n].max() < position and change[n:].max() < velocity)
        state, revolutions = after, revolutions + 1
    responses = []
    for _ in range((measured if periodic else aperiodic) + 1):
        responses.append(_finite(revolve(state)))
        state = end_state(responses[-1])
    return Settled(joined(responses), revolutions, periodic)


def first_revolution(revolve: Revolve, state: np.ndarray) -> Settled:
    """The revolution that begins in `state` (2n), measured as it is: for comparing methods, not for judging cams.

    Raises MotionRefused where the motion has no bound.
    """
    first = _finite(revolve(state))
    return Settled(joined([first, _finite(revolve(end_state(first)))]), 0, True)


def _next_state(revolve: Revolve, state: np.ndarray) -> np.ndarray:
    """The state a revolution later; a method that offers `advance` gets there without samples, which is faster."""
    advance = getattr(revolve, "advance", None)
    return end_state(_finite(revolve(state))) if advance is None else advance(state, 1)


def _finite(response: Response) -> Response:
    """The response, unless it has left all bounds: a kilometre of valve lift is no motion of a valve train."""
    end = end_state(response)
    if not np.all(np.isfinite(end)) or np.abs(response.x).max() > 1e3:
        raise MotionRefused("the motion has no bound: the step is past the method's stability limit; take more steps")
    return response
