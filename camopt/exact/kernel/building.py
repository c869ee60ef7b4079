"""The propagators of one combination of pieces in compiled code: the equations of motion and their exponential."""

import numpy as np

from camopt.exact.kernel.elements import form_row, lift_at, touch_line
from camopt.exact.kernel.tables import FINE, SEPARATED, TERMS
from camopt.programs import compiled, inner

ORDERS = 16
"""Highest power in the series of an exponential whose matrix has a spectral radius below 0.1."""


@compiled
def linear_system(train, status):
    """Matrix (2n + r, 2n + r + 3 + f) that gives the rates of x, v, z from x, v, z, lift, lift velocity, the forces
    over the cam angle and 1, in SI units, for the pieces `status` (e), which are numbered within their elements."""
    n, at = len(train.mass), lift_at(train)
    motion = np.zeros((at, at + 3 + len(train.forced)))
    for i in range(n):
        motion[i, n + i] = 1.0
        motion[n + i, n + i] = -train.mass_damping[i] / train.mass[i]
        motion[n + i, -1] = train.mass_force[i] / train.mass[i]
    for j in range(len(train.forced)):
        motion[n + train.forced[j], at + 2 + j] += 1.0 / train.mass[train.forced[j]]
    row = np.empty(motion.shape[1])
    for e in range(len(train.a)):
        piece = train.first[e] + status[e]
        form_row(train, e, train.law[piece], row)
        for pushed, sign in ((train.a[e], -1.0), (train.b[e], 1.0)):
            if pushed >= 0:
                motion[n + pushed] += sign / train.mass[pushed] * row
        if train.memory[e] >= 0:
            form_row(train, e, train.law[len(train.state) + piece], row)
            motion[2 * n + train.memory[e]] += row
    return motion


@inner
def by_state(row, h, sizes, out):
    """Write to out (c) the coefficients of y and 1 that correspond to a row of `linear_system`; h [s] is the step."""
    at, q = sizes.state, sizes.lift
    out[:] = 0.0
    out[: at + 1] = row[: at + 1]
    if q > 1:
        out[at + 1] = row[at + 1] / h  # the coefficient of tau is the lift velocity times the step
    for j in range(sizes.forces):
        out[at + q + 2 * j] = row[at + 2 + j]
    out[-1] = row[-1]


@inner
def per_step(motion, h, sizes):
    """Matrix (c, c) of d/dtau of (x, v, z, u, 1), from `linear_system`; tau is the time in steps h [s]."""
    at, q = sizes.state, sizes.lift
    c = at + q + 2 * sizes.forces + 1
    system = np.zeros((c, c))
    for i in range(at):
        by_state(motion[i] * h, h, sizes, system[i])
    for k in range(q - 1):
        system[at + k, at + k + 1] = k + 1.0
    for j in range(at + q, c - 1, 2):
        system[j, j + 1] = 1.0
    return system


@inner(fastmath={"contract"})
def product(left, right, out):
    """Write left @ right to out. Groups of four zeros in `left`, of which the lift's rows have many, are skipped."""
    out[:] = 0.0
    count = len(right)
    for i in range(len(left)):
        for k in range(0, count - 3, 4):  # so that the result is loaded and stored a quarter as often
            a, b, c, d = left[i, k], left[i, k + 1], left[i, k + 2], left[i, k + 3]
            if a != 0.0 or b != 0.0 or c != 0.0 or d != 0.0:
                for j in range(right.shape[1]):
                    first = (out[i, j] + a * right[k, j]) + b * right[k + 1, j]
                    out[i, j] = (first + c * right[k + 2, j]) + d * right[k + 3, j]
        for k in range(count - count % 4, count):
            share = left[i, k]
            if share != 0.0:
                for j in range(right.shape[1]):
                    out[i, j] += share * right[k, j]


@inner
def exponential(matrix):
    """exp(matrix) by its power series, for a spectral radius below 0.1.

    The entries of the matrix differ by many orders of magnitude (a position by a velocity, a coefficient of the lift by
    another). The series keeps the relative accuracy of each; scaling and squaring would lose it.
    """
    total, term, new = np.eye(len(matrix)), np.eye(len(matrix)), np.empty_like(matrix)
    for k in range(1, ORDERS + 1):
        product(term, matrix, new)
        term[:] = new / k
        total += term
    return total


@inner
def powers(leap, most):
    """leap^i for i = 0 to most, each a product of two halves: rounding grows only as the logarithm of `most`."""
    result = np.empty((most + 1, len(leap), len(leap)))
    result[0] = np.eye(len(leap))
    result[1] = leap
    for i in range(2, most + 1):
        product(result[i // 2], result[i - i // 2], result[i])
    return result


@inner
def watches(train, h, tables, slot, rows):
    """Write the watches of a combination of pieces: their rows (w, c), elements and numbers. Returns their count."""
    count, row = 0, np.empty(tables.motion.shape[1])
    for e in range(len(train.a)):
        piece = tables.pieces[slot, e]
        for w in range(train.watched[piece], train.watched[piece + 1]):
            form_row(train, e, train.law[w], row)
            by_state(row, h, tables.sizes, rows[count])
            tables.element[slot, count], tables.watch[slot, count] = e, w
            count += 1
    tables.count[slot] = count
    return count


@inner
def seat_row(train, sizes, row):
    """Write the row (c) of the signed distance [m] of the valve from its seat."""
    row[:], seat = 0.0, train.seat
    if seat < 0:
        return
    constant, slope = touch_line(train, seat)
    si_row = np.empty(sizes.state + 3 + sizes.forces)
    form_row(train, seat, np.array([-constant / slope, -1.0, 0.0, 0.0]), si_row)
    by_state(si_row, 1.0, sizes, row)


@inner
def write_looks(rows, system, steps, count, at, out):
    """Write values and slopes per step of `count` rows at every step to the columns of out from `at` on."""
    both = np.empty((2 * count, len(system)))
    both[:count] = rows[:count]
    product(rows[:count], system, both[count:])
    values = np.empty_like(both)
    for i in range(len(steps)):
        product(both, steps[i], values)
        for w in range(2 * count):
            out[:, at + 2 * count * i + w] = values[w]


@inner
def slot_of(train, h, tables, status):
    """The slot of the tables for the pieces `status` (e), which is filled if it is new; -1 if the tables are full."""
    key, built = 0, tables.built[0]
    for e in range(len(status)):
        key += train.place[e] * status[e]
    for slot in range(built):
        if tables.keys[slot] == key:
            return slot
    if built == len(tables.keys):
        return -1
    fill(train, h, tables, built, status)
    tables.keys[built], tables.built[0] = key, built + 1
    return built


@inner(_nrt=True)  # stated because numba would take over the flag of a caller that allocates no array
def fill(train, h, tables, slot, status):
    """Write the tables of the pieces `status` (e), which are numbered within their elements, to a slot."""
    n, c = len(train.mass), tables.span.shape[1]
    for e in range(len(train.a)):
        tables.pieces[slot, e] = train.first[e] + status[e]
        tables.states[slot, e] = train.state[tables.pieces[slot, e]]
    motion = linear_system(train, status)
    system = per_step(motion, h, tables.sizes)
    fine = powers(exponential(system / FINE), FINE)
    steps = powers(fine[FINE], tables.steps.shape[1] - 1)
    for i in range(len(steps)):
        tables.steps[slot, i] = steps[i, :-1].T
    for i in range(FINE):
        tables.fine[slot, i] = fine[i, :-1].T
    tables.span[slot, :, : c - 1] = steps[-1, :-1].T
    rows, new = np.zeros((tables.element.shape[1] + 1, c)), np.zeros((tables.element.shape[1] + 1, c))
    count = watches(train, h, tables, slot, rows)
    write_looks(rows, system, steps, count, c - 1, tables.span[slot])
    for k in range(TERMS + 1):
        for w in range(count):
            tables.series[slot, w, :, k] = rows[w]
        product(rows, system, new)
        rows[:] = new / (k + 1)
    seat_row(train, tables.sizes, rows[0])
    write_looks(rows, system, steps, 1, 0, tables.distance[slot])
    tables.motion[slot] = motion[n:].T
    tables.rates[slot] = motion[n:, :-1]
    write_integral(train, tables, slot)


@inner
def write_integral(train, tables, slot):
    """Write the integral of the seat's distance over 0 to m steps: step by step from its power series if the seat
    contact is separated, and zero otherwise."""
    rows, c, seat = tables.integral[slot], tables.span.shape[1], train.seat
    rows[:] = 0.0
    if seat < 0 or tables.states[slot, seat] != SEPARATED:
        return
    per_step, slope = np.zeros(c), touch_line(train, seat)[1]
    for w in range(tables.count[slot]):
        if tables.element[slot, w] == seat:
            for k in range(TERMS + 1):
                per_step += tables.series[slot, w, :, k] / ((k + 1) * slope)
    for i in range(len(rows) - 1):
        for j in range(c):
            total = 0.0
            for r in range(c - 1):
                total += tables.steps[slot, i, j, r] * per_step[r]
            rows[i + 1, j] = rows[i, j] + total
        rows[i + 1, c - 1] += per_step[c - 1]
