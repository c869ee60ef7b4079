"""Metrics and samples of a traced motion with their cotangents, and how near the motion is to grazing.

A motion grazes where a contact only just touches, or only just fails to: there its gradient is one-sided.
"""

import numpy as np

from camopt.exact.adjoint.metrics import measure
from camopt.exact.adjoint.seeds import clear, observe, seed_force
from camopt.exact.kernel.elements import compression, element_forces, touch_line
from camopt.exact.kernel.instants import nearest_miss, state_at
from camopt.exact.kernel.tables import ACTING
from camopt.programs import compiled

TIED = 1e-12
"""A value and its runner-up within this relative difference are one but for rounding, which decides between them."""


@compiled
def evaluate(s, trace, seeds, metrics, weights, turn, values):
    """Fills values (l, 2: value, runner-up) of the metrics of a revolution.

    `seeds` then holds the cotangents of the sum of the values, each times its weight. They are NaN where a value and
    its runner-up are TIED: at such a kink there is no gradient.
    """
    last = len(trace.length) - 1
    clear(seeds, last + 1)
    for i in range(len(metrics)):
        seeds.weight[0] = weights[i]
        value, second = measure(metrics[i], s, trace, seeds, turn)
        values[i, 0], values[i, 1] = value, second
        if weights[i] != 0.0 and abs(value - second) <= TIED * abs(value):
            observe(seeds, last, trace.length[last])[:] = np.nan
    seeds.weight[0] = 1.0


@compiled
def closings_margin(s, trace):
    """(slowest closing of a damped contact [m/s], smallest separation at which one turned back [m]).

    Each is infinite where nothing of the kind happens.
    """
    approach, gap = np.inf, np.inf
    train = s.train
    for k in range(len(trace.length)):
        if trace.watch[k] >= 0:
            slot, watch = trace.slot[k], trace.watch[k]
            if train.kick[s.tables.watch[slot, watch], 0] != 0.0:
                e = s.tables.element[slot, watch]
                approach = min(approach, compression(train, e, s.step, trace.y[k + 1])[1])
    for e in range(len(train.contact)):
        if train.contact[e] and train.law[train.touch[e], 2] > 0.0:
            gap = min(gap, nearest_miss(s, trace, e) / touch_line(train, e)[1])
    return approach, gap


@compiled
def sample(s, trace, segments, lengths, rows):
    """Fills rows (m, 2n + r + 2 + e) with x, v, z, lift, lift velocity and the elements' forces at m instants."""
    at = s.tables.sizes.state
    for i in range(len(segments)):
        y = state_at(s, trace, segments[i], lengths[i])
        rows[i, : at + 1] = y[: at + 1]
        rows[i, at + 1] = y[at + 1] / s.step
    element_forces(s.train, s.tables.pieces, trace.slot[segments], rows)


@compiled
def collect(s, trace, seeds, segments, lengths, bar):
    """Fills `seeds` with the cotangents bar (m, 2n + r + 2 + e) of the rows that `sample` fills."""
    begin = s.tables.sizes.state + 2
    clear(seeds, len(trace.length))
    for i in range(len(bar)):
        k = segments[i]
        observe(seeds, k, lengths[i])[:] = bar[i, :begin]
        for e in range(bar.shape[1] - begin):
            if bar[i, begin + e] != 0.0 and s.tables.states[trace.slot[k], e] == ACTING:
                seed_force(s, trace, seeds, k, lengths[i], e, bar[i, begin + e])
