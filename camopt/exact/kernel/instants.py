"""The motion at instants inside a trace, and extremes of watched quantities from their power series."""

import numpy as np

from camopt.exact.kernel.advance import advance, apply
from camopt.exact.kernel.revolution import inputs_at
from camopt.exact.kernel.tables import SEPARATED, TERMS
from camopt.programs import inner, njit_no_refcount

LOOKS = 8
"""Intervals per step in which maxima are searched for; the highest mode advances by less than 0.2 rad in each."""
TIE = 1e-3
"""Largest relative difference of a maximum and its runner-up; smaller maxima are not searched for."""
FLAT = 1e-10
"""Slope per step, relative to the size of the series, that counts as zero. If a watch has its maximum at the end of a
step or of a segment (friction reverses where the valve stops), rounding would otherwise decide on which side of this
end the maximum is found, if at all."""


@inner
def state_at(s, trace, k, length):
    """y (x, v, z and the inputs) at `length` steps from the start of segment k."""
    at, (inputs, rates) = s.tables.sizes.state, s.tables.motion.shape[1:]
    y = trace.y[k].copy()
    if length != 0.0:
        work = np.empty(len(y)), np.empty(inputs - 1), np.empty(rates)
        scale, piece = s.cam.speed * s.step, trace.piece[k]
        advance(s.tables, trace.slot[k], s.step, len(y), length, y, work)
        inputs_at(s.cam.pieces[piece], s.tables.sizes.forces, trace.offset[k] + length * scale, scale, y[at:])
    return y


@njit_no_refcount
def acceleration(s, slot, y, mass):
    """Acceleration of a mass [m/s^2] in a combination of pieces or, for numbers from n on, rate of a memory [m/s]."""
    sizes, motion = s.tables.sizes, s.tables.motion[slot]
    at, total = sizes.state, motion[len(motion) - 1, mass]
    for j in range(at + 1):
        total += motion[j, mass] * y[j]
    total += motion[at + 1, mass] * y[at + 1] / s.step
    for j in range(sizes.forces):
        total += motion[at + 2 + j, mass] * y[at + sizes.lift + 2 * j]
    return total


@njit_no_refcount
def watch_of(s, slot, e):
    """The first watch of element e in a combination of pieces; -1 if it has none."""
    for w in range(s.tables.count[slot]):
        if s.tables.element[slot, w] == e:
            return w
    return -1


@njit_no_refcount
def series_at(s, trace, k, step, watch, w, there):
    """Write to w (TERMS + 1) the power series of a watch about the start of a step of segment k."""
    slot = trace.slot[k]
    y, c = trace.y[k], trace.y.shape[1]
    apply(s.tables.steps[slot, step], y, c, c, there)
    apply(s.tables.series[slot, watch], there, c, TERMS + 1, w)


@njit_no_refcount
def evaluate(w, t):
    """(value, slope, curvature) of a power series."""
    value, slope, curve = 0.0, 0.0, 0.0
    for k in range(TERMS, -1, -1):
        curve = curve * t + 2.0 * slope
        slope = slope * t + value
        value = value * t + w[k]
    return value, slope, curve


@njit_no_refcount
def crest(w, sign, low, high):
    """(t, value, slope) of the largest sign * w in [low, high], and whether it is a maximum inside the interval."""
    best, at, steep, inside = -np.inf, low, 0.0, False
    rise, t, flat = 0.0, low, FLAT * (abs(w[0]) + abs(w[1]) + abs(w[2]))
    for i in range(LOOKS + 1):
        right = low + (high - low) * i / LOOKS
        value, slope, _ = evaluate(w, right)
        value, slope = sign * value, sign * slope
        if value > best:
            best, at, steep, inside = value, right, slope, False
        if i > 0 and rise > -flat and slope < flat and rise - slope > 2.0 * flat:
            top = _summit(w, sign, t, right)
            height = sign * evaluate(w, top)[0]
            if height >= best:
                best, at, steep, inside = height, top, 0.0, True
        rise, t = slope, right
    return at, best, steep, inside


@njit_no_refcount
def _summit(w, sign, low, high):
    """Root of the slope in a bracket in which it falls through zero, by Newton's method safeguarded by bisection."""
    t = 0.5 * (low + high)
    for _ in range(60):
        _, slope, curve = evaluate(w, t)
        slope, curve = sign * slope, sign * curve
        if slope > 0.0:
            low = t
        else:
            high = t
        new = t - slope / curve if curve != 0.0 else low
        if not low <= new <= high:
            new = 0.5 * (low + high)
        if abs(new - t) < 1e-15 or high - low < 1e-15:
            return new
        t = new
    return t


@njit_no_refcount
def _highest_look(s, trace, e, status, sign, low, high):
    """Largest sign * watch over the ends of the steps inside [low, high] [rad]; -inf if no step ends there."""
    best = -np.inf
    for k in range(len(trace.length)):
        slot = trace.slot[k]
        if trace.angle[k] < low or trace.angle[k + 1] > high or s.tables.states[slot, e] != status:
            continue
        watch, count = watch_of(s, slot, e), s.tables.count[slot]
        for i in range(int(trace.length[k]) + 1):
            best = max(best, sign * trace.looks[k, 2 * count * i + watch])
    return best


@inner
def largest(s, trace, e, status, sign, low, high):
    """Largest sign * watch of element e at angles in [low, high] [rad] at which its contact has the state `status`.

    Returns (value, segment, length [steps], slope [1/step], runner-up); the segment is -1 if there is no such angle.
    The runner-up is the next highest maximum if it lies within `TIE` of the highest, and -inf otherwise. Maxima less
    than a step apart count as one, since the highest mode does not have two maxima in a step.
    """
    value, second, where, length, steep = -np.inf, -np.inf, -1, 0.0, 0.0
    per_step, crested, angle = s.cam.speed * s.step, False, 0.0
    w, there = np.zeros(TERMS + 1), np.zeros(trace.y.shape[1])
    enough = _highest_look(s, trace, e, status, sign, low, high)
    enough -= TIE * abs(enough)
    for k in range(len(trace.length)):
        slot = trace.slot[k]
        if trace.angle[k] > high or trace.angle[k + 1] < low or s.tables.states[slot, e] != status:
            continue
        watch, count = watch_of(s, slot, e), s.tables.count[slot]
        begin = max(0.0, (low - trace.angle[k]) / per_step)
        end = min(trace.length[k], (high - trace.angle[k]) / per_step)
        for i in range(int(begin), int(np.ceil(end))):
            if _bound(trace.looks, k, 2 * count * i + watch, count, sign) < enough:
                continue
            series_at(s, trace, k, i, watch, w, there)
            t, top, slope, inside = crest(w, sign, max(begin - i, 0.0), min(end - i, 1.0))
            here = trace.angle[k] + (i + t) * per_step
            distinct = here - angle > per_step
            if top > value:
                if crested and distinct:
                    second = max(second, value)
                value, where, length, steep, angle = top, k, i + t, slope, here
                crested = inside or (crested and not distinct)
            elif inside and distinct:
                second = max(second, top)
    if where >= 0 and abs(length - trace.length[where]) < 1e-12:
        length = trace.length[where]
    return value, where, length, steep, second


@njit_no_refcount
def _bound(looks, k, at, count, sign):
    """Upper bound of sign * watch within a step, from its values and slopes at the step's ends."""
    f0, g0 = sign * looks[k, at], sign * looks[k, at + count]
    f1, g1 = sign * looks[k, at + 2 * count], sign * looks[k, at + 3 * count]
    return max(max(f0, f1), max(f0 + g0, f1 - g1))


@inner
def nearest_miss(s, trace, e):
    """Smallest local minimum of the watch [N] of contact e while it is separated; inf if there is none."""
    least, looks, states = np.inf, trace.looks, s.tables.states
    w, there = np.zeros(TERMS + 1), np.zeros(trace.y.shape[1])
    for k in range(len(trace.length)):
        slot = trace.slot[k]
        if states[slot, e] != SEPARATED:
            continue
        watch, count = watch_of(s, slot, e), s.tables.count[slot]
        for i in range(int(np.ceil(trace.length[k]))):
            at = 2 * count * i + watch
            if looks[k, at + count] < 0.0 < looks[k, at + 3 * count] and -_bound(looks, k, at, count, -1.0) < least:
                series_at(s, trace, k, i, watch, w, there)
                _, top, _, inside = crest(w, -1.0, 0.0, min(trace.length[k] - i, 1.0))
                if inside:
                    least = min(least, -top)
    return least
