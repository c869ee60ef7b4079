"""Compression, force and piece of the elements in a state y, which is (x, v, z) and then the lift's coefficients."""

from camopt.programs import compiled, njit_no_refcount


@njit_no_refcount
def lift_at(train):
    """Index of the lift in y, after the 2n + r numbers of the state."""
    return 2 * len(train.mass) + len(train.reach)


@njit_no_refcount
def closeness(a, b, gap, n, y):
    """(d, d') [m], [m/s] of an element between the masses a and b, without the lift."""
    d, rate = -gap, 0.0
    if a >= 0:
        d += y[a]
        rate += y[n + a]
    if b >= 0:
        d -= y[b]
        rate -= y[n + b]
    return d, rate


@njit_no_refcount
def compression(train, e, h, y):
    """(d, d') of element e: compression [m] and its rate [m/s]; h [s] is the step."""
    d, rate = closeness(train.a[e], train.b[e], train.gap[e], len(train.mass), y)
    if train.cam_driven[e]:
        at = lift_at(train)
        d += y[at]
        rate += y[at + 1] / h
    return d, rate


@njit_no_refcount
def memory_of(train, e, y):
    """The memory z [m] of element e, zero if it has none."""
    return y[2 * len(train.mass) + train.memory[e]] if train.memory[e] >= 0 else 0.0


@njit_no_refcount
def value(form, d, rate, z):
    """The value of an affine form."""
    return form[0] + form[1] * d + form[2] * rate + form[3] * z


@compiled(_nrt=False)
def element_forces(train, pieces, slots, rows, forces):
    """Write the forces [N] of the elements into `forces` (k, e), at `rows` (k, 2n + r + 2 or more) of x, v, z, lift and
    lift velocity. The force of a contact that has just opened may be a rounding error below zero; it is set to zero.

    `pieces` (s, e) are those of each combination, and `slots` (k) are the combinations of the rows. The outer loop is
    over the elements, so that the data of each element are loaded once.
    """
    n, at, law = len(train.mass), lift_at(train), train.law
    for e in range(len(train.a)):
        a, b, gap, driven, contact = train.a[e], train.b[e], train.gap[e], train.cam_driven[e], train.contact[e]
        z = 2 * n + train.memory[e] if train.memory[e] >= 0 else -1
        for i in range(len(rows)):
            row, piece = rows[i], pieces[slots[i], e]
            d, rate = closeness(a, b, gap, n, row)
            if driven:
                d += row[at]
                rate += row[at + 1]
            f = law[piece, 0] + law[piece, 1] * d + law[piece, 2] * rate
            if z >= 0:
                f += law[piece, 3] * row[z]
            forces[i, e] = 0.0 if f < 0.0 and contact else f


@compiled
def classify(train, h, y, status):
    """Write the pieces (e) that hold in an arbitrary state; a memory beyond its element's reach is moved within."""
    for e in range(len(train.a)):
        d, rate = compression(train, e, h, y)
        if train.memory[e] >= 0:
            at = 2 * len(train.mass) + train.memory[e]
            least, most = train.reach[train.memory[e], 0], train.reach[train.memory[e], 1]
            y[at] = min(max(y[at], d - most), d - least)
        status[e] = piece_that_holds(train, e, d, rate, memory_of(train, e, y))


@njit_no_refcount
def piece_that_holds(train, e, d, rate, z):
    """The piece of element e that has no negative watch.

    The search begins at its first piece, and a negative watch leads to the piece that follows it. If two pieces lead to
    each other because of rounding, the one visited first is returned.
    """
    before, piece = -1, 0
    for _ in range(2 * (train.first[e + 1] - train.first[e])):
        then = -1
        for w in range(train.watched[train.first[e] + piece], train.watched[train.first[e] + piece + 1]):
            if value(train.law[w], d, rate, z) < 0.0:
                then = train.then[w]
                break
        if then < 0:
            return piece
        if then == before:
            return then
        before, piece = piece, then
    return piece


@njit_no_refcount
def touch_line(train, e):
    """(force at zero compression [N], stiffness [N/m]) of the line on which a contact's elastic force begins."""
    form = train.law[train.touch[e]]
    return form[0], form[1]


@compiled(_nrt=False)
def form_row(train, e, form, row):
    """Write the row (2n + r + 3 + f) of an affine form of element e: its coefficients of x, v, z, lift, lift velocity,
    the forces over the cam angle and 1."""
    n, at = len(train.mass), lift_at(train)
    for i in range(len(row)):
        row[i] = 0.0
    for mass, sign in ((train.a[e], 1.0), (train.b[e], -1.0)):
        if mass >= 0:
            row[mass] += sign * form[1]
            row[n + mass] += sign * form[2]
    if train.memory[e] >= 0:
        row[2 * n + train.memory[e]] += form[3]
    if train.cam_driven[e]:
        row[at] += form[1]
        row[at + 1] += form[2]
    row[-1] = form[0] - form[1] * train.gap[e]
