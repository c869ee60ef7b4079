"""A traced motion: recorded event-exact revolutions, whose metrics can be differentiated."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.adjoint.metrics import METRICS, closings_margin, collect, evaluate, sample
from camopt.exact.adjoint.seeds import empty_seeds
from camopt.exact.adjoint.slopes import ByTrain as ByTrain
from camopt.exact.adjoint.slopes import Slopes as Slopes
from camopt.exact.adjoint.slopes import by_train, room_for_bars
from camopt.exact.adjoint.sweep import Bars, sweep
from camopt.exact.affine.inputs import Inputs
from camopt.exact.affine.lines import rest_of
from camopt.exact.engine import AT_ONCE, free_step, run, step_on_borders
from camopt.exact.kernel.arrays import cam_arrays, train_arrays
from camopt.exact.kernel.elements import classify
from camopt.exact.kernel.propagators import propagators
from camopt.exact.kernel.trace import Trace
from camopt.scene.errors import InputError
from camopt.scene.shapes import Float, State
from camopt.scene.train import Train

OBSERVATIONS = 5
"""Largest number of observations of one metric, including the one that is added where it has no gradient."""
WINDOW_STEP = 1e-6
"""Step [rad] of the central difference by half the duration: its errors are less than 1e-8 of a metric."""


@dataclass(frozen=True)
class Grazing:
    """Distance of the motion from one in which a damped contact closes once more or once less.

    At such a motion a gradient is one-sided. A distance is infinite if there is no such closing or separation.
    """

    approach_m_per_s: float  # speed of the slowest closing
    gap_m: float  # smallest local minimum of an open contact's separation


@dataclass(frozen=True)
class Gradient(Slopes):
    """Values (l) of metrics in the units of their names, and their gradients with respect to SI quantities.

    Many metrics are extremes, and `runner_up` (l) is the next candidate: the next highest maximum within a thousandth
    of the extreme (for a smallest force the next lowest minimum), or the extreme of the next contact or closing. It is
    -inf (for a smallest force inf) if there is none. If value and runner-up are equal except for rounding, there is no
    gradient, and all its entries are NaN.
    """

    metrics: tuple[str, ...]
    values: Float[np.ndarray, " l"]
    runner_up: Float[np.ndarray, " l"]
    end: State  # state at the end
    grazing: Grazing


@dataclass(frozen=True)
class Samples:
    """A motion at the angles *m: m angles, a single one (no axis), or m angles of l cotangents (two axes)."""

    x: Float[np.ndarray, " *m n"]  # m
    v: Float[np.ndarray, " *m n"]  # m/s
    lift: Float[np.ndarray | np.floating, " *m"]  # m
    lift_rate: Float[np.ndarray | np.floating, " *m"]  # m/s
    force: Float[np.ndarray, " *m e"]  # N
    memory: Float[np.ndarray, " *m r"]  # m


class TracedMotion:
    """Recorded event-exact revolutions from a state at -pi, whose metrics and samples can be differentiated."""

    def __init__(
        self,
        train: Train,
        lift: Lift,
        cam_speed: float,
        start: State,
        revolutions: int = 1,
        mechanical: bool = False,
        spacing: float | None = None,
    ):
        """Simulate the motion from `start` ([m], [m/s], [m]) at -pi; `cam_speed` is in rad/s.

        With `mechanical` there are gradients with respect to the train's parameters too. `spacing` [rad] is the
        distance between the borders of most pieces of the lift. If it is given, each speed has its own tables, whose
        spans end on the borders, which is worthwhile for many cams with the same borders at a few speeds. Raises
        MotionRefused for too many switchings or an unbounded motion.
        """
        self.train, self.lift, self.cam_speed, self.mechanical = train, lift, cam_speed, mechanical
        self.inputs = Inputs(train.forcing, lift.borders)
        cam = cam_arrays(self.inputs, lift, cam_speed)
        step, at_once = (
            (free_step(train, cam_speed), AT_ONCE) if spacing is None else step_on_borders(train, cam_speed, spacing)
        )
        self.end = np.array(start, dtype=float)
        with propagators(train, step, lift.coefficients.shape[1], at_once).lent() as lent:
            self.setting, trace = run(lent, cam, lift, self.end, revolutions)
            self.trace = Trace(*(array.copy() for array in trace))

    def gradient(
        self, metrics: Sequence[str], revolution: int = 0, cotangent: Float[np.ndarray, " l"] | None = None
    ) -> Gradient:
        """Values (l) and gradients of metrics in a revolution, with one backward sweep for each metric.

        With a `cotangent` (l) of the values, a single sweep gives the gradient of their weighted sum, and the first
        axis of the gradients has length 1. Raises InputError for an unknown metric.
        """
        values, slopes = self.swept(metrics, revolution, cotangent)
        grazing = Grazing(*map(float, closings_margin(self.setting, self.trace)))
        return Gradient(
            **vars(slopes),
            metrics=tuple(metrics),
            values=values[:, 0],
            runner_up=values[:, 1],
            end=self.end,
            grazing=grazing,
        )

    def swept(
        self, metrics: Sequence[str], revolution: int = 0, cotangent: Float[np.ndarray, " l"] | None = None
    ) -> tuple[Float[np.ndarray, "l 2"], Slopes]:
        """(values and runners-up, gradients) like `gradient`, without the distance to grazing."""
        numbers, values = metric_numbers(self.train, metrics), np.empty((len(metrics), 2))
        weights = np.ones(len(metrics)) if cotangent is None else np.asarray(cotangent, dtype=float)
        together = [slice(i, i + 1) for i in range(len(metrics))] if cotangent is None else [slice(None)]
        room, seeds = self._room(len(together)), self._seeds(OBSERVATIONS * len(metrics))
        for j, rows in enumerate(together):
            evaluate(self.setting, self.trace, seeds, numbers[rows], weights[rows], revolution, values[rows])
            sweep(self.setting, self.trace, seeds, Bars(*(array[j] for array in room)))
        return values, self._slopes(room)

    def values(
        self, metrics: Sequence[str], revolution: int = 0, half_duration: float | None = None
    ) -> Float[np.ndarray, " l"]:
        """Values of metrics in a revolution. Contacts between cam and valve are evaluated within `half_duration` [rad]
        of the nose, by default that of the cam. Raises InputError for an unknown metric."""
        setting = self.setting if half_duration is None else self.setting._replace(half_duration=half_duration)
        numbers, values = metric_numbers(self.train, metrics), np.empty((len(metrics), 2))
        seeds = self._seeds(OBSERVATIONS * len(metrics))
        evaluate(setting, self.trace, seeds, numbers, np.ones(len(metrics)), revolution, values)
        return values[:, 0]

    def by_half_duration(self, metrics: Sequence[str], revolution: int = 0) -> Float[np.ndarray, " l"]:
        """Derivatives [unit per rad] of metrics with respect to half the duration, within which contacts are evaluated.

        The motion does not depend on it: a central difference of the metrics of this trace suffices.
        """
        half = float(self.lift.half_duration)
        long, short = (self.values(metrics, revolution, half + step) for step in (WINDOW_STEP, -WINDOW_STEP))
        return (long - short) / (2 * WINDOW_STEP)

    def at(self, angles: Float[np.ndarray, " m"]) -> Samples:
        """The motion at m angles [rad] of the trace, which starts at -pi; at a force jump, the force before it."""
        n, at = len(self.train.mass), self.train.state_size
        rows = np.empty((len(angles), at + 2 + len(self.train.a)))
        sample(self.setting, self.trace, *self._instants(angles), rows)
        x, v, z, lift, rate, force = np.split(rows, [n, 2 * n, at, at + 1, at + 2], axis=1)
        return Samples(x, v, lift[:, 0], rate[:, 0], force, z)

    def pull_back(
        self,
        angles: Float[np.ndarray, " m"] | None = None,
        bars: Samples | None = None,
        ends: Float[np.ndarray, "l state"] | None = None,
    ) -> Slopes:
        """Gradients of l numbers from their cotangents, with one backward sweep for each number.

        `bars` are the cotangents of the result of `at` at the m angles [rad], each array with a first axis l; `ends`
        are those of the end state. The angles are held fixed.
        """
        e = len(self.train.a)
        at = np.zeros(0) if angles is None or bars is None else np.asarray(angles)
        count = len(ends) if ends is not None else len(bars.x) if bars is not None else 0
        packed = np.zeros((count, len(at), self.train.state_size + 2 + e))
        if bars is not None:
            rise, rate = np.asarray(bars.lift)[..., None], np.asarray(bars.lift_rate)[..., None]
            packed[:] = np.concatenate([bars.x, bars.v, bars.memory, rise, rate, bars.force], axis=2)
        room, seeds, instants = self._room(count), self._seeds(len(at) * (1 + e)), self._instants(at)
        if ends is not None:
            room.start[:] = ends
        for j in range(count):
            collect(self.setting, self.trace, seeds, *instants, packed[j])
            sweep(self.setting, self.trace, seeds, Bars(*(array[j] for array in room)))
        return self._slopes(room)

    def _instants(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(segment, length [steps]) of each angle; raises InputError for an angle outside the trace."""
        edges = self.trace.angle
        if len(angles) and not (edges[0] - 1e-9 <= np.min(angles) and np.max(angles) <= edges[-1] + 1e-9):
            raise InputError(f"angles must lie between {edges[0]:g} and {edges[-1]:g} rad, where the motion is known")
        k = np.clip(np.searchsorted(edges, angles, "left") - 1, 0, len(self.trace.length) - 1)
        length = (angles - edges[k]) / (self.cam_speed * self.setting.step)
        return k, np.clip(length, 0.0, self.trace.length[k])

    def _seeds(self, observations: int):
        return empty_seeds(len(self.trace.length), observations, self.setting.train)

    def _room(self, sweeps: int) -> Bars:
        return room_for_bars(self.setting.train, self.setting.cam.pieces.shape, sweeps, self.mechanical)

    def _slopes(self, bars: Bars) -> Slopes:
        by_coefficients, by_rows = self.inputs.back(bars.coefficients)
        return Slopes(by_coefficients, bars.start, by_train(self.train, bars, by_rows) if self.mechanical else None)


def metric_numbers(train: Train, metrics: Sequence[str]) -> np.ndarray:
    """The numbers of these metrics in `measure`.

    Raises InputError for an unknown metric or a train without valve, seat or contact between cam and valve.
    """
    unknown = [name for name in metrics if name not in METRICS]
    if unknown:
        raise InputError(f"no exact gradient of {', '.join(unknown)}: choose from {', '.join(METRICS)}")
    if train.seat < 0 or not train.cam_side:
        raise InputError("metrics need a valve on a seat and a contact between cam and valve: name them in the scene")
    return np.array([METRICS.index(name) for name in metrics], dtype=np.int64)


def value_and_gradient(
    train: Train,
    lift: Lift,
    cam_speed: float,
    metrics: Sequence[str],
    start: State | None = None,
    *,
    revolutions: int = 1,
    revolution: int = 0,
    cotangent: Float[np.ndarray, " l"] | None = None,
    mechanical: bool = False,
    spacing: float | None = None,
) -> Gradient:
    """Values of metrics (l) in one revolution of an event-exact motion, and their gradients.

    The motion has a number of `revolutions` and begins in the state `start` ([m], [m/s], [m]) at -pi, which is held
    fixed. Without a start it begins at rest, and the gradients with respect to the train then include the dependence of
    the rest position on the train. With a `cotangent` of the values only their weighted sum is differentiated, in one
    backward sweep. With `mechanical` there are gradients with respect to the train's parameters too. `spacing` [rad]
    has the meaning that it has for `TracedMotion`.

    Raises MotionRefused for too many switchings or an unbounded motion, InputError for an unknown metric.
    """
    at = rest_of(train) if start is None else start
    motion = TracedMotion(train, lift, cam_speed, at, revolutions, mechanical, spacing)
    gradient = motion.gradient(metrics, revolution, cotangent)
    if start is None and gradient.by_train is not None:
        return replace(gradient, by_train=gradient.by_train + rest_back(train, gradient.by_start))
    return gradient


def rest_back(train: Train, by_start: Float[np.ndarray, "l state"]) -> ByTrain:
    """Gradients with respect to the train, through the state at rest, of l numbers of a motion that starts from rest.

    `by_start` are their gradients with respect to the start state. At rest the forces of all elements without memory
    balance, and a memory is its element's compression. The pieces are fixed, which is wrong if one only just holds.
    """
    arrays, state, n = train_arrays(train), rest_of(train), len(train.mass)
    status = np.empty(len(train.a), dtype=np.int64)
    classify(arrays, 1.0, np.concatenate([state, np.zeros(2)]), status)
    pieces, memory = arrays.first[:-1] + status, list(train.memory)
    d, carries = train.compression(state[:n], 0.0), np.where(arrays.memory < 0, 1.0, 0.0)
    rows, slope, by_memory = train.incidence, carries * arrays.law[pieces, 1], by_start[:, 2 * n :]
    push = np.linalg.solve((rows.T * slope) @ rows, (by_start[:, :n] + by_memory @ rows[memory]).T).T
    on, bars = push @ rows.T * carries, room_for_bars(arrays, (0, 0), len(push), True)
    bars.mass[:, 2] = push
    for e in np.flatnonzero(carries):
        bars.law[:, pieces[e], 0], bars.law[:, pieces[e], 1] = -on[:, e], -on[:, e] * d[e]
    bars.gap[:] = on * slope
    bars.gap[:, memory] -= by_memory
    return by_train(train, bars)
