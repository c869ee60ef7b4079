"""Propagation of a state over any length within a span, and of a cotangent back over it by the transposed operation.

A length is divided into whole steps, a fine node and a small remainder. The first two have stored propagators. The
remainder is a short power series of the equations of motion, so that any instant costs little more than a node.
"""

from camopt.exact.kernel.tables import FINE
from camopt.programs import njit_no_refcount

ORDER = 7
"""Highest power of the series after a fine node: its truncation error is below 1e-15 of the highest mode's motion."""


@njit_no_refcount(fastmath={"contract"})
def apply(matrix, y, columns, used, out):
    """Write to out (used) the first rows of a transposed matrix times the first `columns` of y, plus its constant."""
    constant = matrix[len(y)]
    for i in range(used):
        out[i] = constant[i]
    j = 0
    while j + 8 <= columns:  # eight columns per pass, so that the result is loaded and stored an eighth as often
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


@njit_no_refcount
def split(length, most):
    """(whole steps, fine node, remainder) of a length [steps] up to `most`; the remainder is at most 1 / (2 FINE)."""
    nearest = min(max(int(length * FINE + 0.5), 0), most * FINE)
    return nearest // FINE, nearest % FINE, length - nearest / FINE


@njit_no_refcount(fastmath={"contract"})
def short_series(motion, sizes, h, used, tau, y, term, rates):
    """Add to x, v and z in y their change over tau, a small part of a step, by power series.

    Only the first `used` of the inputs in y, none or all of them, differ from zero.
    """
    n, at, m, power = sizes.masses, sizes.state, len(rates), 1.0
    lift = min(used, sizes.lift)
    for i in range(at):
        term[i] = y[i]
    for i in range(m):
        rates[i] = motion[len(term), i]
    for k in range(ORDER):
        term[at] = y[at + k] * power if k < lift else 0.0
        term[at + 1] = (k + 1) * y[at + k + 1] * power / h if k + 1 < lift else 0.0
        j = 0
        while j < 2 * n:
            a, b = term[j], term[j + 1]
            for i in range(m):
                rates[i] += motion[j, i] * a + motion[j + 1, i] * b
            j += 2
        if m > n or sizes.forces > 0:
            add_memories_and_forces(motion, sizes, k if used > 0 else ORDER, power, y, term, rates)
        a, b = term[at], term[at + 1]
        share = tau * h / (k + 1)
        power *= tau
        if m > n:
            for i in range(n, m):
                term[n + i] = (rates[i] + (motion[at, i] * a + motion[at + 1, i] * b)) * share
                rates[i] = 0.0
        for i in range(n):
            rate = (rates[i] + (motion[at, i] * a + motion[at + 1, i] * b)) * share
            term[i] = term[n + i] * share
            term[n + i] = rate
            rates[i] = 0.0
        for i in range(at):
            y[i] += term[i]


@njit_no_refcount
def add_memories_and_forces(motion, sizes, k, power, y, term, rates):
    """Add to rates (n + r) the contributions of memories and forces over the cam angle to term k of a power series."""
    at = sizes.state
    for j in range(2 * sizes.masses, at):
        for i in range(len(rates)):
            rates[i] += motion[j, i] * term[j]
    for j in range(sizes.forces if k < 2 else 0):
        force = y[at + sizes.lift + 2 * j + k] * power
        for i in range(len(rates)):
            rates[i] += motion[at + 2 + j, i] * force


@njit_no_refcount
def copy(source, target):
    """Copy one vector to another; faster than an assignment of slices for such short vectors."""
    for i in range(len(target)):
        target[i] = source[i]


@njit_no_refcount
def advance(tables, slot, h, columns, length, y, work):
    """Advance y, of which only the first `columns` differ from zero, by `length` steps within a span."""
    there, term, rates = work
    whole, node, rest = split(length, tables.steps.shape[1] - 1)
    if whole > 0:
        apply(tables.steps[slot, whole], y, columns, len(y), there)
        copy(there, y)
    if node > 0:
        apply(tables.fine[slot, node], y, columns, len(y), there)
        copy(there, y)
    if rest != 0.0:
        sizes = tables.sizes
        short_series(tables.motion[slot], sizes, h, columns - sizes.state, rest, y, term, rates)


@njit_no_refcount(fastmath={"contract", "reassoc"})
def apply_transposed(matrix, g, used, rows, out):
    """Write to out (rows) the first `used` columns of a transposed propagator times g: the transpose of `apply`."""
    for j in range(rows):
        total = 0.0
        for i in range(used):
            total += matrix[j, i] * g[i]
        out[j] = total


@njit_no_refcount(fastmath={"contract"})
def short_series_back(rates, sizes, h, tau, g, term, push):
    """Replace g, of the length of y, by exp(tau S)' g, where S is the system of x, v, z and the inputs per step.

    |tau| must be small. `rates` (n + r, 2n + r + 2 + f) holds the derivatives of the rates of v and z with respect to
    x, v, z, lift, lift velocity and the forces over the cam angle.
    """
    n, at, q, (rows, m) = sizes.masses, sizes.state, sizes.lift, rates.shape
    copy(g, term)
    for k in range(ORDER):
        share = tau / (k + 1)
        push[:] = 0.0
        i = 0
        while i + 4 <= rows:
            a, b, c, d = term[n + i], term[n + i + 1], term[n + i + 2], term[n + i + 3]
            for j in range(m):
                push[j] += (rates[i, j] * a + rates[i + 1, j] * b) + (rates[i + 2, j] * c + rates[i + 3, j] * d)
            i += 4
        while i < rows:
            for j in range(m):
                push[j] += rates[i, j] * term[n + i]
            i += 1
        for j in range(q - 1, 0, -1):
            term[at + j] = share * j * term[at + j - 1]
        term[at] = share * h * push[at]
        if q > 1:
            term[at + 1] += share * push[at + 1]
        for i in range(n):
            term[n + i] = share * h * (term[i] + push[n + i])
            term[i] = share * h * push[i]
        if rows > n or sizes.forces > 0:
            memories_and_forces_back(sizes, share, h, term, push)
        for i in range(len(g)):
            g[i] += term[i]


@njit_no_refcount
def memories_and_forces_back(sizes, share, h, term, push):
    """Write the next term of the series of `short_series_back` for memories and forces over the cam angle."""
    for i in range(2 * sizes.masses, sizes.state):
        term[i] = share * h * push[i]
    for j in range(sizes.forces):
        at = sizes.state + sizes.lift + 2 * j
        term[at + 1] = share * term[at]
        term[at] = share * h * push[sizes.state + 2 + j]


@njit_no_refcount
def carry_back(tables, slot, h, length, bar, out, work):
    """Write to out the cotangent of y at the start of `length` steps, from that of the state at their end, `bar`."""
    g, term, push = work
    at, c = len(bar), len(g)
    whole, node, rest = split(length, tables.steps.shape[1] - 1)
    for i in range(at):
        g[i] = bar[i]
    used = at
    if rest != 0.0:
        g[at:] = 0.0
        short_series_back(tables.rates[slot], tables.sizes, h, rest, g, term, push)
        used = c
    if node > 0:
        apply_transposed(tables.fine[slot, node], g, used, c, out)
        if whole == 0:
            return
        copy(out, g)
        used = c
    apply_transposed(tables.steps[slot, whole], g, used, c, out)
