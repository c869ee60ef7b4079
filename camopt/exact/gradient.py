"""Values and exact gradients of a motion's metrics: by the cam, by the start state and by the train."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numba
import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.adjoint import sweep
from camopt.exact.engine import AT_ONCE, MOST_SWITCHINGS, prepare, refusal, train_arrays
from camopt.exact.instants import compression, nearest_miss
from camopt.exact.kernel import CHATTER, DONE, NEED_TABLES, TRACE_FULL
from camopt.exact.metrics import METRICS, measure
from camopt.exact.propagators import SEPARATED, propagators
from camopt.exact.seeds import clear, empty_seeds
from camopt.exact.setting import Setting, follow, slot_tables
from camopt.exact.trace import Trace, empty_trace, first
from camopt.scene.errors import InputError
from camopt.scene.rest import rest_position
from camopt.scene.train import Train

BY_MASS = ("mass", "mass_damping", "mass_force")
BY_ELEMENT = ("stiffness", "damping", "preload", "gap")
FIRST_SEGMENTS = 1024
"""Segments for which there is room at first; it grows fourfold where a motion needs more."""
MOST_OBSERVATIONS = 64
"""Instants that the metrics of one gradient look at, a few each."""


@dataclass(frozen=True)
class ByTrain:
    """Gradients of l numbers by a train's parameters in SI, by the names of `Train`."""

    mass: np.ndarray  # (l, n)
    mass_damping: np.ndarray  # (l, n)
    mass_force: np.ndarray  # (l, n)
    stiffness: np.ndarray  # (l, e)
    damping: np.ndarray  # (l, e)
    preload: np.ndarray  # (l, e)
    gap: np.ndarray  # (l, e)


@dataclass(frozen=True)
class Grazing:
    """How far the motion is from one in which a damped contact closes once more or once less; inf where none comes
    near. There a gradient is one-sided."""

    approach_m_per_s: float  # slowest closing
    gap_m: float  # smallest separation at which an open contact turned back


@dataclass(frozen=True)
class Gradient:
    """Values (l) of metrics in their units and their gradients, all by SI quantities; the start state is held.

    `runner_up` (l) is the next highest (for a smallest force: lowest) crest within a thousandth of an extreme, -inf (inf)
    where there is none: at a tie the gradient is one of two. `by_train` is None where it was not asked for.
    """

    metrics: tuple[str, ...]
    values: np.ndarray  # (l)
    runner_up: np.ndarray  # (l)
    by_coefficients: np.ndarray  # (l, p, q): by lift.coefficients [m/rad^k]
    by_start: np.ndarray  # (l, 2n): by the state at -pi
    by_train: ByTrain | None
    end: np.ndarray  # (2n) state at the end
    grazing: Grazing


class TracedMotion:
    """Event-exact revolutions from a state at -pi, kept so that numbers of them can be differentiated."""

    def __init__(
        self,
        train: Train,
        lift: Lift,
        cam_speed: float,
        start: np.ndarray,
        revolutions: int = 1,
        mechanical: bool = False,
    ):
        """`start` (2n: [m], then [m/s]); `mechanical`: gradients by the train too. Raises MotionRefused for endless
        switching or a motion without bound, InputError for laws that are not linear."""
        self.train, self.lift, self.cam_speed = train, lift, cam_speed
        self.step = prepare(train, lift, cam_speed).step
        tables = propagators(train, self.step, lift.coefficients.shape[1], AT_ONCE)
        laws, cam = train_arrays(train), (lift.borders, lift.coefficients, cam_speed)
        self.end = np.array(start, dtype=float)
        segments, code = FIRST_SEGMENTS * revolutions, NEED_TABLES
        n, e, width = len(train.mass), len(train.a), 2 * len(train.mass) + lift.coefficients.shape[1]
        looks = 2 * len(tables.contacts) * 2 * (AT_ONCE + 1)
        trace = empty_trace(segments, width, looks)
        while code != DONE:
            self.end[:] = start
            code, count, switchings = follow(
                laws, cam, self.step, tables.built, self.end, revolutions, MOST_SWITCHINGS, np.empty((0, 0)), trace
            )
            if code == NEED_TABLES:
                tables.build(count)
            elif code == TRACE_FULL:
                segments *= 4
                trace = empty_trace(segments, width, looks)
            elif code != DONE:
                raise refusal(code, cam_speed, switchings)
        self.trace = first(trace, count)
        self.setting = Setting(
            laws,
            cam,
            self.step,
            tables.built,
            *slot_tables(tables).for_tables(tables.built),
            train.valve,
            train.seat,
            np.array(train.cam_side, dtype=np.int64),
            lift.half_duration,
            lift.opening_foot,
        )
        self.mechanical = mechanical
        self._seeds = empty_seeds(count, MOST_OBSERVATIONS, n, e)

    def gradient(self, metrics: Sequence[str], revolution: int = 0, cotangent: np.ndarray | None = None) -> Gradient:
        """Values and gradients of metrics in a revolution, one sweep each; one sweep in all where a `cotangent` (l) of
        the values is given: the gradients' first axis is then 1. Raises InputError for an unknown metric."""
        numbers = metric_numbers(metrics)
        n, e, sweeps = len(self.train.mass), len(self.train.a), 1 if cotangent is not None else len(metrics)
        weights = np.ones(len(metrics)) if cotangent is None else np.asarray(cotangent, dtype=float)
        values = np.empty((len(metrics), 2))
        by_coefficients = np.zeros((sweeps, *self.lift.coefficients.shape))
        by_start = np.zeros((sweeps, 2 * n))
        by_mass = np.zeros((sweeps, 3 if self.mechanical else 0, n))
        by_element = np.zeros((sweeps, 4, e))
        _gradients(
            self.setting, self.trace, self._seeds, numbers, weights, revolution, values, by_start, by_coefficients,
            by_mass, by_element,
        )  # fmt: skip
        by_train = None
        if self.mechanical:
            by_train = ByTrain(*by_mass.transpose(1, 0, 2), *by_element.transpose(1, 0, 2))
        return Gradient(
            tuple(metrics), values[:, 0], values[:, 1], by_coefficients, by_start, by_train, self.end, self.grazing()
        )

    def values(self, metrics: Sequence[str], revolution: int = 0) -> np.ndarray:
        """Values (l) of metrics in a revolution. Raises InputError for an unknown metric."""
        numbers, values = metric_numbers(metrics), np.empty((len(metrics), 2))
        _values(self.setting, self.trace, self._seeds, numbers, revolution, values)
        return values[:, 0]

    def grazing(self) -> Grazing:
        """Distance of the motion from one with another sequence of closings of damped contacts."""
        approach, gap = _grazing(self.setting, self.trace)
        return Grazing(float(approach), float(gap))


def metric_numbers(metrics: Sequence[str]) -> np.ndarray:
    """Numbers of metrics by their names; raises InputError for an unknown one."""
    unknown = [name for name in metrics if name not in METRICS]
    if unknown:
        raise InputError(f"no exact gradient of {', '.join(unknown)}: choose from {', '.join(METRICS)}")
    return np.array([METRICS.index(name) for name in metrics], dtype=np.int64)


@numba.njit(cache=True, nogil=True)
def _values(s, trace, seeds, metrics, turn, values):
    for i in range(len(metrics)):
        clear(seeds, len(trace.length))
        values[i] = measure(metrics[i], s, trace, seeds, turn)


@numba.njit(cache=True, nogil=True)
def _gradients(s, trace, seeds, metrics, weights, turn, values, by_start, by_coefficients, by_mass, by_element):
    together = len(by_start) < len(metrics)
    clear(seeds, len(trace.length))
    for i in range(len(metrics)):
        seeds.weight[0] = weights[i]
        values[i] = measure(metrics[i], s, trace, seeds, turn)
        if not together or i + 1 == len(metrics):
            j = 0 if together else i
            sweep(s, trace, seeds, by_start[j], by_coefficients[j], by_mass[j], by_element[j])
            clear(seeds, len(trace.length))
    seeds.weight[0] = 1.0


@numba.njit(cache=True, nogil=True)
def _grazing(s, trace):
    approach, gap = np.inf, np.inf
    contact, stiffness, damping = s.laws[5], s.laws[7], s.laws[8]
    for k in range(len(trace.length)):
        if trace.watch[k] >= 0:
            e = s.tables.element[trace.slot[k], trace.watch[k]]
            if damping[e] > 0.0 and s.states[trace.slot[k], e] == SEPARATED:
                approach = min(approach, compression(s, e, trace.y[k + 1])[1])
    for e in range(len(contact)):
        if contact[e] and damping[e] > 0.0:
            gap = min(gap, nearest_miss(s, trace, e) / stiffness[e])
    return approach, gap
