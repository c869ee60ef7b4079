"""Power series of the motion about one instant, element by element, and the switching instants found on them.

Between switchings the motion is analytic: its series follows from the equations of motion term by term. Over a step
in which the highest mode turns by at most 1.5 rad, `TERMS` terms leave a remainder below 1e-16 of the motion.
"""

import numba

TERMS = 22
SEPARATED, COMPRESSED, ACTING = 0, 1, 2
"""States of a contact: apart; pressed in but without force, its damper having cancelled it; pushing."""
TICK = 1e-13
"""Smallest time [s] between two switchings that is resolved: far below any step, above the rounding of the series."""


@numba.njit(cache=True, nogil=True)
def series(train, status, lift, x, v, xs, vs, ds):
    """Fills xs, vs (TERMS + 1, n) and the compressions ds (TERMS + 1, e) with coefficients in time.

    `lift` (TERMS + 2) holds the lift's own coefficients in time [m/s^k]; x, v (n) are the start.
    """
    mass, mass_damping, mass_force, a, b, contact, cam_driven, stiffness, damping, preload, gap = train
    n = len(mass)
    for i in range(n):
        xs[0, i], vs[0, i] = x[i], v[i]
    for k in range(TERMS):
        for i in range(n):
            vs[k + 1, i] = -mass_damping[i] * vs[k, i]
            if k == 0:
                vs[1, i] += mass_force[i]
        for e in range(len(a)):
            d = 0.0
            rate = 0.0
            if a[e] >= 0:
                d += xs[k, a[e]]
                rate += vs[k, a[e]]
            if b[e] >= 0:
                d -= xs[k, b[e]]
                rate -= vs[k, b[e]]
            if cam_driven[e]:
                d += lift[k]
                rate += (k + 1) * lift[k + 1]
            if k == 0:
                d -= gap[e]
            ds[k, e] = d
            if contact[e] and status[e] != ACTING:
                continue
            f = stiffness[e] * d + damping[e] * rate
            if k == 0:
                f += preload[e]
            if a[e] >= 0:
                vs[k + 1, a[e]] -= f
            if b[e] >= 0:
                vs[k + 1, b[e]] += f
        share = 1.0 / (k + 1)
        for i in range(n):
            vs[k + 1, i] *= share / mass[i]
            xs[k + 1, i] = vs[k, i] * share
    for e in range(len(a)):  # the last compression coefficient, which the forces of the last term need
        d = 0.0
        if a[e] >= 0:
            d += xs[TERMS, a[e]]
        if b[e] >= 0:
            d -= xs[TERMS, b[e]]
        if cam_driven[e]:
            d += lift[TERMS]
        ds[TERMS, e] = d


@numba.njit(cache=True, nogil=True)
def evaluate(coefficients, t, out):
    """Horner over rows: out (m) = sum_k coefficients[k] t^k."""
    for i in range(len(out)):
        out[i] = coefficients[TERMS, i]
    for k in range(TERMS - 1, -1, -1):
        for i in range(len(out)):
            out[i] = out[i] * t + coefficients[k, i]


@numba.njit(cache=True, nogil=True)
def value_and_slope(w, t):
    """A scalar polynomial and its derivative at t."""
    value, slope = 0.0, 0.0
    for k in range(len(w) - 1, -1, -1):
        slope = slope * t + value
        value = value * t + w[k]
    return value, slope


@numba.njit(cache=True, nogil=True)
def _root(w, low, high):
    """Where w turns negative in (low, high]: w(low) >= 0 > w(high); Newton kept inside a shrinking bracket."""
    t = 0.5 * (low + high)
    for _ in range(60):
        value, slope = value_and_slope(w, t)
        if value >= 0.0:
            low = t
        else:
            high = t
        new = t - value / slope if slope != 0.0 else low
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - t) <= 1e-16 * high or high - low <= 1e-17:
            return new
        t = new
    return t


@numba.njit(cache=True, nogil=True)
def first_negative(w, end):
    """First t in (TICK, end] at which w turns negative, or -1. A dip and return between two samples is found.

    Sixteen samples: the highest mode turns by less than 0.1 rad between two, so one extremum at most lies there.
    """
    bound, power = 0.0, 1.0
    for k in range(1, len(w)):
        power *= end
        bound += abs(w[k]) * power
    if w[0] > bound:
        return -1.0
    t0 = TICK
    w0, s0 = value_and_slope(w, t0)
    if w0 < 0.0 and s0 < 0.0:
        return t0
    count = 16
    for i in range(1, count + 1):
        t1 = end * i / count
        if t1 <= t0:
            continue
        w1, s1 = value_and_slope(w, t1)
        if w1 < 0.0 <= w0:
            return _root(w, t0, t1)
        if w0 >= 0.0 and s0 < 0.0 < s1:
            low, high = t0, t1
            for _ in range(60):  # the lowest point between
                middle = 0.5 * (low + high)
                value, slope = value_and_slope(w, middle)
                if value < 0.0:
                    return _root(w, t0, middle)
                if slope < 0.0:
                    low = middle
                else:
                    high = middle
        t0, w0, s0 = t1, w1, s1
    return -1.0


@numba.njit(cache=True, nogil=True)
def next_switch(train, status, lift, ds, end, w):
    """First switching in (0, end]: (time, element, new status), or (end, -1, 0). `w` is scratch (TERMS + 1)."""
    stiffness, damping, preload = train[7], train[8], train[9]
    best, which, new = end, -1, 0
    for e in range(ds.shape[1]):
        if not train[5][e]:
            continue
        for law in range(2):  # 0: elastic force p; 1: whole force f
            if (law == 0 and status[e] == ACTING) or (law == 1 and status[e] == SEPARATED):
                continue
            for k in range(TERMS + 1):
                w[k] = stiffness[e] * ds[k, e]
                if law == 1 and k < TERMS:
                    w[k] += damping[e] * (k + 1) * ds[k + 1, e]
            w[0] += preload[e]
            closes = status[e] == SEPARATED or (law == 1 and status[e] == COMPRESSED)
            if closes:
                for k in range(TERMS + 1):
                    w[k] = -w[k]
            t = first_negative(w, best)
            if t >= 0.0:
                best, which = t, e
                if closes:
                    new = ACTING
                elif law == 0:
                    new = SEPARATED
                else:
                    new = COMPRESSED if damping[e] > 0.0 else SEPARATED
    return best, which, new
