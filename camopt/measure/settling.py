"""Settling of a motion to the periodic one, and measurement of the revolutions that follow."""

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
    revolutions: int  # simulated before the measured ones
    periodic: bool
    faded: bool = True  # whether there were enough revolutions for the train's slowest mode to decay

    def __repr__(self) -> str:
        return f"Settled({'periodic' if self.periodic else 'aperiodic'} after {self.revolutions} revolutions)"

    def metrics(self, lift: Lift) -> "Figures":
        """The metrics of the measured revolutions."""
        return Figures(measure(self.response, lift))


@dataclass(frozen=True, repr=False)
class Measured:
    """The metrics of a settled motion without its record, which at the verifier's finest step is hundreds of megabytes.

    The other fields are those of `Settled`; `state` (2n + r) is the final state.
    """

    figures: "Figures"
    state: np.ndarray
    revolutions: int
    periodic: bool
    faded: bool = True


@dataclass(frozen=True)
class Figures:
    """Metrics of every measured revolution, in the units of their names."""

    by_revolution: dict[str, Float[np.ndarray, " revolutions"]]

    @property
    def revolutions(self) -> int:
        """Number of measured revolutions."""
        return len(next(iter(self.by_revolution.values())))

    def worst(self, name: str) -> float:
        """The worst revolution's value; NaN if the valve did not seat in one of them."""
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
    """Simulate revolutions from `state` until the motion has settled, and then the revolutions to be measured.

    The motion has settled once the remaining change is at most `position` [m] in every position and memory, and at most
    SETTLED_VELOCITY, scaled in the same proportion, in every velocity, and once the difference of states a revolution
    apart decreases (`camopt.scene.settled.shrinks`). The remaining change is estimated from `decay`, the train's
    `decay_per_revolution` (`camopt.scene.settled.way_left`). If the measured revolutions contradict the result, settled
    or not, the simulation continues after them; with fewer than MEASURED of them, the last change decides.

    The motion is simulated for at most `most` revolutions, by default PLAIN_REVOLUTIONS, and for more only while it
    stays within the tolerances, at most WATCHED. If the train's slowest mode needs more, a direct search for the
    periodic motion follows, and then as many revolutions as the mode needs. A motion that has not settled by then is
    reported as aperiodic and measured over `aperiodic` revolutions instead of `measured`. Raises MotionRefused if the
    motion is unbounded because the step is beyond the method's stability limit.
    """
    motion = _Settling(revolve, state, most, position, decay)
    responses, periodic = motion.run(list, measured, aperiodic)
    return Settled(joined(responses), motion.revolutions, periodic, periodic or motion.faded)


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
    """Like `settle`, but every revolution is measured immediately, and only it and the next one are held in memory."""

    def metrics(responses: Iterator[Response]) -> list[dict[str, np.ndarray]]:
        return [measure_first(response, after, lift) for response, after in pairwise(responses)]

    motion = _Settling(revolve, state, most, position, decay)
    rows, periodic = motion.run(metrics, MEASURED, aperiodic)
    figures = Figures({name: np.concatenate([row[name] for row in rows]) for name in rows[0]})
    return Measured(figures, motion.state, motion.revolutions, periodic, periodic or motion.faded)


class _Settling:
    """The settling of one motion: its current state, and the differences of its last states a revolution apart."""

    def __init__(self, revolve: Revolve, state: State, most: int | None, position: float, decay: float):
        self._revolve, self.state, self._position = revolve, state, position
        self._left, self._needed = way_left(decay), revolutions_needed(decay)
        self.faded = self._needed <= PLAIN_REVOLUTIONS  # whether the slowest mode had enough revolutions to decay
        self._searches = not self.faded and most is None
        self._most = PLAIN_REVOLUTIONS if most is None else most
        self.revolutions = self._memories = 0
        self._within = 0  # number of latest consecutive revolutions whose change is within the tolerances
        self._largest = self._start = 0.0  # size of the largest of these changes, and of the one before measuring
        self._distances = 0.0, 0.0  # sizes of the last two changes relative to the tolerances

    def run(self, read: Callable[[Iterator[Response]], list], measured: int, aperiodic: int) -> tuple[list, bool]:
        """Settle and `read` the revolutions to be measured and one more; returns the result and whether it is periodic.

        If the measured revolutions contradict that, settling continues after them.
        """
        while True:
            periodic = self._settle()
            turns = (measured if periodic else aperiodic) + 1
            result = read(self._revolutions(turns))
            if measured < MEASURED or not self._contradicted(periodic, turns):
                return result, periodic

    def _settle(self) -> bool:
        """Simulate until the remaining change is within the tolerances; False if the motion does not settle."""
        while goes_on(self.revolutions, self._most, self._within):
            after, self._memories = _next_state(self._revolve, self.state)
            self.revolutions += 1
            if self._accept(after, self._memories):
                return True
        if not self._searches:
            return False
        self._searches, self.faded, self._within = False, self._needed <= MOST_REVOLUTIONS, 0
        with suppress(MotionRefused):  # plain revolutions from there decide whether the motion is periodic
            solution = periodic_state(self._revolve, self.state, memories=self._memories)
            self.state, self.revolutions = solution.state, self.revolutions + solution.revolutions
        self._most = self.revolutions + min(self._needed, MOST_REVOLUTIONS) - PLAIN_REVOLUTIONS
        return self._settle()

    def _revolutions(self, turns: int) -> Iterator[Response]:
        """Simulate and yield the next revolutions, one after the other."""
        self._start = self._distances[1]
        for _ in range(turns):
            response = within_bound(self._revolve(self.state))
            self._accept(end_state(response), len(response.train.memory))
            yield response

    def _contradicted(self, periodic: bool, turns: int) -> bool:
        """Whether the measured revolutions contradict `periodic`, so that the simulation must continue."""
        start = self._start if periodic else 0.0
        settles = shrinks(self._largest, start, *self._distances, self._within - 2)
        wrong = not settles if periodic else goes_back(settles, self.revolutions - self._most, self._within)
        self.revolutions += turns if wrong else 0
        return wrong

    def _accept(self, after: State, memories: int) -> bool:
        """Move on to the state a revolution later; returns whether the remaining change is within the tolerances."""
        velocity = SETTLED_VELOCITY * self._position / SETTLED_POSITION
        x, v, z = _split(np.abs(after - self.state), memories)
        distance = float(max(np.max(x) / self._position, np.max(v) / velocity, np.max(z, initial=0.0) / self._position))
        within = self._left * distance < 1.0
        self.state, self._within = after, self._within + 1 if within else 0
        self._largest = max(self._largest, distance) if within else 0.0
        self._distances = self._distances[1], distance
        return within


def _next_state(revolve: Revolve, state: State) -> tuple[State, int]:
    """The state a revolution later, checked for bounds, and the number of memories at its end."""
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
    """The settled motion of a method from rest on the base circle, as used by verdicts, sweeps and figures.

    `prepare` is that of the method, `cam_speed` is in rad/s, and `steps` are its steps per revolution if it needs them.
    """
    rest = state_at_rest(train)
    return settle(prepare(train, lift, cam_speed, *steps), rest, decay=decay_per_revolution(train, cam_speed))


def decay_per_revolution(train: Train, cam_speed: float) -> float:
    """Number of e-folds of the decay of a train's slowest mode or leak over one revolution at `cam_speed` [rad/s]."""
    return slowest_rate(train) * 2 * np.pi / cam_speed


def first_revolution(revolve: Revolve, state: State) -> Settled:
    """The revolution that begins in `state`, measured without settling. Raises MotionRefused if it is unbounded."""
    return Settled(record_of(lambda begin: within_bound(revolve(begin)), state, 2), 0, True)


def _bounded(state: State, memories: int) -> State:
    """The state. Raises MotionRefused if it is not finite or a position exceeds UNBOUND."""
    if not np.all(np.isfinite(state)) or np.abs(_split(state, memories)[0]).max() > UNBOUND:
        raise MotionRefused("the motion has no bound: the step is above the method's stability limit; take more steps")
    return state


def within_bound(response: Response) -> Response:
    """The response. Raises MotionRefused if it is unbounded at any sample or at its end."""
    _bounded(end_state(response), len(response.train.memory))
    _bounded(np.tile([response.x.min(), response.x.max()], 2), 0)
    return response
