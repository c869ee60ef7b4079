"""Closing of the valve in a revolution of a traced motion: touch, nominal closing, bounce window."""

import numpy as np

from camopt.exact.adjoint.seeds import observe
from camopt.exact.kernel.elements import closeness, touch_line
from camopt.exact.kernel.instants import acceleration, state_at
from camopt.exact.kernel.switching import _value_and_slope
from camopt.exact.kernel.tables import SEPARATED, TERMS
from camopt.programs import inner, njit_no_refcount

SAME_ANGLE = 1e-9
"""Largest angle [rad] between the opening foot and the start of the segment that begins there."""


@njit_no_refcount
def closes(s, trace, k, e):
    """Whether segment k ends with the closing of contact e."""
    slot, watch = trace.slot[k], trace.watch[k]
    return watch >= 0 and s.tables.element[slot, watch] == e and s.tables.states[slot, e] == SEPARATED


@njit_no_refcount
def seat_distance(s, y):
    """The seat's distance [m] and its slope [m/step] in a state y."""
    train, e = s.train, s.train.seat
    d, rate = closeness(train.a[e], train.b[e], train.gap[e], len(train.mass), y)
    constant, slope = touch_line(train, e)
    return -d - constant / slope, -rate * s.step


@njit_no_refcount
def next_foot(s, turn):
    """The opening foot [rad] of the next revolution, where the bounce window of revolution `turn` ends."""
    return 2 * np.pi * (turn + 1) + s.opening_foot


@njit_no_refcount
def touch(s, trace, turn):
    """(segment that ends with the touch of a revolution, -1 for none by the next foot; whether the valve opened)."""
    top, peak, e, states = 0.0, -1, s.train.seat, s.tables.states
    for k in range(len(trace.length)):
        if abs(trace.angle[k] - 2 * np.pi * turn) <= np.pi and states[trace.slot[k], e] == SEPARATED:
            height = seat_distance(s, trace.y[k])[0]
            if height >= top:
                top, peak = height, k
    if peak < 0:
        return -1, False
    for k in range(peak, len(trace.length)):
        if trace.angle[k + 1] > next_foot(s, turn):
            break
        if closes(s, trace, k, s.train.seat):
            return k, True
    return -1, True


@njit_no_refcount
def leaked(s, trace, turn, touched):
    """(length [m], at least zero, that the adjusters between cam and valve have lost from the opening foot of a
    revolution to its touch, which ends segment `touched`; the segment that begins at the foot)."""
    foot = 0
    while foot < touched and trace.angle[foot] < 2 * np.pi * turn + s.opening_foot - SAME_ANGLE:
        foot += 1
    total = 0.0
    for z in s.train.adjusters:
        total += trace.y[touched + 1, z] - trace.y[foot, z]
    return max(0.0, total), foot


@inner
def nominal_closing(s, trace, turn, touched):
    """(segment, length [steps]) where the lift of a revolution, whose touch ends segment `touched`, falls for the last
    time to the lash plus the length that the adjusters have lost; the segment is -1 if there is none."""
    lash, at, q, w = leaked(s, trace, turn, touched)[0], s.tables.sizes.state, s.tables.sizes.lift, np.zeros(TERMS + 1)
    for e in s.train.cam_side:
        lash += s.train.gap[e]
    for k in range(len(trace.length) - 1, -1, -1):
        if abs(0.5 * (trace.angle[k] + trace.angle[k + 1]) - 2 * np.pi * turn) > np.pi:
            continue
        if trace.y[k, at] > lash >= trace.y[k + 1, at]:
            w[:q] = trace.y[k, at : at + q]
            low, high = 0.0, trace.length[k]
            for _ in range(60):
                middle = 0.5 * (low + high)
                if _value_and_slope(w, middle)[0] > lash:
                    low = middle
                else:
                    high = middle
            return k, 0.5 * (low + high)
    return -1, 0.0


@inner
def closed_window(s, trace, turn):
    """The window of a revolution in which bounce and impacts are evaluated.

    Returns (segment of the touch, whether the valve opened, start [rad], end [rad], segment of the nominal closing if
    the window starts there and -1 otherwise, its length [steps]).
    """
    k, opened = touch(s, trace, turn)
    end = next_foot(s, turn)
    if k < 0:
        return k, opened, 0.0, end, -1, 0.0
    start = trace.angle[k + 1]
    nominal, length = nominal_closing(s, trace, turn, k)
    if nominal >= 0 and trace.angle[nominal] + length * s.cam.speed * s.step < start:
        return k, opened, trace.angle[nominal] + length * s.cam.speed * s.step, end, nominal, length
    return k, opened, start, end, -1, 0.0


@inner
def seed_nominal(s, trace, seeds, k, length, slope):
    """Add the cotangents of a value at the nominal closing through the time of that closing.

    The value changes by `slope` per second. The time solves lift(time) = lash, where the lash is the sum of the gaps
    and of the length that the adjusters have lost. Returns the cotangent of this lash.
    """
    at = s.tables.sizes.state
    rate = state_at(s, trace, k, length)[at + 1] / s.step
    slope *= seeds.weight[0]
    observe(seeds, k, length)[at] -= slope / rate
    for e in s.train.cam_side:
        seeds.gap[e] += slope / rate
    return slope / rate


@inner
def seed_leaked(s, trace, seeds, turn, touched, weight):
    """Add the cotangents of weight * (length lost by the adjusters up to the touch, which ends segment `touched`)."""
    total, foot = leaked(s, trace, turn, touched)
    if total == 0.0:
        return
    before, after = observe(seeds, foot, 0.0), observe(seeds, touched, trace.length[touched])
    for z in s.train.adjusters:
        before[z] -= weight
        after[z] += weight
        rate = acceleration(s, trace.slot[touched], trace.y[touched + 1], z - len(s.train.mass))
        seeds.time[touched] += weight * rate
