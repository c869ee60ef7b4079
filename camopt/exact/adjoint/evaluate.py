"""Values of a traced motion with their cotangents: metrics and samples; and how near it is to grazing."""

import numba
import numpy as np

from camopt.exact.adjoint.metrics import measure
from camopt.exact.adjoint.seeds import clear, observe, seed_force
from camopt.exact.kernel.instants import compression, nearest_miss, state_at
from camopt.exact.kernel.propagators import ACTING, SEPARATED
from camopt.exact.kernel.revolution import element_forces


@numba.njit(cache=True, nogil=True)
def evaluate(s, trace, seeds, metrics, weights, turn, values):
    """Fills values (l, 2: value, runner-up) of metrics in a revolution; `seeds` then holds their weighted sum's."""
    clear(seeds, len(trace.length))
    for i in range(len(metrics)):
        seeds.weight[0] = weights[i]
        values[i] = measure(metrics[i], s, trace, seeds, turn)
    seeds.weight[0] = 1.0


@numba.njit(cache=True, nogil=True)
def closings_margin(s, trace):
    """(slowest closing of a damped contact [m/s], smallest separation at which one turned back [m]); inf for none."""
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


@numba.njit(cache=True, nogil=True)
def sample(s, trace, segments, lengths, rows):
    """Fills rows (m, 2n + 2 + e) with x, v, lift, lift velocity and the elements' forces at instants."""
    n = len(s.laws[0])
    for i in range(len(segments)):
        y, slot = state_at(s, trace, segments[i], lengths[i]), trace.slot[segments[i]]
        rows[i, : 2 * n + 1] = y[: 2 * n + 1]
        rows[i, 2 * n + 1] = y[2 * n + 1] / s.step
        x, v = y[:n], y[n : 2 * n]
        element_forces(s.laws, s.states[slot], y[2 * n], rows[i, 2 * n + 1], x, v, rows[i, 2 * n + 2 :])


@numba.njit(cache=True, nogil=True)
def collect(s, trace, seeds, segments, lengths, bar):
    """Fills `seeds` with the cotangents bar (m, 2n + 2 + e) of what `sample` gives."""
    n2 = 2 * len(s.laws[0])
    clear(seeds, len(trace.length))
    for i in range(len(bar)):
        k = segments[i]
        observe(seeds, k, lengths[i])[:] = bar[i, : n2 + 2]
        for e in range(bar.shape[1] - n2 - 2):
            if bar[i, n2 + 2 + e] != 0.0 and s.states[trace.slot[k], e] == ACTING:
                seed_force(s, trace, seeds, k, lengths[i], e, bar[i, n2 + 2 + e])
