"""The metrics of a traced motion (docs/model.md) with their cotangents, at exact instants instead of samples.

Names and definitions are those of `camopt.scene.quantities`. A window that would extend beyond the trace ends with it.
If the valve opens but never touches its seat again, the metrics of the closing are NaN and have no cotangents. Without
seeds (None) only values are computed: numba omits the code for the cotangents.

A motion is grazing if a contact only just touches, or only just fails to; its gradient is then one-sided.
"""

import numpy as np

from camopt.exact.adjoint.closing import closed_window, closes, seed_leaked, seed_nominal, touch
from camopt.exact.adjoint.integrals import distance_integral, seed_integral
from camopt.exact.adjoint.seeds import clear, observe, seed_end, seed_force, seed_separation
from camopt.exact.kernel.elements import compression, element_forces, touch_line
from camopt.exact.kernel.instants import acceleration, largest, nearest_miss, state_at
from camopt.exact.kernel.tables import ACTING, SEPARATED, TERMS
from camopt.programs import compiled, inner, njit_no_refcount
from camopt.scene.units import DEG, MM

METRICS = (
    "bounce_mm",
    "jump_mm",
    "jump_deg",
    "contact_force_min_N",
    "contact_force_max_N",
    "seating_velocity_m_per_s",
    "impact_velocity_m_per_s",
    "dynamic_area_mm_deg",
)
"""Names of the metrics, in the order of their numbers in `measure`."""
NONE = -np.inf
TIED = 1e-12
"""Relative difference of a value and its runner-up up to which only rounding decides between them."""


@inner
def measure(metric, s, trace, seeds, turn):
    """(value, runner-up) of metric number `metric` in revolution `turn`; its cotangents are added to `seeds`."""
    if metric == 0:
        return bounce(s, trace, seeds, turn)
    if metric == 1:
        return jump_height(s, trace, seeds, turn)
    if metric == 2:
        return jump_angle(s, trace, seeds, turn)
    if metric == 3 or metric == 4:
        return contact_force(s, trace, seeds, turn, -1.0 if metric == 3 else 1.0)
    if metric == 5:
        return seating_velocity(s, trace, seeds, turn)
    if metric == 6:
        return impact_velocity(s, trace, seeds, turn)
    return dynamic_area(s, trace, seeds, turn)


@inner
def bounce(s, trace, seeds, turn):
    touched, opened, start, end, nominal, _ = closed_window(s, trace, turn)
    if touched < 0:
        return (np.nan if opened else 0.0), NONE
    value, k, length, slope, second = largest(s, trace, s.train.seat, SEPARATED, 1.0, start, end)
    at_start = k >= 0 and abs(trace.angle[k] + length * s.cam.speed * s.step - start) < 1e-12
    if k < 0 or value <= 0.0 or (at_start and nominal < 0):  # at the touch the distance is zero except for rounding
        return 0.0, NONE
    unit = 1.0 / (touch_line(s.train, s.train.seat)[1] * MM)  # the watch of an open contact is slope times separation
    if seeds is not None:
        seed_separation(s, seeds, k, length, s.train.seat, 1.0 / MM)
        if at_start:
            by_lash = seed_nominal(s, trace, seeds, k, length, slope * unit / s.step)
            seed_leaked(s, trace, seeds, turn, touched, by_lash)
        else:
            seed_end(s, trace, seeds, k, length, slope * unit)
    return value * unit, second * unit


@njit_no_refcount
def event(s, turn):
    """Angles [rad] between which jump and contact forces are evaluated: half the duration before and after the nose."""
    return 2 * np.pi * turn - s.half_duration, 2 * np.pi * turn + s.half_duration


@inner
def jump_height(s, trace, seeds, turn):
    best, where, at, slope, contact, second = 0.0, -1, 0.0, 0.0, -1, NONE
    low, high = event(s, turn)
    for e in s.train.cam_side:
        value, k, length, steep, runner = largest(s, trace, e, SEPARATED, 1.0, low, high)
        unit = 1.0 / (touch_line(s.train, e)[1] * MM)
        second = max(second, runner * unit, min(best, value * unit) if k >= 0 and contact >= 0 else NONE)
        if k >= 0 and value * unit > best:
            best, where, at, slope, contact = value * unit, k, length, steep * unit, e
    if seeds is not None:
        if where >= 0:
            seed_separation(s, seeds, where, at, contact, 1.0 / MM)
            seed_end(s, trace, seeds, where, at, slope)
    return best, second


@inner
def contact_force(s, trace, seeds, turn, sign):
    """The largest (sign 1) or smallest (sign -1) contact force [N]; the force of an open contact is zero."""
    best, where, at, slope, contact, second = NONE, -1, 0.0, 0.0, -1, NONE
    low, high = event(s, turn)
    for e in s.train.cam_side:
        for k in range(len(trace.length)):
            inside = trace.angle[k] < high and trace.angle[k + 1] > low
            if sign < 0.0 and inside and s.tables.states[trace.slot[k], e] != ACTING:
                return 0.0, NONE
        value, k, length, steep, runner = largest(s, trace, e, ACTING, sign, low, high)
        second = max(second, runner, min(best, value))
        if value > best:
            best, where, at, slope, contact = value, k, length, steep, e
    if where < 0:
        return 0.0, NONE
    if seeds is not None:
        seed_force(s, trace, seeds, where, at, contact, 1.0)
        seed_end(s, trace, seeds, where, at, sign * slope)
    return sign * best, sign * second


@inner
def jump_angle(s, trace, seeds, turn):
    low, high = event(s, turn)
    best, second, contact = 0.0, NONE, -1
    for e in s.train.cam_side:
        total = 0.0
        for k in range(len(trace.length)):
            if s.tables.states[trace.slot[k], e] == SEPARATED:
                total += max(0.0, min(high, trace.angle[k + 1]) - max(low, trace.angle[k]))
        if total > best:
            best, second, contact = total, best, e
    if seeds is not None:
        for k in range(len(trace.length)):
            if contact < 0 or s.tables.states[trace.slot[k], contact] != SEPARATED:
                continue
            if low < trace.angle[k] < high and k > 0 and trace.watch[k - 1] >= 0:
                seeds.time[k - 1] -= seeds.weight[0] * s.cam.speed / DEG
            if low < trace.angle[k + 1] < high and trace.watch[k] >= 0:
                seeds.time[k] += seeds.weight[0] * s.cam.speed / DEG
    return best / DEG, second / DEG


@inner
def seed_speed(s, trace, seeds, k):
    """The speed [m/s] with which the valve reaches its seat at the end of segment k, with its cotangents."""
    n, y = len(s.train.mass), trace.y[k + 1]
    if seeds is not None:
        observe(seeds, k, trace.length[k])[n + s.train.valve] -= seeds.weight[0]
        seeds.time[k] -= seeds.weight[0] * acceleration(s, trace.slot[k], y, s.train.valve)
    return -y[n + s.train.valve]


@inner
def seating_velocity(s, trace, seeds, turn):
    k, opened = touch(s, trace, turn)
    if k < 0:
        return (np.nan if opened else 0.0), NONE
    return seed_speed(s, trace, seeds, k), NONE


@inner
def impact_velocity(s, trace, seeds, turn):
    touched, opened, start, end, _, _ = closed_window(s, trace, turn)
    if touched < 0:
        return (np.nan if opened else 0.0), NONE
    best, where, second, n = 0.0, -1, NONE, len(s.train.mass)
    for k in range(len(trace.length)):
        if start <= trace.angle[k + 1] <= end and closes(s, trace, k, s.train.seat):
            speed = -trace.y[k + 1, n + s.train.valve]
            second = max(second, min(best, speed)) if where >= 0 else NONE
            if speed > best:
                best, where = speed, k
    return (seed_speed(s, trace, seeds, where) if where >= 0 else 0.0), second


@inner
def dynamic_area(s, trace, seeds, turn):
    """Integral of the valve's distance from its seat over the cam angle while it is open [mm deg]."""
    total, unit = 0.0, s.cam.speed * s.step / (MM * DEG)
    w, there = np.zeros(TERMS + 1), np.zeros(trace.y.shape[1])
    for k in range(len(trace.length)):
        inside = abs(0.5 * (trace.angle[k] + trace.angle[k + 1]) - 2 * np.pi * turn) <= np.pi
        if inside and s.tables.states[trace.slot[k], s.train.seat] == SEPARATED:
            total += distance_integral(s, trace, k, w, there)
            if seeds is not None:
                seed_integral(s, trace, seeds, k, unit)
    return total * unit, NONE


@compiled
def evaluate(s, trace, seeds, metrics, weights, turn, values):
    """Fill values (l, 2: value, runner-up) of the metrics of a revolution.

    `seeds` then holds the cotangents of the weighted sum of the values. They are NaN if a value and its runner-up are
    TIED: there the metric has a kink and no gradient.
    """
    last = len(trace.length) - 1
    clear(seeds, last + 1)
    for i in range(len(metrics)):
        seeds.weight[0] = weights[i]
        value, second = measure(metrics[i], s, trace, seeds, turn)
        values[i, 0], values[i, 1] = value, second
        if weights[i] != 0.0 and abs(value - second) <= TIED * abs(value):
            observe(seeds, last, trace.length[last])[:] = np.nan


@compiled
def closings_margin(s, trace):
    """(slowest closing of a damped contact [m/s], smallest local minimum of the separation of an open one [m]).

    Each is infinite if there is none.
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
    """Fill rows (m, 2n + r + 2 + e) with x, v, z, lift, lift velocity and the elements' forces at m instants."""
    at = s.tables.sizes.state
    for i in range(len(segments)):
        y = state_at(s, trace, segments[i], lengths[i])
        rows[i, : at + 1] = y[: at + 1]
        rows[i, at + 1] = y[at + 1] / s.step
    element_forces(s.train, s.tables.pieces, trace.slot[segments], rows, rows[:, at + 2 :])


@compiled
def collect(s, trace, seeds, segments, lengths, bar):
    """Fill `seeds` from the cotangents bar (m, 2n + r + 2 + e) of the rows of `sample`."""
    begin = s.tables.sizes.state + 2
    clear(seeds, len(trace.length))
    for i in range(len(bar)):
        k = segments[i]
        observe(seeds, k, lengths[i])[:] = bar[i, :begin]
        for e in range(bar.shape[1] - begin):
            if bar[i, begin + e] != 0.0 and s.tables.states[trace.slot[k], e] == ACTING:
                seed_force(s, trace, seeds, k, lengths[i], e, bar[i, begin + e])
