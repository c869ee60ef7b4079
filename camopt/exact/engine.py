"""Event-exact motion of a train, its laws affine in pieces: switchings located to round-off, no stability limit.

This is the papers' transition matrix method with three changes: the matrix exponential is exact, the lift enters as its
exact polynomial pieces, and each switching of a contact is located inside the step, on the power series of the force
that is watched.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.affine.inputs import Inputs
from camopt.exact.kernel.arrays import cam_arrays, train_arrays
from camopt.exact.kernel.propagators import Propagators, default_step, propagators
from camopt.exact.kernel.revolution import CHATTER, DONE, NEED_TABLES, revolve
from camopt.exact.kernel.trace import empty_trace
from camopt.scene.errors import MotionRefused
from camopt.scene.response import Response
from camopt.scene.shapes import Float, State
from camopt.scene.train import Train

MOST_SWITCHINGS = 20_000
"""A motion with more contact switchings than this in one revolution is refused as chatter."""
AT_ONCE = 8
"""Number of steps that one span takes where no samples are wanted."""
LONGEST_SPAN = 12
"""Largest number of steps in a span, where spans are to end on the borders of the lift's pieces."""
MOST_AT_ONCE = 8
"""Largest number of steps between two samples."""
FEWEST_STEPS = 360
"""A revolution is divided into at least this many steps, however slow the train's modes are."""
NO_TRACE = empty_trace(0, 0, 0)


class EventExact:
    """Event-exact motion at one speed: a call gives one sampled revolution, `advance` only the state at its end."""

    def __init__(self, train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int | None = None):
        self._arrays = train_arrays(train)
        self.train, self.lift, self.cam_speed = train, lift, cam_speed
        self.period = 2 * np.pi / cam_speed
        self.step, self._per_sample = _step(train, self.period, steps_per_revolution)
        self._cam = cam_arrays(Inputs(train.forcing, lift.borders), lift, cam_speed)
        self._rows: np.ndarray | None = None

    def __call__(self, state: State) -> Response:
        """One revolution from -pi to pi from a state ([m], [m/s], [m]), sampled as asked and at every
        switching and piece border. Raises MotionRefused for endless switching or a motion without bound."""
        n, at, e = len(self.train.mass), self.train.state_size, len(self.train.a)
        if self._rows is None:
            samples = int(self.period / self.step) + len(self._cam.borders) + 2 * MOST_SWITCHINGS + 16
            self._rows = np.empty((samples, at + 2 + e + 2))
        count, _ = self._revolve(np.array(state, dtype=float), self._rows, self._tables(self._per_sample))
        done = self._rows[:count].copy()
        angle = done[:, -2] * self.cam_speed - np.pi
        angle[-1] = np.pi
        x, v, z = done[:, :n], done[:, n : 2 * n], done[:, 2 * n : at]
        return Response(self.train, self.cam_speed, angle, done[:, at], x, v, done[:, at + 2 : -2], z)

    def advance(self, state: State, revolutions: int = 1) -> State:
        """State after whole revolutions from a state at -pi; several times faster than a sampled motion.

        Raises MotionRefused for endless switching or a motion without bound.
        """
        after, tables = np.array(state, dtype=float), self._tables(AT_ONCE)
        nothing = np.empty((0, 0))
        for _ in range(revolutions):
            self._revolve(after, nothing, tables)
        return after

    def _tables(self, at_once: int) -> Propagators:
        return propagators(self.train, self.step, self.lift.coefficients.shape[1], at_once)

    def _revolve(self, state: np.ndarray, rows: np.ndarray, tables: Propagators) -> tuple[int, int]:
        """Runs one revolution, which changes `state` in place; returns (number of samples, number of switchings)."""
        code, start = NEED_TABLES, state.copy()
        while code == NEED_TABLES:
            state[:] = start
            code, count, switchings = revolve(
                self._arrays, self._cam, self.step, tables.built, state, rows, NO_TRACE, MOST_SWITCHINGS
            )
            if code == NEED_TABLES:
                tables.build(count)
        if code != DONE:
            raise refusal(code, self.cam_speed, switchings)
        return count, switchings


def refusal(code: int, cam_speed: float, switchings: int) -> MotionRefused:
    """The sentence for a revolution that the kernel could not finish."""
    chatter = f"contacts switch more than {MOST_SWITCHINGS} times"
    return MotionRefused(
        f"event-exact at {cam_speed * 30 / np.pi:g} cam r/min: "
        f"{chatter if code == CHATTER else 'the motion has no bound'} in one revolution "
        f"({switchings} switchings): give the contacts damping, or check masses and stiffnesses"
    )


def prepare(train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int | None = None) -> EventExact:
    """One event-exact revolution as a function of its start state (2n + r), with `advance` for the end state alone.

    `cam_speed` is in rad/s. `steps_per_revolution` says how often the motion is sampled and does not change its
    accuracy: between two samples, switchings are sought in steps that are short enough for the highest mode. By default
    these steps are the samples too. The default step [s] is the same at all speeds, so that one set of tables serves
    them all.
    """
    return EventExact(train, lift, cam_speed, steps_per_revolution)


def advance_many(
    train: Train,
    lifts: Lift | Sequence[Lift],
    cam_speeds: Sequence[float],
    states: State | Float[np.ndarray, "k two_n"],
    revolutions: int,
    workers: int = 2,
) -> Float[np.ndarray, "k two_n"]:
    """End states of k motions after `revolutions` each, computed side by side in threads.

    `lifts` is one lift or k, `cam_speeds` (k) [rad/s]; `states` is one start for all or k of them. A refused motion
    ends in a row of NaN.
    """
    k = len(cam_speeds)
    cams = [lifts] * k if isinstance(lifts, Lift) else list(lifts)
    starts = np.broadcast_to(states, (k, np.shape(states)[-1]))

    def end(i: int) -> np.ndarray:
        try:
            return prepare(train, cams[i], cam_speeds[i]).advance(starts[i], revolutions)
        except MotionRefused:
            return np.full(starts.shape[1], np.nan)

    with ThreadPoolExecutor(workers) as pool:
        return np.array(list(pool.map(end, range(k))))


def free_step(train: Train, cam_speed: float) -> float:
    """Step [s] where the caller asks for none: the default step, halved until a revolution has enough of them.

    Most speeds then share one step, and with it one set of tables.
    """
    step = default_step(train)
    return step / 2.0 ** max(0, int(np.ceil(np.log2(step * FEWEST_STEPS * cam_speed / (2 * np.pi)))))


def step_on_borders(train: Train, cam_speed: float, spacing: float) -> tuple[float, int]:
    """(step [s], steps per span) with which every border of the lift's pieces, `spacing` [rad] apart, ends a span."""
    steps = int(np.ceil(spacing / cam_speed / default_step(train) * (1 - 1e-12)))
    at_once = -(-steps // -(-steps // LONGEST_SPAN))
    return spacing / cam_speed / (-(-steps // at_once) * at_once), at_once


def _step(train: Train, period: float, steps_per_revolution: int | None) -> tuple[float, int]:
    """(step [s], steps per sample): the default step or a finer one, a whole number of which fits between samples."""
    default = free_step(train, 2 * np.pi / period)
    if steps_per_revolution is None:
        return default, 1
    wanted = max(1, int(np.ceil(period / steps_per_revolution / default * (1 - 1e-12))))
    finer = -(-wanted // MOST_AT_ONCE)  # more samples than asked, where a whole span of steps does not reach the next
    per_sample = -(-wanted // finer)
    return period / steps_per_revolution / (finer * per_sample), per_sample
