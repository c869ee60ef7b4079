"""The discrete adjoint of event-exact: one backward sweep over a trace, with the saltation where rates jump.

Within a segment the exact propagator carries a perturbation of the state forward, so that its transpose carries a
cotangent back. A switching happens where a watch w falls through zero. A perturbation dw moves the instant by -dw / w',
and the state after it changes by that time multiplied by the jump of the rates (saltation; Aizerman and Gantmakher
1958, Hiskens and Pai 2000). Rates jump at three kinds of switching only: the acceleration where a damped contact
closes, because its force begins at damping * d', and where the damper of a law of contacts changes from chord to chord;
and the rate of a memory where an element begins to slide or to refill, because it follows d'. All jumps are
proportional to d', like w', so that their quotient, the watch's `kick`, depends on the train alone and stays regular at
arbitrarily slow switchings. At every other switching the saltation matrix is the identity.
"""

from typing import NamedTuple

import numpy as np

from camopt.exact.adjoint.integrals import integral_back
from camopt.exact.adjoint.seeds import form_back, law_back
from camopt.exact.kernel.advance import carry_back
from camopt.exact.kernel.elements import compression, memory_of, value
from camopt.exact.kernel.instants import state_at
from camopt.exact.kernel.tables import ACTING
from camopt.programs import compiled, inner, njit_no_refcount

MOST_POINTS = 14
"""Largest number of Gauss points in one segment."""
POINTS, SHARES = np.zeros((2, MOST_POINTS + 1, MOST_POINTS))
for _n in range(1, MOST_POINTS + 1):
    _x, _w = np.polynomial.legendre.leggauss(_n)
    POINTS[_n, :_n], SHARES[_n, :_n] = (_x + 1) / 2, _w / 2


class Bars(NamedTuple):
    """Cotangents of one number, to which a sweep adds."""

    start: np.ndarray  # (2n + r) of the state at the end of the trace; after the sweep, of that at its start
    coefficients: np.ndarray  # (p, q + 2f) of the pieces of lift and forces
    mass: np.ndarray  # (3, n) of mass, damping and force; without rows if they are not requested
    law: np.ndarray  # (2p + w, 4) of the forms of the elements' pieces: forces, flows, watches
    gap: np.ndarray  # (e)


@njit_no_refcount
def inputs_back(bar, forces, offset, scale, by_piece):
    """Add to by_piece (q + 2f) the cotangent of a piece's coefficients that follows from `bar`.

    `bar` (q + 2f) is the cotangent of the result of `inputs_at`; it is overwritten.
    """
    q, power = len(bar) - 2 * forces, 1.0
    for k in range(q):
        bar[k] *= power
        power *= scale
    if offset != 0.0:
        for low in range(q - 2, -1, -1):
            carried = bar[low]  # held in a register, which halves the time
            for k in range(low + 1, q):
                carried = bar[k] + offset * carried
                bar[k] = carried
    for k in range(q, len(bar), 2):
        bar[k + 1] = bar[k + 1] * scale + offset * bar[k]
    for k in range(len(bar)):
        by_piece[k] += bar[k]


@njit_no_refcount
def lift_point_back(lift_bar, rate_bar, offset, cam_speed, q, by_piece):
    """Add to by_piece, whose first q numbers belong to the lift, the cotangent that follows from those of the lift [m]
    and its velocity [m/s] at one angle, `offset` [rad] from the piece's start.
    """
    power, before = 1.0, 0.0
    for k in range(q):
        by_piece[k] += lift_bar * power + rate_bar * cam_speed * k * before
        before, power = power, power * offset


@njit_no_refcount
def switch_back(s, trace, seeds, k, bars, state_bar):
    """Carry the cotangent bars.start from after the switching that ends segment k to before it. `state_bar`
    (2n + r + 2) is a work array for the cotangents of state, lift and lift velocity."""
    train, sizes, slot, bar = s.train, s.tables.sizes, trace.slot[k], bars.start
    e, w = s.tables.element[slot, trace.watch[k]], s.tables.watch[slot, trace.watch[k]]
    by_force, by_flow = train.kick[w, 0], train.kick[w, 1]
    if by_force == 0.0 and by_flow == 0.0 and seeds.time[k] == 0.0:
        return
    y, n = trace.y[k + 1], sizes.masses
    rate = watch_rate(s, slot, trace.watch[k], y)
    if rate >= 0.0:
        return
    pull = -seeds.time[k] / rate
    if train.a[e] >= 0:
        pull -= by_force * bar[n + train.a[e]] / train.mass[train.a[e]]
    if train.b[e] >= 0:
        pull += by_force * bar[n + train.b[e]] / train.mass[train.b[e]]
    if train.memory[e] >= 0:
        pull += by_flow * bar[2 * n + train.memory[e]]
    if pull == 0.0:
        return
    state_bar[:] = 0.0
    form_back(train, e, train.law[w], pull, state_bar)
    for i in range(sizes.state):
        bar[i] += state_bar[i]
    if train.cam_driven[e]:
        end = trace.offset[k] + trace.length[k] * s.step * s.cam.speed
        piece = bars.coefficients[trace.piece[k]]
        lift_point_back(state_bar[sizes.state], state_bar[sizes.state + 1], end, s.cam.speed, sizes.lift, piece)
    d, speed = compression(train, e, s.step, y)
    where = d, speed, memory_of(train, e, y)
    law_back(train, e, w, train.law[w], where, pull, bars.law, bars.gap)


@njit_no_refcount
def watch_rate(s, slot, watch, y):
    """Rate [1/s] of a watch in a state y."""
    series = s.tables.series[slot, watch]
    total = series[len(y), 1]
    for j in range(len(y)):
        total += series[j, 1] * y[j]
    return total / s.step


@njit_no_refcount
def rates_back(s, slot, y, bar, share, bars):
    """Add share times the cotangent `bar` of y times the derivatives of all rates by the parameters of the train."""
    train, sizes, by_mass = s.train, s.tables.sizes, bars.mass
    n = sizes.masses
    for m in range(n):  # -bar_v / mass * acceleration, the acceleration force by force
        push = share * bar[n + m] / train.mass[m]
        by_mass[0, m] -= push * (train.mass_force[m] - train.mass_damping[m] * y[n + m]) / train.mass[m]
        by_mass[1, m] -= push * y[n + m]
        by_mass[2, m] += push
    for j in range(sizes.forces):
        m = train.forced[j]
        by_mass[0, m] -= share * bar[n + m] * y[sizes.state + sizes.lift + 2 * j] / train.mass[m] ** 2
    for e in range(len(train.a)):
        if s.tables.states[slot, e] != ACTING:
            continue  # such a piece depends on no parameter of the train
        d, rate = compression(train, e, s.step, y)
        piece, p, q, push = s.tables.pieces[slot, e], train.a[e], train.b[e], 0.0
        where = d, rate, memory_of(train, e, y)
        form = train.law[piece]
        force = value(form, d, rate, where[2])
        if p >= 0:
            pushed = share * bar[n + p] / train.mass[p]
            push -= pushed
            by_mass[0, p] += pushed * force / train.mass[p]
        if q >= 0:
            pushed = share * bar[n + q] / train.mass[q]
            push += pushed
            by_mass[0, q] -= pushed * force / train.mass[q]
        law_back(train, e, piece, form, where, push, bars.law, bars.gap)
        if train.memory[e] >= 0:
            flow = len(train.state) + piece
            push = share * bar[2 * n + train.memory[e]]
            law_back(train, e, flow, train.law[flow], where, push, bars.law, bars.gap)


@inner
def parameters_back(s, trace, k, length, bar, weight, bars, work):
    """Add the cotangents of the train's parameters from the first `length` steps of segment k.

    They are the integral of the cotangent times the derivatives of the rates. `bar` (2n + r) is the cotangent at
    `length`; `weight` is that of the integral of the seat's distance over these steps.
    """
    # the phase of state times cotangent advances by at most 3 rad per step: the error is then 1e-7 of the highest mode
    slot, h, count = trace.slot[k], s.step, min(int(np.ceil(1.25 * length)) + 4, MOST_POINTS)
    there = np.empty(trace.y.shape[1])
    for i in range(count):
        at, share = POINTS[count, i] * length, SHARES[count, i] * length * h
        y = state_at(s, trace, k, at)
        carry_back(s.tables, slot, h, length - at, bar, there, work)
        if weight != 0.0:
            integral_back(s, slot, length - at, weight, there)
        rates_back(s, slot, y, there, share, bars)


@compiled
def sweep(s, trace, seeds, bars):
    """Propagate bars.start, the cotangent of the end state, back to the start in place, adding the seeds on the way.

    The other `bars` are added to. The contributions of the motion between switchings to those of masses and laws are
    computed only if bars.mass has rows.
    """
    bar, mechanical, per_step = bars.start, len(bars.mass) > 0, s.cam.speed * s.step
    width, n2, q, forces = trace.y.shape[1], len(bars.start), s.tables.sizes.lift, s.tables.sizes.forces
    start, out, room = np.empty(width), np.empty(width), np.empty(n2 + 2)
    work = np.empty(width), np.empty(width), np.empty(s.tables.rates.shape[2])
    h, cam_speed = s.step, s.cam.speed
    for k in range(len(trace.length) - 1, -1, -1):
        if trace.watch[k] >= 0:
            switch_back(s, trace, seeds, k, bars, room)
        slot, piece, i = trace.slot[k], bars.coefficients[trace.piece[k]], seeds.head[k]
        start[:] = 0.0
        while i >= 0:
            seed, length = seeds.bar[i], seeds.length[i]
            if seed[n2] != 0.0 or seed[n2 + 1] != 0.0:
                lift_point_back(seed[n2], seed[n2 + 1], trace.offset[k] + length * per_step, cam_speed, q, piece)
            if length == trace.length[k]:
                for j in range(n2):
                    bar[j] += seed[j]
            elif length == 0.0:
                for j in range(n2):
                    start[j] += seed[j]
            else:
                carry_back(s.tables, slot, h, length, seed[:n2], out, work)
                for j in range(width):
                    start[j] += out[j]
                if mechanical:
                    parameters_back(s, trace, k, length, seed[:n2], 0.0, bars, work)
            i = seeds.following[i]
        if mechanical:
            parameters_back(s, trace, k, trace.length[k], bar, seeds.integral[k], bars, work)
        carry_back(s.tables, slot, h, trace.length[k], bar, out, work)
        for j in range(width):
            start[j] += out[j]
        if seeds.integral[k] != 0.0:
            integral_back(s, slot, trace.length[k], seeds.integral[k], start)
        for j in range(n2):
            bar[j] = start[j]
        inputs_back(start[n2:], forces, trace.offset[k], per_step, piece)
    bars.law[:] += seeds.law
    bars.gap[:] += seeds.gap
