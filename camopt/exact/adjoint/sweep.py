"""The discrete adjoint of event-exact: one sweep back over a trace, with the saltation where a damped contact closes.

Within a segment, the exact propagator carries a change of the state forward, so its transpose carries a cotangent back.
At a switching the accelerations jump only where a contact closes, because its force sets in at damping * d'. With m the
compression beyond the touch, a change dm of it moves the switching time by -dm / d', and the state behind the switching
then changes by that time multiplied by the jump of the accelerations (saltation; Aizerman and Gantmakher 1958, Hiskens
and Pai 2000). The jump is proportional to d', so that the quotient, the damping over the masses, is regular however
slowly the contact closes. At every other switching the accelerations are continuous and the saltation matrix is the
identity.
"""

import numpy as np

from camopt.exact.adjoint.integrals import integrals_back
from camopt.exact.kernel.advance import carry_back
from camopt.exact.kernel.borrowing import borrowing
from camopt.exact.kernel.instants import compression, state_at
from camopt.exact.kernel.tables import ACTING, SEPARATED
from camopt.programs import compiled

MOST_POINTS = 14
"""Largest number of Gauss points in one segment."""
POINTS, SHARES = np.zeros((2, MOST_POINTS + 1, MOST_POINTS))
for _n in range(1, MOST_POINTS + 1):
    _x, _w = np.polynomial.legendre.leggauss(_n)
    POINTS[_n, :_n], SHARES[_n, :_n] = (_x + 1) / 2, _w / 2


@borrowing
def lift_back(bar, offset, scale, by_piece):
    """Adds to by_piece (q) the cotangent by a piece's coefficients that follows from `bar`.

    `bar` (q) is the cotangent of what `lift_series` gives; it is destroyed.
    """
    q, power = len(bar), 1.0
    for k in range(q):
        bar[k] *= power
        power *= scale
    if offset != 0.0:
        for low in range(q - 2, -1, -1):
            for k in range(low, q - 1):
                bar[k + 1] += offset * bar[k]
    for k in range(q):
        by_piece[k] += bar[k]


@borrowing
def lift_point_back(lift_bar, rate_bar, offset, cam_speed, by_piece):
    """Adds to by_piece (q) the cotangent that follows from those of the lift [m] and its velocity [m/s] at one angle.

    The angle is `offset` [rad] from the piece's start.
    """
    power, before = 1.0, 0.0
    for k in range(len(by_piece)):
        by_piece[k] += lift_bar * power + rate_bar * cam_speed * k * before
        before, power = power, power * offset


@compiled
def switch_back(s, trace, seeds, k, bar, by_coefficients, by_element):
    """Carries `bar` (2n) from after the switching that ends segment k to before it."""
    train = s.train
    slot, n = trace.slot[k], len(train.mass)
    e = s.tables.element[slot, trace.watch[k]]
    rate = compression(s, e, trace.y[k + 1])[1]
    pull = 0.0
    if s.tables.states[slot, e] == SEPARATED and rate > 0.0:
        pull += train.damping[e] * ((bar[n + train.a[e]] / train.mass[train.a[e]]) if train.a[e] >= 0 else 0.0)
        pull -= train.damping[e] * ((bar[n + train.b[e]] / train.mass[train.b[e]]) if train.b[e] >= 0 else 0.0)
    if seeds.time[k] != 0.0 and rate != 0.0:
        pull += seeds.time[k] / rate
    if pull == 0.0:
        return
    if train.a[e] >= 0:
        bar[train.a[e]] -= pull
    if train.b[e] >= 0:
        bar[train.b[e]] += pull
    if train.cam_driven[e]:
        end = trace.offset[k] + trace.length[k] * s.step * s.cam.speed
        lift_point_back(-pull, 0.0, end, s.cam.speed, by_coefficients[trace.piece[k]])
    by_element[0, e] += pull * train.preload[e] / train.stiffness[e] ** 2
    by_element[2, e] -= pull / train.stiffness[e]
    by_element[3, e] += pull


@borrowing
def forces_back(train, state, h, y, bar, share, by_mass, by_element):
    """Adds share times the cotangent `bar` (2n + q) times the derivatives of all accelerations by the parameters."""
    n = len(train.mass)
    for m in range(n):  # -bar_v / mass * acceleration, the acceleration force by force
        push = share * bar[n + m] / train.mass[m]
        by_mass[0, m] -= push * (train.mass_force[m] - train.mass_damping[m] * y[n + m]) / train.mass[m]
        by_mass[1, m] -= push * y[n + m]
        by_mass[2, m] += push
    for e in range(len(train.a)):
        if state[e] != ACTING:
            continue
        d, rate, p, q = -train.gap[e], 0.0, train.a[e], train.b[e]
        if p >= 0:
            d, rate = d + y[p], rate + y[n + p]
        if q >= 0:
            d, rate = d - y[q], rate - y[n + q]
        if train.cam_driven[e]:
            d, rate = d + y[2 * n], rate + y[2 * n + 1] / h
        force, push = train.preload[e] + train.stiffness[e] * d + train.damping[e] * rate, 0.0
        if p >= 0:
            pushed = share * bar[n + p] / train.mass[p]
            push -= pushed
            by_mass[0, p] += pushed * force / train.mass[p]
        if q >= 0:
            pushed = share * bar[n + q] / train.mass[q]
            push += pushed
            by_mass[0, q] -= pushed * force / train.mass[q]
        by_element[0, e] += push * d
        by_element[1, e] += push * rate
        by_element[2, e] += push
        by_element[3, e] -= push * train.stiffness[e]


@compiled
def parameters_back(s, trace, k, length, bar, linear, square, by_mass, by_element, work):
    """Adds what the parameters contribute between the start of segment k and the instant `length` steps later.

    That is the integral of the cotangent times the derivatives of the accelerations. `bar` (2n) is the cotangent at
    `length`; `linear` and `square` are those of the integrals of the seat's distance and its square on the way.
    """
    # the product of state and cotangent turns by 3 rad per step at most: so many points leave 1e-7 of the highest mode
    slot, h, count = trace.slot[k], s.step, min(int(np.ceil(1.25 * length)) + 4, MOST_POINTS)
    motion, state = s.tables.acceleration[slot], s.tables.states[slot]
    there = np.empty(trace.y.shape[1])
    for i in range(count):
        at, share = POINTS[count, i] * length, SHARES[count, i] * length * h
        y = state_at(s, trace, k, at)
        carry_back(s.tables, slot, motion, h, length - at, bar, there, work)
        if linear != 0.0 or square != 0.0:
            integrals_back(s, slot, y, length - at, linear, square, there)
        forces_back(s.train, state, h, y, there, share, by_mass, by_element)


@compiled
def sweep(s, trace, seeds, bar, by_coefficients, by_mass, by_element):
    """Carries `bar` (2n), the cotangent of the end state, back to the start in place, and adds the seeds on the way.

    Adds to by_coefficients (p, q); to by_mass (3, n: mass, damping, force) and by_element (4, e: stiffness, damping,
    preload, gap) where by_mass has rows.
    """
    n2, mechanical, per_step = len(bar), len(by_mass) > 0, s.cam.speed * s.step
    width = trace.y.shape[1]
    start, out = np.empty(width), np.empty(width)
    work = np.empty(width), np.empty(width), np.empty(s.tables.acceleration.shape[2])
    motion, h, cam_speed = s.tables.acceleration, s.step, s.cam.speed
    for k in range(len(trace.length) - 1, -1, -1):
        if trace.watch[k] >= 0:
            switch_back(s, trace, seeds, k, bar, by_coefficients, by_element)
        slot, piece, i = trace.slot[k], by_coefficients[trace.piece[k]], seeds.head[k]
        start[:] = 0.0
        while i >= 0:
            seen, length = seeds.bar[i], seeds.length[i]
            if seen[n2] != 0.0 or seen[n2 + 1] != 0.0:
                lift_point_back(seen[n2], seen[n2 + 1], trace.offset[k] + length * per_step, cam_speed, piece)
            if length == trace.length[k]:
                for j in range(n2):
                    bar[j] += seen[j]
            elif length == 0.0:
                for j in range(n2):
                    start[j] += seen[j]
            else:
                carry_back(s.tables, slot, motion[slot], h, length, seen[:n2], out, work)
                for j in range(width):
                    start[j] += out[j]
                if mechanical:
                    parameters_back(s, trace, k, length, seen[:n2], 0.0, 0.0, by_mass, by_element, work)
            i = seeds.following[i]
        if mechanical:
            length, linear, square = trace.length[k], seeds.integral[k], seeds.square[k]
            parameters_back(s, trace, k, length, bar, linear, square, by_mass, by_element, work)
        carry_back(s.tables, slot, motion[slot], h, trace.length[k], bar, out, work)
        for j in range(width):
            start[j] += out[j]
        if seeds.integral[k] != 0.0 or seeds.square[k] != 0.0:
            integrals_back(s, slot, trace.y[k], trace.length[k], seeds.integral[k], seeds.square[k], start)
        for j in range(n2):
            bar[j] = start[j]
        lift_back(start[n2:], trace.offset[k], per_step, piece)
    by_element += seeds.element
