"""Many motions with their gradients: one compiled loop per thread, so that no motion costs a call from Python."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.adjoint.evaluate import closings_margin, evaluate
from camopt.exact.adjoint.gradient import rest_back
from camopt.exact.adjoint.motion import (
    FIRST_SEGMENTS,
    NO_ROWS,
    OBSERVATIONS,
    Gradient,
    Grazing,
    metric_numbers,
    room_for,
    steps_of,
)
from camopt.exact.adjoint.seeds import empty_seeds
from camopt.exact.adjoint.slopes import by_train, room_for_bars
from camopt.exact.adjoint.sweep import Bars, sweep
from camopt.exact.affine.inputs import Inputs
from camopt.exact.affine.lines import rest_of
from camopt.exact.engine import MOST_SWITCHINGS
from camopt.exact.kernel.arrays import CamArrays, TrainArrays, train_arrays
from camopt.exact.kernel.propagators import Propagators, propagators
from camopt.exact.kernel.revolution import DONE, NEED_TABLES, TRACE_FULL
from camopt.exact.kernel.setting import Setting, follow
from camopt.exact.kernel.trace import first
from camopt.programs import compiled
from camopt.scene.train import Train

PARTS = 4
"""Parts per thread into which a batch is cut: the motions of one part may take longer than those of another."""


class Wanted(NamedTuple):
    """What is asked of every motion."""

    revolutions: int
    revolution: int
    metrics: np.ndarray  # (l) the numbers by which `measure` knows the metrics
    weights: np.ndarray  # (l)
    together: bool  # one sweep for the weighted sum instead of one per metric


class Motions(NamedTuple):
    """k motions of one train whose cams share their piece borders, with room for what g sweeps find of each motion."""

    borders: np.ndarray  # (p + 1) rad
    pieces: np.ndarray  # (k, p, q + 2f) of the lift and the forces by the cam angle
    cam_speed: np.ndarray  # (k) rad/s
    foot: np.ndarray  # (k) opening foot, rad
    state: np.ndarray  # (k, 2n + r): start, then end
    values: np.ndarray  # (k, l, 2)
    grazing: np.ndarray  # (k, 2)
    bars: Bars  # each array with the first axes (k, g)


@compiled
def run(s, motions, wanted, most, rows, trace, seeds, begin, end):
    """Runs the motions `begin` to `end` under the setting s, with each motion's own cam in place of the setting's.

    The loop stops at the first motion that `follow` cannot finish. Returns (the number of that motion, or `end`; the
    code that `follow` gave; the key of the missing table). `rows` is passed on to `follow`.
    """
    start = np.empty(motions.state.shape[1])
    for i in range(begin, end):
        start[:] = motions.state[i]
        cam = CamArrays(motions.borders, motions.pieces[i], motions.cam_speed[i])
        code, count, _ = follow(s.train, cam, s.step, s.tables, motions.state[i], wanted.revolutions, most, rows, trace)
        if code != DONE:
            motions.state[i] = start
            return i, code, count
        one = Setting(
            s.train, cam, s.step, s.tables, s.valve, s.seat, s.cam_side,
            s.half_duration, motions.foot[i],
        )  # fmt: skip
        done = first(trace, count)
        for j in range(motions.bars.start.shape[1]):
            low, high = (0, len(wanted.metrics)) if wanted.together else (j, j + 1)
            part = wanted.metrics[low:high], wanted.weights[low:high]
            evaluate(one, done, seeds, part[0], part[1], wanted.revolution, motions.values[i, low:high])
            b = motions.bars
            bars = Bars(b.start[i, j], b.coefficients[i, j], b.mass[i, j], b.law[i, j], b.gap[i, j])
            sweep(one, done, seeds, bars)
        motions.grazing[i] = closings_margin(one, done)
    return end, DONE, 0


def value_and_gradient_many(
    train: Train,
    lifts: Sequence[Lift],
    cam_speeds: Sequence[float],
    metrics: Sequence[str],
    starts: np.ndarray | None = None,
    *,
    workers: int = 2,
    revolutions: int = 1,
    revolution: int = 0,
    cotangent: np.ndarray | None = None,
    mechanical: bool = False,
    spacing: float | None = None,
) -> list[Gradient | None]:
    """`value_and_gradient` of k motions side by side in threads; a motion that is refused gives None.

    `lifts` (k) and `cam_speeds` (k) [rad/s] describe the motions. `starts` (k, 2n + r: [m], [m/s], [m]) are the states
    in which they begin; without them every motion begins at rest. All other arguments mean what they mean for
    `value_and_gradient`, and InputError is raised in the same cases.
    """
    arrays = train_arrays(train)
    weights = np.ones(len(metrics)) if cotangent is None else np.asarray(cotangent, dtype=float)
    wanted = Wanted(revolutions, revolution, metric_numbers(train, metrics), weights, cotangent is not None)
    states = np.array([rest_of(train)] * len(lifts) if starts is None else starts, dtype=float)
    groups: dict[tuple, list[int]] = {}
    for i, (lift, speed) in enumerate(zip(lifts, cam_speeds, strict=True)):
        pieces = lift.borders.tobytes(), lift.coefficients.shape, lift.half_duration
        groups.setdefault((*steps_of(train, speed, spacing), *pieces), []).append(i)
    found: list[Gradient | None] = [None] * len(cam_speeds)

    def one_part(step: float, at_once: int, part: list[int]) -> None:
        some, speeds = [lifts[i] for i in part], np.array([cam_speeds[i] for i in part])
        inputs = Inputs(train.forcing, some[0].borders)
        motions = _motions(arrays, inputs, some, speeds, states[part], wanted, mechanical)
        tables = propagators(train, step, some[0].coefficients.shape[1], at_once)
        for i in _run(train, tables, motions, wanted, some[0].half_duration):
            found[part[i]] = _gradient(train, inputs, motions, i, tuple(metrics), mechanical, starts is None)

    with ThreadPoolExecutor(workers) as pool:
        jobs = [
            pool.submit(one_part, key[0], key[1], part.tolist())
            for key, group in groups.items()
            for part in np.array_split(group, min(len(group), PARTS * workers))
        ]
        for job in jobs:
            job.result()
    return found


def _motions(
    train: TrainArrays, inputs: Inputs, lifts: list[Lift], speeds, states, wanted: Wanted, mechanical: bool
) -> Motions:
    k, m = len(lifts), len(wanted.metrics)
    sweeps, pieces = 1 if wanted.together else m, np.stack([inputs.pieces(lift.coefficients) for lift in lifts])
    bars = room_for_bars(train, pieces.shape[1:], k * sweeps, mechanical)
    return Motions(
        inputs.borders,
        pieces,
        speeds,
        np.array([lift.opening_foot for lift in lifts]),
        states,
        np.empty((k, m, 2)),
        np.empty((k, 2)),
        Bars(*(part.reshape(k, sweeps, *part.shape[1:]) for part in bars)),
    )


def _run(train: Train, tables: Propagators, motions: Motions, wanted: Wanted, half_duration: float) -> list[int]:
    """Runs all motions and returns the numbers of those that are not refused."""
    sides, k, segments = np.array(train.cam_side, dtype=np.int64), len(motions.cam_speed), 0
    observations, i, done, code = OBSERVATIONS * len(wanted.metrics), 0, [], TRACE_FULL
    while i < k:
        if code == TRACE_FULL:
            segments = 4 * segments or FIRST_SEGMENTS * wanted.revolutions
            trace = room_for(tables, segments)
            seeds = empty_seeds(segments, observations, tables.arrays)
        built = tables.built
        numbers = train.valve, train.seat, sides, half_duration, 0.0
        cam = CamArrays(motions.borders, motions.pieces[0], 0.0)
        setting = Setting(tables.arrays, cam, tables.step, built, *numbers)
        begin = i
        i, code, key = run(setting, motions, wanted, MOST_SWITCHINGS, NO_ROWS, trace, seeds, begin, k)
        done += range(begin, i)
        if code == NEED_TABLES:
            tables.build(key)
        elif code not in (DONE, TRACE_FULL):
            i += 1
    return done


def _gradient(
    train: Train, inputs: Inputs, motions: Motions, i: int, metrics: tuple[str, ...], mechanical: bool, rest: bool
) -> Gradient:
    bars = Bars(*(part[i] for part in motions.bars))
    by_coefficients, by_rows = inputs.back(bars.coefficients)
    slopes = by_train(train, bars, by_rows) if mechanical else None
    if slopes is not None and rest:
        slopes = slopes + rest_back(train, bars.start)
    return Gradient(
        by_coefficients=by_coefficients,
        by_start=bars.start,
        by_train=slopes,
        metrics=metrics,
        values=motions.values[i, :, 0],
        runner_up=motions.values[i, :, 1],
        end=motions.state[i],
        grazing=Grazing(*(float(number) for number in motions.grazing[i])),
    )
