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
from camopt.scene.shapes import Float, State
from camopt.scene.train import Train
from camopt.scene.vibration import slowest_rate


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


@dataclass(frozen=True, repr=False)
class Measured:
    """The figures of a settled motion without its record, which at a verifier's finest step is hundreds of megabytes.

    All else as of `Settled`; `state` (2n + r) is the one at the end, from which a finer step goes on.
    """

    figures: "Figures"
    state: np.ndarray
    revolutions: int
    periodic: bool
    faded: bool = True


@dataclass(frozen=True)
class Figures:
    """Metrics by revolution, in the units of their names."""

    by_revolution: dict[str, Float[np.ndarray, " revolutions"]]

    def worst(self, name: str) -> float:
        """The worst revolution's value; NaN where the valve did not seat in one of them."""
        values = self.by_revolution[name]
        return float(np.min(values) if name in LESS_IS_WORSE else np.max(values))

    def range(self, name: str) -> tuple[float, float]:
        """Smallest and largest value over the measured revolutions."""
        return float(np.min(self.by_revolution[name])), float(np.max(self.by_revolution[name]))


def settle(
    revolve: Revolve,
    state: State,
    most: int | None = None,
    measured: int = MEASURED,
    aperiodic: int = APERIODIC,
    position: float = SETTLED_POSITION,
    decay: float = np.inf,
) -> Settled:
    """Runs revolutions from `state` until the motion has settled, and then the revolutions that are measured.

    The motion has settled once the change that is still to come is at most `position` [m] in every position and every
    memory, and in every velocity SETTLED_VELOCITY in the same proportion. If the change d over a revolution shrinks by
    the factor r from each revolution to the next, the changes to come add up to d r / (1 - r). Here r = exp(-decay),
    with `decay` as of `decay_per_revolution` for the train, and the sum is never taken to be smaller than d itself.

    It runs for at most `most` revolutions, by default PLAIN_REVOLUTIONS. Where the train's slowest mode needs more, a
    search for the periodic motion follows, and then as many revolutions as the mode needs. A motion that has not
    settled by then is reported as aperiodic and measured over `aperiodic` revolutions instead of `measured`. Raises
    MotionRefused where the motion has no bound, because the step is past the method's stability limit.
    """
    state, revolutions, periodic, faded = _stood(revolve, state, most, position, decay)
    responses = []
    for _ in range((measured if periodic else aperiodic) + 1):
        responses.append(_finite(revolve(state)))
        state = end_state(responses[-1])
    return Settled(joined(responses), revolutions, periodic, faded)


def settle_and_measure(
    revolve: Revolve,
    state: np.ndarray,
    lift: Lift,
    most: int | None = None,
    *,
    position: float = SETTLED_POSITION,
    decay: float = np.inf,
) -> Measured:
    """As `settle`, but each revolution is measured as it comes, and only it and the next one are kept."""
    state, revolutions, periodic, faded = _stood(revolve, state, most, position, decay)
    before, rows = _finite(revolve(state)), []
    for _ in range(MEASURED if periodic else APERIODIC):
        after = _finite(revolve(end_state(before)))
        rows.append(measure(joined([before, after]), lift))
        before = after
    figures = Figures({name: np.concatenate([row[name] for row in rows]) for name in rows[0]})
    return Measured(figures, end_state(before), revolutions, periodic, faded)


def _stood(
    revolve: Revolve, state: np.ndarray, most: int | None, position: float, decay: float
) -> tuple[np.ndarray, int, bool, bool]:
    """The state where the motion stands or is given up, the revolutions until there, whether it is periodic, and
    whether the slowest mode had the revolutions that it needs to die out."""
    needed = revolutions_needed(decay)
    slow = needed > PLAIN_REVOLUTIONS
    stands = _Stands(position, way_left(decay))
    state, revolutions, periodic = _run(revolve, state, PLAIN_REVOLUTIONS if most is None else most, stands)
    if slow and most is None and not periodic:
        state, hastened = _hastened(revolve, state)
        state, more, periodic = _run(revolve, state, min(needed, MOST_REVOLUTIONS) - PLAIN_REVOLUTIONS, stands)
        revolutions += hastened + more
    faded = periodic or not slow or (most is None and needed <= MOST_REVOLUTIONS)
    return state, revolutions, periodic, faded


@dataclass(frozen=True)
class _Stands:
    """Whether the change still to come, `left` times the last change over a revolution, is within `position` [m]."""

    position: float
    left: float

    def __call__(self, change: State, memories: int) -> bool:
        velocity = SETTLED_VELOCITY * self.position / SETTLED_POSITION
        x, v, z = _split(self.left * np.abs(change), memories)
        return bool(np.max(x) < self.position and np.max(v) < velocity and np.max(z, initial=0.0) < self.position)


def _run(revolve: Revolve, state: State, most: int, stands: _Stands) -> tuple[State, int, bool]:
    """Runs at most `most` revolutions until the state stands: (state, number of revolutions, whether it stands)."""
    for revolution in range(1, most + 1):
        before = state
        state, memories = _turned(revolve, state)
        if stands(state - before, memories):
            return state, revolution, True
    return state, most, False


def _turned(revolve: Revolve, state: State) -> tuple[State, int]:
    """The state a revolution later, which is in bounds, and how many memories stand at its end.

    They are those of the train, which a method with `advance` tells itself and all others in their response.
    """
    if hasattr(revolve, "advance"):
        after, train = next_state(revolve, state), getattr(revolve, "train", None)
    else:
        response = revolve(state)
        after, train = end_state(response), response.train
    memories = 0 if train is None else len(train.memory)
    return _bounded(after, memories), memories


def _split(state: State, memories: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions (n), velocities (n) and memories (r) of a state."""
    n = (len(state) - memories) // 2
    return state[:n], state[n : 2 * n], state[2 * n :]


def _hastened(revolve: Revolve, state: State) -> tuple[State, int]:
    """A state nearer to the periodic motion of a lightly damped train, and the revolutions it took to find.

    Only a stable periodic motion is taken. Whether the motion then stands is decided by plain revolutions from there.
    """
    try:
        found = periodic_state(revolve, state, memories=_turned(revolve, state)[1])
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
    """Number of e-folds by which the slowest of a train's modes and leaks decays over a revolution at `cam_speed`
    [rad/s]."""
    return slowest_rate(train) * 2 * np.pi / cam_speed


def first_revolution(revolve: Revolve, state: State) -> Settled:
    """The revolution that begins in `state`, measured without settling first.

    It serves to compare methods; a cam is judged by its settled motion.

    Raises MotionRefused where the motion has no bound.
    """
    first = _finite(revolve(state))
    return Settled(joined([first, _finite(revolve(end_state(first)))]), 0, True)


def _bounded(state: State, memories: int) -> State:
    """The state, unless it has left all bounds."""
    if not np.all(np.isfinite(state)) or np.abs(_split(state, memories)[0]).max() > UNBOUND:
        raise MotionRefused("the motion has no bound: the step is past the method's stability limit; take more steps")
    return state


def _finite(response: Response) -> Response:
    """The response, unless it has left all bounds on the way or at its end."""
    _bounded(end_state(response), len(response.train.memory))
    _bounded(np.abs(response.x).max(axis=0).repeat(2), 0)
    return response
