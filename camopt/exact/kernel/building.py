"""The propagators of one contact state, worked out by compiled code: the equations of motion and their exponential."""

import numpy as np

from camopt.exact.kernel.tables import ACTING, COMPRESSED, FINE, SEPARATED, TERMS
from camopt.programs import compiled

ORDERS = 16
"""Powers in the series of an exponential whose matrix has a spectral radius below 0.1."""


@compiled
def linear_system(train, acting):
    """A (2n, 2n), and the columns (2n) of lift, lift velocity and constant, of y' = A y + ... for elements `acting`."""
    n = len(train.mass)
    a = np.zeros((2 * n, 2 * n))
    by_lift, by_velocity, constant = np.zeros(2 * n), np.zeros(2 * n), np.zeros(2 * n)
    for i in range(n):
        a[i, n + i] = 1.0
        a[n + i, n + i] = -train.mass_damping[i] / train.mass[i]
        constant[n + i] = train.mass_force[i] / train.mass[i]
    for e in range(len(train.a)):
        if not acting[e]:
            continue
        ends = ((train.a[e], -1.0), (train.b[e], 1.0))
        for pushed, sign in ends:
            if pushed < 0:
                continue
            push = sign / train.mass[pushed]  # acceleration by a unit force in the element
            for mass, side in ends:
                if mass >= 0:
                    a[n + pushed, mass] -= side * train.stiffness[e] * push
                    a[n + pushed, n + mass] -= side * train.damping[e] * push
            constant[n + pushed] += push * (train.preload[e] - train.stiffness[e] * train.gap[e])
            if train.cam_driven[e]:
                by_lift[n + pushed] += push * train.stiffness[e]
                by_velocity[n + pushed] += push * train.damping[e]
    return a, by_lift, by_velocity, constant


@compiled
def per_step(linear, h, c):
    """d/dtau of (x, v, u, 1), shape (c, c), from `linear_system`; tau is the time in steps h [s]."""
    a, by_lift, by_velocity, constant = linear
    n2 = len(constant)
    q = c - 1 - n2
    system = np.zeros((c, c))
    system[:n2, :n2] = a * h
    system[:n2, n2] = by_lift * h
    if q > 1:
        system[:n2, n2 + 1] = by_velocity  # the coefficient of tau is the lift velocity times the step
    system[:n2, -1] = constant * h
    for k in range(q - 1):
        system[n2 + k, n2 + k + 1] = k + 1.0
    return system


@compiled(fastmath={"contract"})
def product(left, right, out):
    """Writes left @ right to out; zeros on the left, of which the lift's rows have many, cost nothing."""
    out[:] = 0.0
    for i in range(len(left)):
        for k in range(len(right)):
            share = left[i, k]
            if share != 0.0:
                for j in range(right.shape[1]):
                    out[i, j] += share * right[k, j]


@compiled
def exponential(matrix):
    """exp(matrix) by its plain power series, for a spectral radius below 0.1.

    The elements have very different sizes (a position by a velocity, a coefficient of the lift by another). The series
    keeps the relative accuracy of each; scaling and squaring would lose it.
    """
    total, term, new = np.eye(len(matrix)), np.eye(len(matrix)), np.empty_like(matrix)
    for k in range(1, ORDERS + 1):
        product(term, matrix, new)
        term[:] = new / k
        total += term
    return total


@compiled
def powers(leap, most):
    """leap^i for i = 0 to most, each from two halves, so that rounding grows with the logarithm of `most` only."""
    found = np.empty((most + 1, len(leap), len(leap)))
    found[0] = np.eye(len(leap))
    found[1] = leap
    for i in range(2, most + 1):
        product(found[i // 2], found[i - i // 2], found[i])
    return found


@compiled
def watch_row(train, e, whole, status, h, row):
    """Writes the row (c) of a contact's elastic or whole force, with the sign that makes it positive."""
    n, q = len(train.mass), len(row) - 1 - 2 * len(train.mass)
    row[:] = 0.0
    for mass, sign in ((train.a[e], 1.0), (train.b[e], -1.0)):
        if mass >= 0:
            row[mass] += sign * train.stiffness[e]
            row[n + mass] += sign * train.damping[e] * whole
    if train.cam_driven[e]:
        row[2 * n] += train.stiffness[e]
        if q > 1:
            row[2 * n + 1] += train.damping[e] * whole / h
    row[-1] = train.preload[e] - train.stiffness[e] * train.gap[e]
    if not (status == ACTING or (status == COMPRESSED and not whole)):
        row *= -1.0


@compiled
def watches(train, h, tables, slot, rows):
    """Writes what is watched in a contact state: rows (w, c), elements and the states they change to."""
    count = 0
    for e in range(len(train.a)):
        status = tables.states[slot, e]
        if not train.contact[e]:
            continue
        for whole in (False, True):
            if (status == SEPARATED and whole) or (status == ACTING and not whole):
                continue
            watch_row(train, e, whole, status, h, rows[count])
            tables.element[slot, count] = e
            if status == ACTING:
                tables.new[slot, count] = COMPRESSED if train.damping[e] > 0.0 else SEPARATED
            else:
                tables.new[slot, count] = SEPARATED if status == COMPRESSED and not whole else ACTING
            count += 1
    tables.count[slot] = count
    return count


@compiled
def seat_row(train, seat, row):
    """Writes the row (c) of the signed distance [m] of the valve from its seat touch."""
    row[:] = 0.0
    if seat < 0:
        return
    for mass, sign in ((train.a[seat], -1.0), (train.b[seat], 1.0)):
        if mass >= 0:
            row[mass] += sign
    if train.cam_driven[seat]:
        row[2 * len(train.mass)] -= 1.0
    row[-1] = train.gap[seat] - train.preload[seat] / train.stiffness[seat]


@compiled
def write_looks(rows, system, steps, count, at, out):
    """Writes values and slopes by the step of `count` rows at every step to the columns of out from `at` on."""
    both = np.empty((2 * count, len(system)))
    both[:count] = rows[:count]
    product(rows[:count], system, both[count:])
    seen = np.empty_like(both)
    for i in range(len(steps)):
        product(both, steps[i], seen)
        for w in range(2 * count):
            out[:, at + 2 * count * i + w] = seen[w]


@compiled
def fill(train, seat, h, tables, slot, key):
    """Writes the tables of a contact state to a slot: digit i of `key` in base 3 is the state of contact i."""
    n, c = len(train.mass), tables.span.shape[1]
    tables.states[slot] = ACTING
    rest = key
    for e in range(len(train.a)):
        if train.contact[e]:
            tables.states[slot, e] = rest % 3
            rest //= 3
    linear = linear_system(train, tables.states[slot] == ACTING)
    system = per_step(linear, h, c)
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
    seat_row(train, seat, rows[0])
    write_looks(rows, system, steps, 1, 0, tables.distance[slot])
    tables.motion[slot, : 2 * n] = linear[0][n:].T
    tables.motion[slot, 2 * n], tables.motion[slot, 2 * n + 1] = linear[1][n:], linear[2][n:]
    tables.motion[slot, 2 * n + 2] = linear[3][n:]
    tables.acceleration[slot] = tables.motion[slot, :-1].T
    write_integral(train, seat, tables, slot)
    tables.keys[slot] = key


@compiled
def write_integral(train, seat, tables, slot):
    """Writes the seat's distance, integrated over so many steps: from its power series while the seat is apart, step
    by step, and zero otherwise."""
    rows, c = tables.integral[slot], tables.span.shape[1]
    rows[:] = 0.0
    if seat < 0 or tables.states[slot, seat] != SEPARATED:
        return
    one = np.zeros(c)
    for w in range(tables.count[slot]):
        if tables.element[slot, w] == seat:
            for k in range(TERMS + 1):
                one += tables.series[slot, w, :, k] / ((k + 1) * train.stiffness[seat])
    for i in range(len(rows) - 1):
        for j in range(c):
            total = 0.0
            for r in range(c - 1):
                total += tables.steps[slot, i, j, r] * one[r]
            rows[i + 1, j] = rows[i, j] + total
        rows[i + 1, c - 1] += one[c - 1]
