"""Advances a state by any length within a span, and carries a cotangent back over it by the transposed operation.

A length is divided into whole steps, a fine node and a small rest. The first two have ready propagators; the rest takes
a short power series of the equations of motion, so that any instant costs little more than a node.
"""

from camopt.exact.kernel.borrowing import borrowing
from camopt.exact.kernel.tables import FINE

ORDER = 7
"""Highest power of the series that follows a fine node: its remainder is below 1e-15 of the highest mode's motion."""


@borrowing(fastmath={"contract"})
def apply(matrix, y, columns, used, out):
    """Writes to out (used) the first rows of a transposed matrix times the first `columns` of y, plus its constant."""
    constant = matrix[len(y)]
    for i in range(used):
        out[i] = constant[i]
    j = 0
    while j + 8 <= columns:  # many columns per pass: the result is loaded and stored an eighth as often
        a, b, c, d = y[j], y[j + 1], y[j + 2], y[j + 3]
        e, f, g, h = y[j + 4], y[j + 5], y[j + 6], y[j + 7]
        for i in range(used):
            first = (matrix[j, i] * a + matrix[j + 1, i] * b) + (matrix[j + 2, i] * c + matrix[j + 3, i] * d)
            second = (matrix[j + 4, i] * e + matrix[j + 5, i] * f) + (matrix[j + 6, i] * g + matrix[j + 7, i] * h)
            out[i] += first + second
        j += 8
    while j + 4 <= columns:
        a, b, c, d = y[j], y[j + 1], y[j + 2], y[j + 3]
        for i in range(used):
            out[i] += (matrix[j, i] * a + matrix[j + 1, i] * b) + (matrix[j + 2, i] * c + matrix[j + 3, i] * d)
        j += 4
    while j < columns:
        for i in range(used):
            out[i] += matrix[j, i] * y[j]
        j += 1


@borrowing
def split(length, most):
    """(whole steps, fine node, rest) of a length [steps] of at most `most`; the rest is at most 1 / (2 FINE) steps."""
    nearest = min(max(int(length * FINE + 0.5), 0), most * FINE)
    return nearest // FINE, nearest % FINE, length - nearest / FINE


@borrowing(fastmath={"contract"})
def short_series(motion, h, used, tau, y, term, acceleration):
    """Adds to x and v in y (2n + q) their change over tau, a small part of a step, by power series.

    Only the first `used` of the lift's coefficients in y differ from zero.
    """
    n, power = len(acceleration), 1.0
    n2 = 2 * n
    for i in range(n2):
        term[i] = y[i]
    for i in range(n):
        acceleration[i] = motion[n2 + 2, i]
    for k in range(ORDER):
        term[n2] = y[n2 + k] * power if k < used else 0.0
        term[n2 + 1] = (k + 1) * y[n2 + k + 1] * power / h if k + 1 < used else 0.0
        j = 0
        while j < n2:
            a, b = term[j], term[j + 1]
            for i in range(n):
                acceleration[i] += motion[j, i] * a + motion[j + 1, i] * b
            j += 2
        a, b = term[n2], term[n2 + 1]
        share = tau * h / (k + 1)
        power *= tau
        for i in range(n):
            rate = (acceleration[i] + (motion[n2, i] * a + motion[n2 + 1, i] * b)) * share
            term[i] = term[n + i] * share
            term[n + i] = rate
            acceleration[i] = 0.0
        for i in range(n2):
            y[i] += term[i]


@borrowing
def copy(source, target):
    """Writes one vector over another; for so short ones quicker than an assignment of slices."""
    for i in range(len(target)):
        target[i] = source[i]


@borrowing
def advance(tables, slot, h, columns, length, y, work):
    """Advances y (2n + q), of which the first `columns` may differ from zero, by `length` steps within a span."""
    there, term, acceleration = work
    whole, node, rest = split(length, tables.steps.shape[1] - 1)
    if whole > 0:
        apply(tables.steps[slot, whole], y, columns, len(y), there)
        copy(there, y)
    if node > 0:
        apply(tables.fine[slot, node], y, columns, len(y), there)
        copy(there, y)
    if rest != 0.0:
        short_series(tables.motion[slot], h, columns - 2 * len(acceleration), rest, y, term, acceleration)


@borrowing(fastmath={"contract", "reassoc"})
def apply_transposed(matrix, g, used, rows, out):
    """Writes to out (rows) the first `used` columns of a transposed propagator times g: the transpose of `apply`."""
    for j in range(rows):
        total = 0.0
        for i in range(used):
            total += matrix[j, i] * g[i]
        out[j] = total


@borrowing(fastmath={"contract"})
def short_series_back(motion, h, tau, g, term, push):
    """Replaces g (2n + q) by exp(tau S)' g, where S is the system of x, v and the lift's coefficients per step.

    |tau| must be small. `motion` (n, 2n + 2) holds the derivatives of the accelerations by x, v, lift and lift
    velocity.
    """
    n, m = motion.shape
    q = len(g) - 2 * n
    copy(g, term)
    for k in range(ORDER):
        share = tau / (k + 1)
        push[:] = 0.0
        i = 0
        while i + 4 <= n:
            a, b, c, d = term[n + i], term[n + i + 1], term[n + i + 2], term[n + i + 3]
            for j in range(m):
                push[j] += (motion[i, j] * a + motion[i + 1, j] * b) + (motion[i + 2, j] * c + motion[i + 3, j] * d)
            i += 4
        while i < n:
            for j in range(m):
                push[j] += motion[i, j] * term[n + i]
            i += 1
        for j in range(q - 1, 0, -1):
            term[2 * n + j] = share * j * term[2 * n + j - 1]
        term[2 * n] = share * h * push[2 * n]
        if q > 1:
            term[2 * n + 1] += share * push[2 * n + 1]
        for i in range(n):
            term[n + i] = share * h * (term[i] + push[n + i])
            term[i] = share * h * push[i]
        for i in range(len(g)):
            g[i] += term[i]


@borrowing
def carry_back(tables, slot, motion, h, length, bar, out, work):
    """Writes to out (2n + q) the cotangent at a start that belongs to the cotangent `bar` (2n), `length` steps later.

    `out` is by x, v and the lift's coefficients at the start.
    """
    g, term, push = work
    n2, c = len(bar), len(g)
    whole, node, rest = split(length, tables.steps.shape[1] - 1)
    for i in range(n2):
        g[i] = bar[i]
    used = n2
    if rest != 0.0:
        g[n2:] = 0.0
        short_series_back(motion, h, rest, g, term, push)
        used = c
    if node > 0:
        apply_transposed(tables.fine[slot, node], g, used, c, out)
        if whole == 0:
            return
        copy(out, g)
        used = c
    apply_transposed(tables.steps[slot, whole], g, used, c, out)
