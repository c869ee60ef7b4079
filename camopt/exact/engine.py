"""Event-exact motion of a train with piecewise affine laws: switchings are located to round-off, at any step size.

This is the papers' transition matrix method with three changes: the matrix exponential is exact, the lift enters by its
exact polynomial pieces, and each switching of a contact is located inside the step, as a root of the power series of
the force that decides it.
"""

from contextlib import AbstractContextManager

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.affine.inputs import Inputs
from camopt.exact.kernel.arrays import CamArrays, cam_arrays
from camopt.exact.kernel.elements import element_forces
from camopt.exact.kernel.propagators import Propagators, default_step, propagators
from camopt.exact.kernel.revolution import CHATTER, DONE, MOST_SWITCHINGS, Setting, follow
from camopt.exact.kernel.trace import NO_TRACE, Trace, rows_of
from camopt.scene.errors import MotionRefused
from camopt.scene.response import Response
from camopt.scene.shapes import State
from camopt.scene.train import Train

AT_ONCE = 8
"""Number of steps in a span if no samples are requested."""
LONGEST_SPAN = 12
"""Largest number of steps in a span if spans are to end on the borders of the lift's pieces."""
MOST_AT_ONCE = 8
"""Largest number of steps between two samples."""
FEWEST_STEPS = 360
"""Smallest number of steps per revolution, however slow the train's modes are."""


class EventExact:
    """One event-exact revolution as a function of its start state (2n + r), with `advance` for the end state alone.

    `cam_speed` is in rad/s. `steps_per_revolution` is the number of samples and does not affect the accuracy: between
    two samples, switchings are searched for in steps that are short enough for the highest mode. By default the motion
    is sampled at these steps. The default step [s] is the same at most speeds, which then share one set of tables.
    """

    def __init__(self, train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int | None = None):
        self.train, self.lift, self.cam_speed = train, lift, cam_speed
        self.period = 2 * np.pi / cam_speed
        self.step, self._per_sample = _step_between_samples(train, self.period, steps_per_revolution)
        self._cam = cam_arrays(Inputs(train.forcing, lift.borders), lift, cam_speed)

    def __call__(self, state: State) -> Response:
        """One revolution from -pi to pi from a state ([m], [m/s], [m]), sampled at the requested steps, at both sides
        of every switching, and at borders of the lift. Raises MotionRefused like `advance`."""
        n, at = len(self.train.mass), self.train.state_size
        with self._lent(self._per_sample) as lent:
            trace = run(lent, self._cam, self.lift, np.array(state, dtype=float), regular=True)[1]
            ends = np.repeat(np.arange(len(trace.angle)), 1 + np.concatenate([[0], trace.watch[:-1] >= 0, [0]]))
            segment = np.maximum(ends - 1, 0) + np.append(0, ends[1:] == ends[:-1])
            rows, force = trace.y[ends, : at + 2], np.empty((len(ends), len(self.train.a)))
            rows[:, at + 1] /= lent.step  # the lift's velocity
            element_forces(lent.arrays, lent.tables.pieces, trace.slot[segment], rows, force)
            angle = trace.angle[ends]
        angle[-1] = np.pi
        x, v, z, lift, _ = np.split(rows, [n, 2 * n, at, at + 1], axis=1)
        return Response(self.train, self.cam_speed, angle, lift[:, 0], x, v, force, z)

    def advance(self, state: State, revolutions: int = 1) -> State:
        """State after whole revolutions from a state at -pi; several times faster than a sampled motion.

        Raises MotionRefused for too many switchings or an unbounded motion.
        """
        after = np.array(state, dtype=float)
        with self._lent(AT_ONCE) as lent:
            run(lent, self._cam, self.lift, after, revolutions, traced=False)
        return after

    def _lent(self, at_once: int) -> AbstractContextManager[Propagators]:
        return propagators(self.train, self.step, self.lift.coefficients.shape[1], at_once).lent()


prepare = EventExact


def run(
    lent: Propagators,
    cam: CamArrays,
    lift: Lift,
    state: np.ndarray,
    revolutions: int = 1,
    traced: bool = True,
    regular: bool = False,
) -> tuple[Setting, Trace]:
    """Simulate whole revolutions from `state` (2n + r) at -pi, which is overwritten by the end state.

    Returns the setting and the trace, whose arrays are views of the thread's buffer and valid until its next motion.
    `regular` has the meaning that it has in `revolve`. If the tables or the trace are full, they are enlarged. Raises
    MotionRefused for too many switchings or an unbounded motion.
    """
    begin, starts = state.copy(), np.zeros(revolutions + 1, dtype=np.int64)
    while True:
        state[:] = begin
        trace = lent.trace(revolutions) if traced else NO_TRACE
        setting = Setting(lent.arrays, cam, lent.step, lent.tables, lift.half_duration, lift.opening_foot)
        code, switchings = follow(setting, state, starts, regular, trace)
        if code == DONE:
            return setting, rows_of(trace, 0, starts[-1])
        if code < 0:
            chatter = f"contacts switch more than {MOST_SWITCHINGS} times"
            raise MotionRefused(
                f"event-exact at {cam.speed * 30 / np.pi:g} cam r/min: "
                f"{chatter if code == CHATTER else 'the motion has no bound'} in one revolution "
                f"({switchings} switchings): give the contacts damping, or check masses and stiffnesses"
            )
        lent.grow(code)


def free_step(train: Train, cam_speed: float) -> float:
    """Step [s] if the caller does not prescribe it: the default step, halved until a revolution has FEWEST_STEPS.

    Most speeds then share one step and thereby one set of tables.
    """
    step = default_step(train)
    return step / 2.0 ** max(0, int(np.ceil(np.log2(step * FEWEST_STEPS * cam_speed / (2 * np.pi)))))


def step_on_borders(train: Train, cam_speed: float, spacing: float) -> tuple[float, int]:
    """(step [s], steps per span) for which spans end on every border of the lift's pieces, `spacing` [rad] apart."""
    steps = int(np.ceil(spacing / cam_speed / default_step(train) * (1 - 1e-12)))
    at_once = -(-steps // -(-steps // LONGEST_SPAN))
    return spacing / cam_speed / (-(-steps // at_once) * at_once), at_once


def _step_between_samples(train: Train, period: float, steps_per_revolution: int | None) -> tuple[float, int]:
    """(step [s], steps per sample): the default step or a finer one, so that a whole number fits between samples."""
    default = free_step(train, 2 * np.pi / period)
    if steps_per_revolution is None:
        return default, 1
    steps = max(1, int(np.ceil(period / steps_per_revolution / default * (1 - 1e-12))))
    finer = -(-steps // MOST_AT_ONCE)  # additional samples, if one span does not reach the next sample
    per_sample = -(-steps // finer)
    return period / steps_per_revolution / (finer * per_sample), per_sample
