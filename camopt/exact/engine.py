"""Event-exact motion of a train, its laws affine in pieces: switchings located to round-off, no stability limit.

This is the papers' transition matrix method with three changes: the matrix exponential is exact, the lift enters as its
exact polynomial pieces, and each switching of a contact is located inside the step, on the power series of the force
that is watched.
"""

from contextlib import AbstractContextManager
from threading import local

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.affine.inputs import Inputs
from camopt.exact.kernel.arrays import CamArrays, cam_arrays
from camopt.exact.kernel.propagators import Propagators, default_step, propagators
from camopt.exact.kernel.revolution import CHATTER, DONE, TABLES_FULL, TRACE_FULL, follow
from camopt.exact.kernel.tables import Tables
from camopt.exact.kernel.trace import NO_TRACE, Trace, empty_trace
from camopt.scene.errors import MotionRefused
from camopt.scene.response import Response
from camopt.scene.shapes import State
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
FIRST_SEGMENTS = 1024
"""Number of segments per revolution for which a trace has room at first."""
NO_ROWS = np.empty((0, 0))
"""Those of a motion that is not sampled."""


class EventExact:
    """Event-exact motion at one speed: a call gives one sampled revolution, `advance` only the state at its end."""

    def __init__(self, train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int | None = None):
        self.train, self.lift, self.cam_speed = train, lift, cam_speed
        self.period = 2 * np.pi / cam_speed
        self.step, self._per_sample = _step(train, self.period, steps_per_revolution)
        self._cam = cam_arrays(Inputs(train.forcing, lift.borders), lift, cam_speed)
        self._rows: np.ndarray | None = None

    def __call__(self, state: State) -> Response:
        """One revolution from -pi to pi from a state ([m], [m/s], [m]), sampled at the requested steps, at every
        switching and at every piece border. Raises MotionRefused for endless switching or a motion without bound."""
        n, at, e = len(self.train.mass), self.train.state_size, len(self.train.a)
        if self._rows is None:
            samples = int(self.period / self.step) + len(self._cam.borders) + 2 * MOST_SWITCHINGS + 16
            self._rows = np.empty((samples, at + 2 + e + 2))
        with self._lent(self._per_sample) as lent:
            count = run(lent, self._cam, np.array(state, dtype=float), rows=self._rows)[0]
        done = self._rows[:count].copy()
        angle = done[:, -2] * self.cam_speed - np.pi
        angle[-1] = np.pi
        x, v, z = done[:, :n], done[:, n : 2 * n], done[:, 2 * n : at]
        return Response(self.train, self.cam_speed, angle, done[:, at], x, v, done[:, at + 2 : -2], z)

    def advance(self, state: State, revolutions: int = 1) -> State:
        """State after whole revolutions from a state at -pi; several times faster than a sampled motion.

        Raises MotionRefused for endless switching or a motion without bound.
        """
        after = np.array(state, dtype=float)
        with self._lent(AT_ONCE) as lent:
            run(lent, self._cam, after, revolutions)
        return after

    def _lent(self, at_once: int) -> AbstractContextManager[Propagators]:
        return propagators(self.train, self.step, self.lift.coefficients.shape[1], at_once).lent()


class TraceBuffer(local):
    """Room for the traces of each thread's motions, one after the other; it grows fourfold where a motion needs more.

    New room costs as much as a short motion, because the system has to clear it.
    """

    def __init__(self) -> None:
        self._segments, self._trace = FIRST_SEGMENTS, NO_TRACE

    def trace(self, tables: Tables, revolutions: int) -> Trace:
        """The trace of a motion of so many revolutions that uses these tables; what it held before is overwritten."""
        self._segments = max(self._segments, FIRST_SEGMENTS * revolutions)
        width, looks = tables.steps.shape[3], tables.span.shape[2] - tables.steps.shape[3]
        kept = self._trace
        if (len(kept.length), kept.y.shape[1], kept.looks.shape[1]) != (self._segments, width, looks):
            self._trace = empty_trace(self._segments, width, looks)
        return self._trace

    def grow(self) -> None:
        """Makes room for four times as many segments."""
        self._segments *= 4


def run(
    lent: Propagators,
    cam: CamArrays,
    state: np.ndarray,
    revolutions: int = 1,
    rows: np.ndarray = NO_ROWS,
    buffer: TraceBuffer | None = None,
) -> tuple[int, Trace]:
    """Runs whole revolutions from `state` (2n + r) at -pi, which is changed in place to the end.

    Returns (number of segments in the trace, the trace in the `buffer`) or, without a buffer, (number of samples in
    `rows`, no trace). Where there is no room for more tables, or in the buffer, it grows. Raises MotionRefused for
    endless switching or a motion without bound.
    """
    start = state.copy()
    while True:
        state[:] = start
        trace = NO_TRACE if buffer is None else buffer.trace(lent.tables, revolutions)
        code, count, switchings = follow(
            lent.arrays, cam, lent.step, lent.tables, state, revolutions, MOST_SWITCHINGS, rows, trace
        )
        if code == DONE:
            return count, trace
        if code == TABLES_FULL:
            lent.grow()
        elif code == TRACE_FULL and buffer is not None:
            buffer.grow()
        else:
            raise refusal(code, cam.speed, switchings)


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
    finer = -(-wanted // MOST_AT_ONCE)  # more samples than asked for, where a span of steps does not reach the next
    per_sample = -(-wanted // finer)
    return period / steps_per_revolution / (finer * per_sample), per_sample
