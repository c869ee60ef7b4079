"""Settling to the periodic motion, and the revolutions that are measured."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.metrics import measure
from camopt.measure.periodic import periodic_state
from camopt.scene.errors import MotionRefused
from camopt.scene.quantities import LESS_IS_WORSE
from camopt.scene.response import Response, Revolve, end_state, joined, next_state
from camopt.scene.rest import state_at_rest
from camopt.scene.settled import (
    APERIODIC,
    MEASURED,
    MOST_REVOLUTIONS,
    PLAIN_REVOLUTIONS,
    SETTLED_POSITION,
    SETTLED_VELOCITY,
    UNBOUND,
    revolutions_needed,
    way_left,
)
from camopt.scene.train import Train
from camopt.scene.vibration import slowest_decay


@dataclass(frozen=True, repr=False)
class Settled:
    """The measured revolutions of a motion, and one more for the last bounce window."""

    response: Response  # measured + 1 revolutions
    revolutions: int  # run before the measured ones
    periodic: bool
    faded: bool = True  # whether the train's slowest mode had the revolutions that it needs to die out

    def __repr__(self) -> str:
        return f"Settled({'periodic' if self.periodic else 'aperiodic'} after {self.revolutions} revolutions)"

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
    most: int | None = None,
    measured: int = MEASURED,
    aperiodic: int = APERIODIC,
    position: float = SETTLED_POSITION,
    decay: float = np.inf,
) -> Settled:
    """Run revolutions from `state` (2n) until the motion stands, then the measured ones.

    It stands where the way that is left is at most `position` [m] in every position and SETTLED_VELOCITY in proportion
    in every velocity. A change d over a revolution that shrinks by the factor r from each to the next leaves
    d r / (1 - r); r = exp(-decay), `decay` being what `decay_per_revolution` says of the train, and no way left is
    taken to be shorter than the last change. At most `most` revolutions, by default PLAIN_REVOLUTIONS; where the
    slowest mode needs more it gets them, after a search for the periodic motion that they lead to. A motion that has
    not settled by then is reported as aperiodic and measured over `aperiodic` revolutions. Raises MotionRefused where
    the motion has no bound (a step past the stability limit).
    """
    needed = revolutions_needed(decay)
    slow = needed > PLAIN_REVOLUTIONS
    stands = _Stands(position, way_left(decay))
    state, revolutions, periodic = _run(revolve, state, PLAIN_REVOLUTIONS if most is None else most, stands)
    if slow and most is None and not periodic:
        state, hastened = _hastened(revolve, state)
        state, more, periodic = _run(revolve, state, min(needed, MOST_REVOLUTIONS) - PLAIN_REVOLUTIONS, stands)
        revolutions += hastened + more
    faded = periodic or not slow or (most is None and needed <= MOST_REVOLUTIONS)
    responses = []
    for _ in range((measured if periodic else aperiodic) + 1):
        responses.append(_finite(revolve(state)))
        state = end_state(responses[-1])
    return Settled(joined(responses), revolutions, periodic, faded)


@dataclass(frozen=True)
class _Stands:
    """Whether the way that is left, `left` times the last change over a revolution, is within `position` [m]."""

    position: float
    left: float

    def __call__(self, change: np.ndarray) -> bool:
        n, velocity = len(change) // 2, SETTLED_VELOCITY * self.position / SETTLED_POSITION
        way = self.left * np.abs(change)
        return bool(way[:n].max() < self.position and way[n:].max() < velocity)


def _run(revolve: Revolve, state: np.ndarray, most: int, stands: _Stands) -> tuple[np.ndarray, int, bool]:
    """Plain revolutions until the state stands, at most `most`: the state, how many, and whether it stands."""
    for revolution in range(1, most + 1):
        before, state = state, _bounded(next_state(revolve, state))
        if stands(state - before):
            return state, revolution, True
    return state, most, False


def _hastened(revolve: Revolve, state: np.ndarray) -> tuple[np.ndarray, int]:
    """A state nearer to the periodic motion of a lightly damped train, and the revolutions it took to find.

    Only stable motions are gone to; from wherever this leads, plain revolutions say whether the motion stands.
    """
    try:
        found = periodic_state(revolve, state)
    except MotionRefused:
        return state, 0
    return found.state, found.revolutions


def settled_from_rest(prepare: Callable[..., Revolve], train: Train, lift: Lift, cam_speed: float, *steps) -> Settled:
    """The motion of a method from rest on the base circle: what verdicts, sweeps and pictures call settled.

    `prepare` is the method's, `cam_speed` [rad/s], `steps` its steps per revolution where it needs them.
    """
    rest = state_at_rest(train)
    return settle(prepare(train, lift, cam_speed, *steps), rest, decay=decay_per_revolution(train, cam_speed))


def decay_per_revolution(train: Train, cam_speed: float) -> float:
    """By what power of e the train's slowest mode dies out over a revolution of the cam at `cam_speed` [rad/s]."""
    return slowest_decay(train) * 2 * np.pi / cam_speed


def first_revolution(revolve: Revolve, state: np.ndarray) -> Settled:
    """The revolution that begins in `state` (2n), measured as it is: for comparing methods, not for judging cams.

    Raises MotionRefused where the motion has no bound.
    """
    first = _finite(revolve(state))
    return Settled(joined([first, _finite(revolve(end_state(first)))]), 0, True)


def _bounded(state: np.ndarray) -> np.ndarray:
    """The state, unless it has left all bounds."""
    if not np.all(np.isfinite(state)) or np.abs(state[: len(state) // 2]).max() > UNBOUND:
        raise MotionRefused("the motion has no bound: the step is past the method's stability limit; take more steps")
    return state


def _finite(response: Response) -> Response:
    """The response, unless it has left all bounds on the way or at its end."""
    _bounded(end_state(response))
    _bounded(np.abs(response.x).max(axis=0).repeat(2))
    return response
