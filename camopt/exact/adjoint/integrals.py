"""Integrals of the seat's distance over a segment, exact by power series, with their cotangents."""

import numpy as np

from camopt.exact.adjoint.seeds import touch_back
from camopt.exact.kernel.elements import touch_line
from camopt.exact.kernel.instants import series_at, watch_of
from camopt.exact.kernel.tables import TERMS
from camopt.programs import inner, njit_no_refcount


@njit_no_refcount
def distance_integral(s, trace, k, w, there):
    """Integral of the seat's distance over segment k [m steps], in which the seat contact must be separated."""
    slot, length, y = trace.slot[k], trace.length[k], trace.y[k]
    step = min(int(length), s.tables.integral.shape[1] - 1)
    row = s.tables.integral[slot, step]
    total = row[len(y)]
    for j in range(len(y)):
        total += row[j] * y[j]
    if length > step:
        series_at(s, trace, k, step, watch_of(s, slot, s.train.seat), w, there)
        power, rest = 1.0, 0.0
        for j in range(TERMS + 1):
            power *= length - step
            rest += w[j] * power / (j + 1)
        total += rest / touch_line(s.train, s.train.seat)[1]
    return total


@inner
def seed_integral(s, trace, seeds, k, weight):
    """Add the cotangents of weight times the integral of the seat's distance over segment k [m steps]."""
    weight *= seeds.weight[0]
    seeds.integral[k] += weight
    touch_back(s.train, s.train.seat, weight * trace.length[k], seeds)


@inner(fastmath={"contract", "reassoc"})
def integral_back(s, slot, length, weight, out):
    """Add to out (c - 1) the cotangent of y of weight times the integral over the next `length` steps."""
    stiffness, watch = touch_line(s.train, s.train.seat)[1], watch_of(s, slot, s.train.seat)
    steps, series, columns = s.tables.steps[slot], s.tables.series[slot, watch], len(out)
    whole = min(int(length), len(steps) - 1)
    for j in range(columns):
        out[j] += weight * s.tables.integral[slot, whole, j]
    if length == whole:
        return
    row, power = np.zeros(columns), 1.0
    for k in range(TERMS + 1):
        power *= length - whole
        for j in range(columns):
            row[j] += series[j, k] * (weight / stiffness * power / (k + 1))
    for j in range(columns):
        total = 0.0
        for k in range(columns):
            total += steps[whole, j, k] * row[k]
        out[j] += total
