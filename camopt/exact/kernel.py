"""One revolution, event-exact: fixed steps by the exact propagator, series where a switching or a piece border is."""

import numba
import numpy as np

from camopt.exact.taylor import ACTING, COMPRESSED, SEPARATED, TERMS, evaluate, next_switch, series

DONE, NEED_PROPAGATOR, CHATTER, NOT_FINITE = 0, 1, 2, 3


@numba.njit(cache=True, nogil=True)
def lift_coefficients(piece, offset, cam_speed, out):
    """Coefficients of the lift in time about the angle `offset` [rad] inside a piece (q, m/rad^k); zero beyond."""
    q, still = len(piece), True
    for k in range(q):
        out[k] = piece[k]
        still = still and piece[k] == 0.0
    if still:  # the base circle
        return
    for low in range(q - 1):
        for k in range(q - 2, low - 1, -1):
            out[k] += offset * out[k + 1]
    scale = 1.0
    for k in range(q):
        out[k] *= scale
        scale *= cam_speed


@numba.njit(cache=True, nogil=True)
def contact_scalars(train, status, lift, x, v, watch, slope, force, acceleration):
    """Forces (e), accelerations (n), and per contact the watched quantities and slopes, (2, e): p and f."""
    mass, mass_damping, mass_force, a, b, contact, cam_driven, stiffness, damping, preload, gap = train
    for i in range(len(mass)):
        acceleration[i] = mass_force[i] - mass_damping[i] * v[i]
    for e in range(len(a)):
        d, rate = -gap[e], 0.0
        if a[e] >= 0:
            d += x[a[e]]
            rate += v[a[e]]
        if b[e] >= 0:
            d -= x[b[e]]
            rate -= v[b[e]]
        if cam_driven[e]:
            d += lift[0]
            rate += lift[1]
        p = preload[e] + stiffness[e] * d
        f = p + damping[e] * rate
        watch[0, e], watch[1, e], slope[0, e] = p, f, stiffness[e] * rate
        force[e] = f
        if contact[e] and (status[e] != ACTING or f < 0.0):  # where it lets go, f is zero but for rounding
            force[e] = 0.0
        if a[e] >= 0:
            acceleration[a[e]] -= force[e]
        if b[e] >= 0:
            acceleration[b[e]] += force[e]
    for i in range(len(mass)):
        acceleration[i] /= mass[i]
    for e in range(len(a)):
        if not contact[e]:
            continue
        second = 0.0
        if a[e] >= 0:
            second += acceleration[a[e]]
        if b[e] >= 0:
            second -= acceleration[b[e]]
        if cam_driven[e]:
            second += 2.0 * lift[2]
        slope[1, e] = slope[0, e] + damping[e] * second


@numba.njit(cache=True, nogil=True)
def may_switch(status, contact, h, watch0, slope0, watch1, slope1):
    """Whether a contact may switch within a step, from values and slopes at both ends: may say yes too often."""
    for e in range(len(contact)):
        if not contact[e]:
            continue
        for law in range(2):
            if (law == 0 and status[e] == ACTING) or (law == 1 and status[e] == SEPARATED):
                continue
            sign = -1.0 if status[e] == SEPARATED or (law == 1 and status[e] == COMPRESSED) else 1.0
            w0, w1 = sign * watch0[law, e], sign * watch1[law, e]
            s0, s1 = sign * slope0[law, e], sign * slope1[law, e]
            if w1 < 0.0 or w0 < 0.0:
                return True
            if (s0 < 0.0 and w0 + h * s0 < 0.0) or (s1 > 0.0 and w1 - h * s1 < 0.0):
                return True
    return False


@numba.njit(cache=True, nogil=True)
def classify(train, lift, x, v, status):
    """Contact states of an arbitrary state: pushing where both the elastic and the whole force are positive."""
    e_count = len(train[3])
    watch, slope = np.zeros((2, e_count)), np.zeros((2, e_count))
    status[:] = SEPARATED
    contact_scalars(train, status, lift, x, v, watch, slope, np.zeros(e_count), np.zeros(len(x)))
    for e in range(e_count):
        if watch[0, e] > 0.0:
            status[e] = ACTING if watch[1, e] > 0.0 else COMPRESSED


@numba.njit(cache=True, nogil=True)
def record(rows, count, t, lift, x, v, force):
    """Appends one sample: time, lift, x, v, force."""
    n, e = len(x), len(force)
    row = rows[count]
    row[0], row[1] = t, lift
    for i in range(n):
        row[2 + i], row[2 + n + i] = x[i], v[i]
    for i in range(e):
        row[2 + 2 * n + i] = force[i]
    return count + 1


@numba.njit(cache=True, nogil=True)
def acting_set(status, contact):
    """Bit pattern of the acting contacts."""
    bits, i = 0, 0
    for e in range(len(contact)):
        if contact[e]:
            if status[e] == ACTING:
                bits |= 1 << i
            i += 1
    return bits


@numba.njit(cache=True, nogil=True)
def revolve(train, borders, pieces, cam_speed, h, slots, table, x, v, rows):
    """One revolution from state x, v (changed in place); returns (code, samples or contact set, switchings)."""
    n, e_count, contact = len(x), len(train[3]), train[5]
    q, period = pieces.shape[1], 2.0 * np.pi / cam_speed
    lift = np.zeros(TERMS + 2)
    status = np.zeros(e_count, dtype=np.int64)
    watch, slope = np.zeros((2, 2, e_count)), np.zeros((2, 2, e_count))
    force, acceleration = np.zeros(e_count), np.zeros(n)
    xs, vs, ds = np.zeros((TERMS + 1, n)), np.zeros((TERMS + 1, n)), np.zeros((TERMS + 1, e_count))
    w, y = np.zeros(TERMS + 1), np.zeros(2 * n)
    t, piece, step, switchings = 0.0, 0, 0, 0
    lift_coefficients(pieces[0], 0.0, cam_speed, lift)
    classify(train, lift, x, v, status)
    contact_scalars(train, status, lift, x, v, watch[0], slope[0], force, acceleration)
    count = record(rows, 0, t, lift[0], x, v, force)
    while t < period:
        target = min((step + 1) * h, period)
        if period - target < 1e-6 * h:
            target = period
        border = (borders[piece + 1] - borders[0]) / cam_speed
        if piece + 2 == len(borders):
            border = period  # not its rounding
        end = min(target, border)
        regular = end == target and abs(target - t - h) < 1e-9 * h
        if regular:
            slot = slots[acting_set(status, contact)]
            if slot < 0:
                return NEED_PROPAGATOR, acting_set(status, contact), switchings
            _advance(table[slot], lift, h, q, x, v, y)
            lift_coefficients(pieces[piece], end * cam_speed + borders[0] - borders[piece], cam_speed, lift)
            contact_scalars(train, status, lift, y[:n], y[n:], watch[1], slope[1], force, acceleration)
            regular = not may_switch(status, contact, h, watch[0], slope[0], watch[1], slope[1])
        if regular:
            x[:], v[:] = y[:n], y[n:]
            t, which, new = end, -1, 0
        else:
            lift_coefficients(pieces[piece], t * cam_speed + borders[0] - borders[piece], cam_speed, lift)
            series(train, status, lift, x, v, xs, vs, ds)
            length, which, new = next_switch(train, status, lift, ds, end - t, w)
            evaluate(xs, length, x)
            evaluate(vs, length, v)
            t = end if which < 0 else t + length
            lift_coefficients(pieces[piece], t * cam_speed + borders[0] - borders[piece], cam_speed, lift)
            contact_scalars(train, status, lift, x, v, watch[1], slope[1], force, acceleration)
        if count + 2 >= len(rows):
            return CHATTER, count, switchings
        count = record(rows, count, t, lift[0], x, v, force)
        if which >= 0:
            status[which] = new
            switchings += 1
            contact_scalars(train, status, lift, x, v, watch[1], slope[1], force, acceleration)
            count = record(rows, count, t, lift[0], x, v, force)
        elif end == border and piece + 2 < len(borders):
            piece += 1
            lift_coefficients(pieces[piece], 0.0, cam_speed, lift)
            contact_scalars(train, status, lift, x, v, watch[1], slope[1], force, acceleration)
        if which < 0 and end == target:
            step += 1
        watch[0], slope[0] = watch[1], slope[1]
    for i in range(n):
        if not (np.isfinite(x[i]) and np.isfinite(v[i])):
            return NOT_FINITE, count, switchings
    return DONE, count, switchings


@numba.njit(cache=True, nogil=True)
def _advance(propagator, lift, h, q, x, v, y):
    """y (2n) = propagator applied to (x, v, lift coefficients in units of the step, 1)."""
    n = len(x)
    y[:] = propagator[2 * n + q]
    for j in range(n):
        for i in range(2 * n):
            y[i] += propagator[j, i] * x[j]
    for j in range(n):
        for i in range(2 * n):
            y[i] += propagator[n + j, i] * v[j]
    scale = 1.0
    for k in range(q):
        if lift[k] != 0.0:
            u = lift[k] * scale
            for i in range(2 * n):
                y[i] += propagator[2 * n + k, i] * u
        scale *= h
