"""Switching instants: the first time within a step at which the power series of a watched quantity turns negative."""

from camopt.exact.kernel.advance import apply
from camopt.exact.kernel.tables import TERMS
from camopt.programs import njit_no_refcount

TICK = 1e-13
"""Smallest resolved time [s] between two switchings. It is far below any step and above the series' rounding."""
CONVERGED = 1e-9
"""Newton step [steps] at which the iteration ends: the remaining error is of the order of its square."""
SAMPLES = 15
"""Number of intervals per step at whose ends the series is sampled: the phase of the highest mode advances by less than
0.1 rad in each, so that it contains at most one extremum."""


@njit_no_refcount
def suspect(out, at, w, count):
    """Whether a watch may turn negative within a step, from its values and slopes at the step's two ends.

    The test may be true for a watch that stays positive, but is never false for one that turns negative. `at` is the
    index in `out` of the values at the step's start; the slopes there follow, and then values and slopes at its end.
    """
    before, after = out[at + w], out[at + 2 * count + w]
    return before < 0.0 or after < 0.0 or before + out[at + count + w] < 0.0 or after - out[at + 3 * count + w] < 0.0


@njit_no_refcount
def first_suspect(out, at, count, steps):
    """The first step in which any watch is suspect; `steps` if there is none."""
    low = 0
    for i in range(steps + 1):
        begin = at + 2 * count * i
        for w in range(begin, begin + count):
            low += out[w] < abs(out[w + count])
    if low == 0:  # no tangent reaches zero within a step in either direction
        return steps
    for i in range(steps):
        begin = at + 2 * count * i
        for w in range(count):
            if suspect(out, begin, w, count):
                return i
    return steps


@njit_no_refcount
def next_switch(tables, slot, y, columns, out, length, tick, scratch):
    """The first switching in (0, length] steps, as (whole steps before it, remainder [steps], watch).

    Without a switching the result is (0, length, -1). With one, the first array of `scratch` holds the state after the
    whole steps. `out` holds the watches of the span, and `tick` [steps] is the smallest resolved time.
    """
    count, begin, series = tables.count[slot], tables.steps[slot], tables.series[slot]
    there, w, value, slope = scratch
    c = len(y)
    steps = len(begin) - 1
    for i in range(first_suspect(out, c, count, steps), steps):
        if i >= length:
            break
        best, which = min(1.0, length - i), -1
        reached = False
        for watch in range(count):
            if not suspect(out, c + 2 * count * i, watch, count):
                continue
            if not reached:
                apply(begin[i], y, columns, c, there)
                reached = True
            apply(series[watch], there, columns, TERMS + 1, w)
            s = first_negative(w, tick if i == 0 else 0.0, best, value, slope)
            if s >= 0.0:
                best, which = s, watch
        if which >= 0:
            return i, best, which
    return 0, length, -1


@njit_no_refcount(fastmath={"contract"})
def _value_and_slope(w, t):
    value, slope = 0.0, 0.0
    for k in range(TERMS, -1, -1):
        slope = slope * t + value
        value = value * t + w[k]
    return value, slope


@njit_no_refcount(fastmath={"contract"})
def _sample(w, value, slope):
    """Write values and slopes at i / SAMPLES, i = 0 to SAMPLES, in one loop that the compiler can vectorise."""
    for i in range(SAMPLES + 1):
        value[i], slope[i] = w[TERMS], 0.0
    for k in range(TERMS - 1, -1, -1):
        for i in range(SAMPLES + 1):
            t = i * (1.0 / SAMPLES)
            slope[i] = slope[i] * t + value[i]
            value[i] = value[i] * t + w[k]


@njit_no_refcount
def first_negative(w, start, end, value, slope):
    """The first t in [start, end] at which the series w turns negative, or -1; 0 <= start << 1 and end <= 1.

    A dip below zero between two samples is found even if the series is positive again at the second one. A series that
    is negative and decreasing without having been positive switches at the first sample where this is detected: at the
    start, if the contact has just switched the other way.
    """
    _sample(w, value, slope)
    if start > 0.0:
        value[0], slope[0] = _value_and_slope(w, start)
    width = 1.0 / SAMPLES
    for i in range(SAMPLES):
        low = max(start, i * width)
        if low > end:
            return -1.0
        if value[i] < 0.0 and slope[i] < 0.0:
            return low
        root = -1.0
        if value[i + 1] < 0.0 <= value[i]:
            root = _root(w, low, (i + 1) * width, value[i], value[i + 1])
        elif slope[i] < 0.0 < slope[i + 1] and value[i] >= 0.0:
            if value[i] + width * slope[i] < 0.0 or value[i + 1] - width * slope[i + 1] < 0.0:
                root = _dip(w, low, (i + 1) * width)
        if root >= 0.0:
            return root if root <= end else -1.0
    return -1.0


@njit_no_refcount
def _dip(w, start, high):
    """The t at which w turns negative before its lowest point in (start, high); -1 if that point is not negative."""
    low, above = start, _value_and_slope(w, start)[0]
    for _ in range(60):
        middle = 0.5 * (low + high)
        value, slope = _value_and_slope(w, middle)
        if value < 0.0:
            return _root(w, start, middle, above, value)
        if slope < 0.0:
            low = middle
        else:
            high = middle
        if value - abs(slope) * (high - low) > 0.0:  # lower bound on the interval
            return -1.0
    return -1.0


@njit_no_refcount
def _root(w, low, high, above, below):
    """The t at which w turns negative, by Newton's method safeguarded by bisection.

    The initial bracket is [low, high], with w(low) = above >= 0 > below = w(high).
    """
    t = low + (high - low) * above / (above - below)
    for _ in range(60):
        value, slope = _value_and_slope(w, t)
        if value >= 0.0:
            low = t
        else:
            high = t
        new = t - value / slope if slope != 0.0 else low
        if abs(new - t) <= CONVERGED and low <= new <= high:
            return new
        if not low < new < high:
            new = 0.5 * (low + high)
        if high - low <= 1e-15:
            return new
        t = new
    return t
