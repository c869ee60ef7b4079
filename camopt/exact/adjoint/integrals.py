"""Integrals of the seat's distance and of its square over a segment, exact by power series, with their cotangents."""

import numpy as np

from camopt.exact.adjoint.seeds import touch_back
from camopt.exact.kernel.advance import apply
from camopt.exact.kernel.elements import touch_line
from camopt.exact.kernel.instants import series_at, watch_of
from camopt.exact.kernel.tables import TERMS
from camopt.programs import inner, njit_no_refcount


@njit_no_refcount
def distance_integral(s, trace, k, w, there):
    """Integral of the seat's distance over segment k [m steps], in which the seat must be apart."""
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
def square_integral(s, trace, k, w, there):
    """Integral of the squared seat's distance over segment k [m^2 steps], in which the seat must be apart."""
    total, watch = 0.0, watch_of(s, trace.slot[k], s.train.seat)
    p = np.zeros(TERMS + 1)
    for i in range(int(np.ceil(trace.length[k]))):
        series_at(s, trace, k, i, watch, w, there)
        p[:] = 0.0
        _add_square(w, 1.0, min(1.0, trace.length[k] - i), p)
        for j in range(TERMS + 1):
            total += w[j] * p[j]
    return total / touch_line(s.train, s.train.seat)[1] ** 2


@inner
def _add_square(w, weight, width, p):
    """Adds to p, for every power of t, weight times the integral of the series w times that power over [0, width]."""
    powers = np.empty(2 * TERMS + 2)
    powers[0] = 1.0
    for j in range(2 * TERMS + 1):
        powers[j + 1] = powers[j] * width
    for k in range(TERMS + 1):
        total = 0.0
        for j in range(TERMS + 1):
            total += w[j] * powers[j + k + 1] / (j + k + 1)
        p[k] += weight * total


@inner
def seed_integral(s, trace, seeds, k, weight):
    """Adds the cotangents of weight times the integral of the seat's distance over segment k [m steps]."""
    weight *= seeds.weight[0]
    seeds.integral[k] += weight
    touch_back(s.train, s.train.seat, weight * trace.length[k], seeds)


@inner
def seed_square(s, trace, seeds, k, weight, w, there):
    """Adds the cotangents of weight times the integral of the squared seat's distance over segment k [m^2 steps]."""
    weight *= seeds.weight[0]
    seeds.square[k] += weight
    touch_back(s.train, s.train.seat, 2.0 * weight * distance_integral(s, trace, k, w, there), seeds)


@inner(fastmath={"contract", "reassoc"})
def integrals_back(s, slot, y, length, linear, square, out):
    """Adds to out (c - 1) the cotangent of y (c - 1) by the integrals over the next `length` steps.

    `linear` and `square` are the weights of the integrals of the seat's distance and of its square.
    """
    watch, columns, stiffness = watch_of(s, slot, s.train.seat), len(y), touch_line(s.train, s.train.seat)[1]
    steps, series = s.tables.steps[slot], s.tables.series[slot, watch]
    p, w, row, there = np.empty(TERMS + 1), np.empty(TERMS + 1), np.empty(columns), np.empty(columns)
    first = 0
    if square == 0.0:
        first = min(int(length), s.tables.integral.shape[1] - 1)
        for j in range(columns):
            out[j] += linear * s.tables.integral[slot, first, j]
    for i in range(first, int(np.ceil(length))):
        width, power = min(1.0, length - i), 1.0
        for k in range(TERMS + 1):
            power *= width
            p[k] = linear / stiffness * power / (k + 1)
        if square != 0.0:
            apply(steps[i], y, columns, columns, there)
            apply(series, there, columns, TERMS + 1, w)
            _add_square(w, 2.0 * square / stiffness**2, width, p)
        for j in range(columns):
            row[j] = 0.0
            for k in range(TERMS + 1):
                row[j] += series[j, k] * p[k]
        for j in range(columns):
            total = 0.0
            for k in range(columns):
                total += steps[i, j, k] * row[k]
            out[j] += total
