"""Settling to the periodic motion, and the revolutions that are measured."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.metrics import measure, measure_first
from camopt.measure.periodic import periodic_state
from camopt.scene.errors import MotionRefused
from camopt.scene.quantities import LESS_IS_WORSE
from camopt.scene.response import Response, Revolve, end_state, joined, next_state, record_of
from camopt.scene.rest import state_at_rest
from camopt.scene.settled import (
    APERIODIC,
    MEASURED,
    MOST_REVOLUTIONS,
    PLAIN_REVOLUTIONS,
    SETTLED_POSITION,
    SETTLED_VELOCITY,
    UNBOUND,
    goes_back,
    goes_on,
    revolutions_needed,
    shrinks,
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

    All else as of `Settled`; `state` (2n + r) is the one at the end.
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

    @property
    def revolutions(self) -> int:
        """How many revolutions were measured."""
        return len(next(iter(self.by_revolution.values())))

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
    memory, and in every velocity SETTLED_VELOCITY in the same proportion, and the distance of states a revolution apart
    is seen to shrink (`camopt.scene.settled.shrinks`). The change to come follows from `decay`, that of
    `decay_per_revolution` for the train (`camopt.scene.settled.way_left`). Where the revolutions that are measured do
    not show that the motion settles, or that it wanders, it goes on after them. Fewer than MEASURED of them show
    nothing, and the last change decides.

    It runs for at most `most` revolutions, by default PLAIN_REVOLUTIONS, and for more only while it stays within the
    tolerances, WATCHED at most. Where the train's slowest mode needs more, a search for the periodic motion follows,
    and then as many revolutions as the mode needs. A motion that has not settled by then wanders. It is reported as
    aperiodic and measured over `aperiodic` revolutions instead of `measured`. Raises MotionRefused where the motion has
    no bound, because the step is above the method's stability limit.
    """
    way = _Way(revolve, state, most, position, decay)
    while True:
        periodic = way.stands()
        responses = list(way.measured((measured if periodic else aperiodic) + 1))
        if measured < MEASURED or not way.goes_on(periodic, len(responses)):
            return Settled(joined(responses), way.revolutions, periodic, periodic or way.faded)


def settle_and_measure(
    revolve: Revolve,
    state: np.ndarray,
    lift: Lift,
    most: int | None = None,
    *,
    aperiodic: int = APERIODIC,
    position: float = SETTLED_POSITION,
    decay: float = np.inf,
) -> Measured:
    """As `settle`, but each revolution is measured as it comes, and only it and the next one are kept."""
    way = _Way(revolve, state, most, position, decay)
    while True:
        periodic = way.stands()
        turns = (MEASURED if periodic else aperiodic) + 1
        rows = [measure_first(one, after, lift) for one, after in pairwise(way.measured(turns))]
        if not way.goes_on(periodic, len(rows) + 1):
            figures = Figures({name: np.concatenate([row[name] for row in rows]) for name in rows[0]})
            return Measured(figures, way.state, way.revolutions, periodic, periodic or way.faded)


class _Way:
    """A motion's way to the periodic one: where it is, and the distances of its last states a revolution apart."""

    def __init__(self, revolve: Revolve, state: State, most: int | None, position: float, decay: float):
        self._revolve, self.state, self._position = revolve, state, position
        self._left, self._needed = way_left(decay), revolutions_needed(decay)
        self.faded = self._needed <= PLAIN_REVOLUTIONS  # whether the slowest mode had the revolutions to die out
        self._searches = not self.faded and most is None
        self._most = PLAIN_REVOLUTIONS if most is None else most
        self.revolutions = self._memories = 0
        self._within = 0  # the last of the revolutions whose change is within the tolerances
        self._largest = self._start = 0.0  # distance of the largest of these changes, and that before measuring
        self._distances = 0.0, 0.0  # of the last two changes, in the tolerances

    def stands(self) -> bool:
        """Runs revolutions until the change still to come is within the tolerances; False where the motion wanders."""
        while goes_on(self.revolutions, self._most, self._within):
            after, self._memories = _turned(self._revolve, self.state)
            self.revolutions += 1
            if self._note(after, self._memories):
                return True
        if not self._searches:
            return False
        self._searches, self.faded, self._within = False, self._needed <= MOST_REVOLUTIONS, 0
        with suppress(MotionRefused):  # whether the motion stands is decided by plain revolutions from there
            found = periodic_state(self._revolve, self.state, memories=self._memories)
            self.state, self.revolutions = found.state, self.revolutions + found.revolutions
        self._most = self.revolutions + min(self._needed, MOST_REVOLUTIONS) - PLAIN_REVOLUTIONS
        return self.stands()

    def measured(self, turns: int) -> Iterator[Response]:
        """The next revolutions, one after the other."""
        self._start = self._distances[1]
        for _ in range(turns):
            response = within_bound(self._revolve(self.state))
            self._note(end_state(response), len(response.train.memory))
            yield response

    def goes_on(self, periodic: bool, turns: int) -> bool:
        """Whether the last revolutions, which were measured, show that the motion is not what it was taken for."""
        start = self._start if periodic else 0.0
        settles = shrinks(self._largest, start, *self._distances, self._within - 2)
        wrong = not settles if periodic else goes_back(settles, self.revolutions - self._most, self._within)
        self.revolutions += turns if wrong else 0
        return wrong

    def _note(self, after: State, memories: int) -> bool:
        """Takes the state a revolution later; whether the change that is still to come is within the tolerances."""
        velocity = SETTLED_VELOCITY * self._position / SETTLED_POSITION
        x, v, z = _split(np.abs(after - self.state), memories)
        distance = float(max(np.max(x) / self._position, np.max(v) / velocity, np.max(z, initial=0.0) / self._position))
        within = self._left * distance < 1.0
        self.state, self._within = after, self._within + 1 if within else 0
        self._largest = max(self._largest, distance) if within else 0.0
        self._distances = self._distances[1], distance
        return within


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
    """The revolution that begins in `state`, measured without settling first. Raises MotionRefused where it
    has no bound."""
    return Settled(record_of(lambda begin: within_bound(revolve(begin)), state, 2), 0, True)


def _bounded(state: State, memories: int) -> State:
    """The state, unless it has left all bounds."""
    if not np.all(np.isfinite(state)) or np.abs(_split(state, memories)[0]).max() > UNBOUND:
        raise MotionRefused("the motion has no bound: the step is above the method's stability limit; take more steps")
    return state


def within_bound(response: Response) -> Response:
    """The response. Raises MotionRefused where it has left all bounds on the way or at its end."""
    _bounded(end_state(response), len(response.train.memory))
    _bounded(np.tile([response.x.min(), response.x.max()], 2), 0)
    return response
