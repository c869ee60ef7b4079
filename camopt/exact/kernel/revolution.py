"""One revolution, event-exact: spans by the exact propagator, jumps to the switchings and piece borders inside them."""

import numba
import numpy as np

from camopt.exact.kernel.advance import advance, apply
from camopt.exact.kernel.propagators import ACTING, COMPRESSED, SEPARATED, TERMS
from camopt.exact.kernel.switching import SAMPLES, TICK, first_suspect, next_switch
from camopt.exact.kernel.trace import begin_segment, end_segment

DONE, NEED_TABLES, CHATTER, NOT_FINITE, TRACE_FULL = 0, 1, 2, 3, 4


@numba.njit(cache=True, nogil=True)
def lift_series(piece, offset, scale, u):
    """Coefficients u (q) of the lift in tau about the angle `offset` [rad] inside a piece (q, m/rad^k).

    `scale` [rad] is the angle per tau. Returns how many of them to use: none on the base circle.
    """
    q, still = len(piece), True
    for k in range(q):
        u[k] = piece[k]
        still = still and piece[k] == 0.0
    if still:
        return 0
    if offset != 0.0:
        for low in range(q - 1):
            for k in range(q - 2, low - 1, -1):
                u[k] += offset * u[k + 1]
    power = 1.0
    for k in range(q):
        u[k] *= power
        power *= scale
    return q


@numba.njit(cache=True, nogil=True)
def element_forces(laws, status, lift, lift_rate, x, v, force):
    """Forces (e) as the elements exert them; where a contact lets go it is zero but for rounding."""
    a, b, contact, cam_driven, stiffness, damping, preload, gap = laws[3:]
    for e in range(len(a)):
        d, rate = -gap[e], 0.0
        if a[e] >= 0:
            d += x[a[e]]
            rate += v[a[e]]
        if b[e] >= 0:
            d -= x[b[e]]
            rate -= v[b[e]]
        if cam_driven[e]:
            d += lift
            rate += lift_rate
        force[e] = preload[e] + stiffness[e] * d + damping[e] * rate
        if contact[e] and (status[e] != ACTING or force[e] < 0.0):
            force[e] = 0.0


@numba.njit(cache=True, nogil=True)
def classify(laws, lift, lift_rate, x, v, status):
    """Contact states of an arbitrary state: pushing where both the elastic and the whole force are positive."""
    a, b, contact, cam_driven, stiffness, _, preload, gap = laws[3:]
    whole = np.zeros(len(a))
    status[:] = ACTING
    element_forces(laws, status, lift, lift_rate, x, v, whole)
    for e in range(len(a)):
        if not contact[e]:
            continue
        d = -gap[e] + cam_driven[e] * lift
        if a[e] >= 0:
            d += x[a[e]]
        if b[e] >= 0:
            d -= x[b[e]]
        if preload[e] + stiffness[e] * d <= 0.0:
            status[e] = SEPARATED
        elif whole[e] <= 0.0:
            status[e] = COMPRESSED


@numba.njit(cache=True, nogil=True)
def find(keys, status, contact):
    """(slot of the tables for a state of the contacts or -1, its key)."""
    key, digit = 0, 1
    for e in range(len(contact)):
        if contact[e]:
            key += digit * status[e]
            digit *= 3
    for slot in range(len(keys)):
        if keys[slot] == key:
            return slot, key
    return -1, key


@numba.njit(cache=True, nogil=True)
def record(rows, count, t, laws, status, y, h):
    """Appends one sample: time, lift, x, v, force."""
    n = len(laws[0])
    row = rows[count]
    row[0], row[1] = t, y[2 * n]
    for i in range(2 * n):
        row[2 + i] = y[i]
    element_forces(laws, status, y[2 * n], y[2 * n + 1] / h, y[:n], y[n : 2 * n], row[2 + 2 * n :])
    return count + 1


@numba.njit(cache=True, nogil=True)
def revolve(laws, cam, h, tables, state, rows, trace, most):
    """One revolution from `state` (2n, changed in place); returns (code, samples or missing key, switchings).

    With `rows` it is sampled at every span, switching and border; without (no rows), only the end is found. With room
    in `trace` every segment is written there and counted instead. `most` switchings are allowed. `cam` holds borders,
    coefficients and speed.
    """
    borders, pieces, cam_speed = cam
    n2, q, contact = len(state), pieces.shape[1], laws[5]
    n, period, sampled, scale = n2 // 2, 2.0 * np.pi / cam_speed, len(rows) > 0, cam_speed * h
    traced = len(trace.length) > 0
    steps = tables.steps.shape[1] - 1
    span = steps * h
    status = np.zeros(len(contact), dtype=np.int64)
    y, there, out = np.zeros(n2 + q), np.zeros(n2 + q), np.zeros(tables.span.shape[2])
    scratch = there, np.zeros(TERMS + 1), np.zeros(SAMPLES + 1), np.zeros(SAMPLES + 1)
    work = there, np.zeros(n2 + 2), np.zeros(n)
    y[:n2] = state
    t, piece, step, count, switchings = 0.0, 0, 0, 0, 0
    columns = n2 + lift_series(pieces[0], 0.0, scale, y[n2:])
    classify(laws, y[n2], y[n2 + 1] / h, y[:n], y[n:n2], status)
    slot, key = find(tables.keys, status, contact)
    if sampled:
        count = record(rows, count, t, laws, status, y, h)
    while t < period:
        if slot < 0:
            return NEED_TABLES, key, switchings
        border = (borders[piece + 1] - borders[0]) / cam_speed if piece + 2 < len(borders) else period
        target = min((step + 1) * span, period) if sampled else t + span
        if abs(target - border) < 1e-11 * h:
            target = border
        end = max(t, min(target, border))
        which, watches = -1, tables.count[slot]
        apply(tables.span[slot], y, columns, n2 + q + 2 * watches * (steps + 1), out)
        if traced:
            if count >= len(trace.length):
                return TRACE_FULL, count, switchings
            angle, offset = t * cam_speed + borders[0], t * cam_speed + borders[0] - borders[piece]
            begin_segment(trace, count, angle, offset, slot, piece, y, out[n2 + q :])
        length = float(steps)
        whole = abs(end - t - span) < 2e-11 * h
        if whole and first_suspect(out, n2 + q, watches, steps) == steps:
            for i in range(columns):
                y[i] = out[i]
            t = end
        else:
            whole = False
            length, which = next_switch(tables, slot, y, columns, out, (end - t) / h, TICK / h, scratch)
            advance(tables, slot, h, columns, length, y, work)
            t = t + length * h if which >= 0 else end
        if which < 0 and end == border and piece + 2 < len(borders):
            piece += 1
            columns = n2 + lift_series(pieces[piece], 0.0, scale, y[n2:])
        elif not whole:
            lift_series(pieces[piece], t * cam_speed + borders[0] - borders[piece], scale, y[n2:])
        if traced:
            end_segment(trace, count, length, which, t * cam_speed + borders[0], y)
            count += 1
        if sampled:
            if count + 2 >= len(rows):
                return CHATTER, count, switchings
            count = record(rows, count, t, laws, status, y, h)
        if which >= 0:
            status[tables.element[slot, which]] = tables.new[slot, which]
            slot, key = find(tables.keys, status, contact)
            switchings += 1
            if switchings > most:
                return CHATTER, count, switchings
            if sampled:
                count = record(rows, count, t, laws, status, y, h)
        elif end == target:
            step += 1
    state[:] = y[:n2]
    for i in range(n2):
        if not np.isfinite(state[i]):
            return NOT_FINITE, count, switchings
    return DONE, count, switchings
