"""Cotangents of one number of a traced motion, with respect to states at instants, switching times and parameters.

The metrics add them here one by one; the sweep of `camopt.exact.adjoint.sweep` then propagates them to the start.
"""

from typing import NamedTuple

import numpy as np

from camopt.exact.kernel.arrays import TrainArrays
from camopt.exact.kernel.elements import compression, lift_at, memory_of, touch_line
from camopt.exact.kernel.instants import state_at
from camopt.programs import inner, njit_no_refcount, pass_by_pointer


@pass_by_pointer
class Seeds(NamedTuple):
    """Cotangents of one number. An observation is an instant at which the number depends on the state.

    The observations of a segment form a linked list that begins at `head` and continues through `following`.
    """

    used: np.ndarray  # (1) number of observations
    weight: np.ndarray  # (1) factor of everything that is added
    head: np.ndarray  # (k) first observation of each segment, -1 for none
    following: np.ndarray  # (m) next observation of the same segment, -1 for none
    length: np.ndarray  # (m) steps from the segment's start
    bar: np.ndarray  # (m, 2n + r + 2) of x, v, z, lift, lift velocity [SI] there, at a fixed time
    time: np.ndarray  # (k) of the time [s] of the switching that ends each segment
    integral: np.ndarray  # (k) of the integral of the seat's distance over a segment [m steps]
    law: np.ndarray  # (2p + w, 4) of the forms of the pieces, direct dependence: forces, flows, watches
    gap: np.ndarray  # (e) of the gaps, direct dependence


def empty_seeds(segments: int, observations: int, train: TrainArrays) -> Seeds:
    """Seeds with room for the cotangents of a trace."""
    return Seeds(
        np.zeros(1, dtype=np.int64),
        np.ones(1),
        np.full(segments, -1),
        np.empty(observations, dtype=np.int64),
        np.empty(observations),
        np.empty((observations, 2 * len(train.mass) + len(train.reach) + 2)),
        np.zeros(segments),
        np.zeros(segments),
        np.zeros_like(train.law),
        np.zeros(len(train.gap)),
    )


@njit_no_refcount
def clear(seeds, segments):
    """Remove all cotangents, for a trace with this number of segments."""
    seeds.used[0] = 0
    for k in range(segments):
        seeds.head[k], seeds.time[k], seeds.integral[k] = -1, 0.0, 0.0
    seeds.law[:], seeds.gap[:] = 0.0, 0.0


@inner
def observe(seeds, k, length):
    """Add an observation of segment k, `length` steps from its start; returns its row of `bar`, set to zero."""
    i = seeds.used[0]
    seeds.used[0] = i + 1
    seeds.following[i], seeds.head[k] = seeds.head[k], i
    seeds.length[i] = length
    seeds.bar[i, :] = 0.0
    return seeds.bar[i]


@inner
def seed_force(s, trace, seeds, k, length, e, weight):
    """Add the cotangents of weight * (force of element e) at an instant."""
    y, piece = state_at(s, trace, k, length), s.tables.pieces[trace.slot[k], e]
    d, rate = compression(s.train, e, s.step, y)
    weight *= seeds.weight[0]
    form_back(s.train, e, s.train.law[piece], weight, observe(seeds, k, length))
    law_back(s.train, e, piece, s.train.law[piece], (d, rate, memory_of(s.train, e, y)), weight, seeds.law, seeds.gap)


@njit_no_refcount
def form_back(train, e, form, weight, bar):
    """Add to bar (2n + r + 2: x, v, z, lift, lift velocity) the cotangents of weight * (a form of element e)."""
    n, at = len(train.mass), lift_at(train)
    for mass, sign in ((train.a[e], weight), (train.b[e], -weight)):
        if mass >= 0:
            bar[mass] += sign * form[1]
            bar[n + mass] += sign * form[2]
    if train.memory[e] >= 0:
        bar[2 * n + train.memory[e]] += weight * form[3]
    if train.cam_driven[e]:
        bar[at] += weight * form[1]
        bar[at + 1] += weight * form[2]


@njit_no_refcount
def law_back(train, e, row, form, where, weight, by_law, by_gap):
    """Add the cotangents of weight * (a form of element e) at where = (d, d', z), with respect to the gap and to the
    form itself, which is `row` of all forms."""
    by_law[row, 0] += weight
    by_law[row, 1] += weight * where[0]
    by_law[row, 2] += weight * where[1]
    by_law[row, 3] += weight * where[2]
    by_gap[e] -= weight * form[1]


@inner
def seed_separation(s, seeds, k, length, e, weight):
    """Add the cotangents of weight * separation of contact e at an instant. The separation is -d - constant / slope,
    with the line on which the elastic force begins."""
    train = s.train
    weight *= seeds.weight[0]
    bar = observe(seeds, k, length)
    if train.a[e] >= 0:
        bar[train.a[e]] -= weight
    if train.b[e] >= 0:
        bar[train.b[e]] += weight
    if train.cam_driven[e]:
        bar[s.tables.sizes.state] -= weight
    touch_back(train, e, weight, seeds)


@njit_no_refcount
def touch_back(train, e, weight, seeds):
    """Add the cotangents of weight * separation of contact e with respect to its own parameters, at fixed positions."""
    constant, slope = touch_line(train, e)
    seeds.law[train.touch[e], 0] -= weight / slope
    seeds.law[train.touch[e], 1] += weight * constant / slope**2
    seeds.gap[e] += weight


@inner
def seed_end(s, trace, seeds, k, length, slope):
    """Add the cotangent of an extreme at the end of a segment with respect to the time of the switching there.

    The watched quantity changes by `slope` per step. An extreme inside a segment does not depend on its time.
    """
    if length == 0.0 and k > 0 and trace.watch[k - 1] >= 0:
        seeds.time[k - 1] += seeds.weight[0] * slope / s.step
    elif length == trace.length[k] and trace.watch[k] >= 0:
        seeds.time[k] += seeds.weight[0] * slope / s.step
