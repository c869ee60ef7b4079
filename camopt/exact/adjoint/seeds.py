"""Derivatives (cotangents) of one number by a traced motion: by states at instants, by switching times, by parameters.

The metrics collect them here one by one; the sweep of `camopt.exact.adjoint.sweep` then carries them to the start.
"""

from typing import NamedTuple

import numpy as np

from camopt.exact.kernel.borrowing import borrowing
from camopt.exact.kernel.instants import compression, state_at
from camopt.programs import compiled


class Seeds(NamedTuple):
    """Cotangents of one number. An observation is an instant at which the number depends on the state.

    The observations of a segment form a chain that begins at `head` and goes on through `following`.
    """

    used: np.ndarray  # (1) number of observations
    weight: np.ndarray  # (1) factor of everything that is added
    head: np.ndarray  # (k) first observation of each segment, -1 for none
    following: np.ndarray  # (m) next observation of the same segment, -1 for none
    length: np.ndarray  # (m) steps from the segment's start
    bar: np.ndarray  # (m, 2n + 2): by x, v, lift, lift velocity [SI] there, at a fixed time
    time: np.ndarray  # (k): by the time [s] of the switching that ends each segment
    integral: np.ndarray  # (k): by the integral of the seat's distance over a segment [m steps]
    square: np.ndarray  # (k): by the integral of its square [m^2 steps]
    element: np.ndarray  # (4, e): directly by stiffness, damping, preload, gap


def empty_seeds(segments: int, observations: int, masses: int, elements: int) -> Seeds:
    """Seeds with room for the cotangents of a trace."""
    return Seeds(
        np.zeros(1, dtype=np.int64),
        np.ones(1),
        np.full(segments, -1),
        np.empty(observations, dtype=np.int64),
        np.empty(observations),
        np.empty((observations, 2 * masses + 2)),
        np.zeros(segments),
        np.zeros(segments),
        np.zeros(segments),
        np.zeros((4, elements)),
    )


@borrowing
def clear(seeds, segments):
    """Removes all cotangents, for a trace with this number of segments."""
    seeds.used[0] = 0
    for k in range(segments):
        seeds.head[k], seeds.time[k], seeds.integral[k], seeds.square[k] = -1, 0.0, 0.0, 0.0
    seeds.element[:] = 0.0


@compiled
def observe(seeds, k, length):
    """Adds an observation of segment k, `length` steps from its start; returns its row of `bar`, which is zero."""
    i = seeds.used[0]
    seeds.used[0] = i + 1
    seeds.following[i], seeds.head[k] = seeds.head[k], i
    seeds.length[i] = length
    seeds.bar[i, :] = 0.0
    return seeds.bar[i]


@compiled
def seed_force(s, trace, seeds, k, length, e, weight):
    """Adds the cotangents of weight * (preload + stiffness d + damping d') of element e at an instant."""
    train = s.train
    n = len(s.train.mass)
    weight *= seeds.weight[0]
    d, rate = compression(s, e, state_at(s, trace, k, length))
    bar = observe(seeds, k, length)
    for mass, sign in ((train.a[e], weight), (train.b[e], -weight)):
        if mass >= 0:
            bar[mass] += sign * train.stiffness[e]
            bar[n + mass] += sign * train.damping[e]
    if train.cam_driven[e]:
        bar[2 * n] += weight * train.stiffness[e]
        bar[2 * n + 1] += weight * train.damping[e]
    seeds.element[0, e] += weight * d
    seeds.element[1, e] += weight * rate
    seeds.element[2, e] += weight
    seeds.element[3, e] -= weight * train.stiffness[e]


@compiled
def seed_separation(s, seeds, k, length, e, weight):
    """Adds the cotangents of weight * separation of contact e at an instant; separation = -(d + preload/stiffness)."""
    train = s.train
    weight *= seeds.weight[0]
    bar = observe(seeds, k, length)
    if train.a[e] >= 0:
        bar[train.a[e]] -= weight
    if train.b[e] >= 0:
        bar[train.b[e]] += weight
    if train.cam_driven[e]:
        bar[2 * len(s.train.mass)] -= weight
    seeds.element[0, e] += weight * train.preload[e] / train.stiffness[e] ** 2
    seeds.element[2, e] -= weight / train.stiffness[e]
    seeds.element[3, e] += weight


@compiled
def seed_end(s, trace, seeds, k, length, slope):
    """Adds the cotangent of an extreme at the end of a segment by the time of the switching there.

    The watched quantity changes by `slope` per step. Inside a segment an extreme does not depend on its time.
    """
    if length == 0.0 and k > 0 and trace.watch[k - 1] >= 0:
        seeds.time[k - 1] += seeds.weight[0] * slope / s.step
    elif length == trace.length[k] and trace.watch[k] >= 0:
        seeds.time[k] += seeds.weight[0] * slope / s.step
