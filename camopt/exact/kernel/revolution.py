"""One revolution, event-exact: spans by the exact propagator, jumps to the switchings and piece borders inside them."""

from typing import NamedTuple

import numpy as np

from camopt.exact.kernel.advance import advance, apply, copy
from camopt.exact.kernel.borrowing import borrowing
from camopt.exact.kernel.leap import leap_over, settles
from camopt.exact.kernel.switching import SAMPLES, TICK, first_suspect, next_switch
from camopt.exact.kernel.tables import ACTING, COMPRESSED, SEPARATED, TERMS
from camopt.exact.kernel.trace import begin_segment, end_segment
from camopt.programs import compiled

DONE, NEED_TABLES, CHATTER, NOT_FINITE, TRACE_FULL = 0, 1, 2, 3, 4


@borrowing
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


@borrowing
def element_forces(train, status, lift, lift_rate, x, v, force):
    """Writes to force (e) the forces [N] that the elements exert; where a contact lets go, rounding may be left."""
    for e in range(len(train.a)):
        d, rate = -train.gap[e], 0.0
        if train.a[e] >= 0:
            d += x[train.a[e]]
            rate += v[train.a[e]]
        if train.b[e] >= 0:
            d -= x[train.b[e]]
            rate -= v[train.b[e]]
        if train.cam_driven[e]:
            d += lift
            rate += lift_rate
        force[e] = train.preload[e] + train.stiffness[e] * d + train.damping[e] * rate
        if train.contact[e] and (status[e] != ACTING or force[e] < 0.0):
            force[e] = 0.0


@compiled
def classify(train, lift, lift_rate, x, v, status):
    """Writes the contact states of an arbitrary state: a contact pushes if its elastic and whole force are positive."""
    whole = np.zeros(len(train.a))
    status[:] = ACTING
    element_forces(train, status, lift, lift_rate, x, v, whole)
    for e in range(len(train.a)):
        if not train.contact[e]:
            continue
        d = -train.gap[e] + train.cam_driven[e] * lift
        if train.a[e] >= 0:
            d += x[train.a[e]]
        if train.b[e] >= 0:
            d -= x[train.b[e]]
        if train.preload[e] + train.stiffness[e] * d <= 0.0:
            status[e] = SEPARATED
        elif whole[e] <= 0.0:
            status[e] = COMPRESSED


@borrowing
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


@borrowing
def record(rows, count, t, train, status, y, h):
    """Appends one sample: time, lift, x, v, force."""
    n = len(train.mass)
    row = rows[count]
    row[0], row[1] = t, y[2 * n]
    for i in range(2 * n):
        row[2 + i] = y[i]
    element_forces(train, status, y[2 * n], y[2 * n + 1] / h, y[:n], y[n : 2 * n], row[2 + 2 * n :])
    return count + 1


@borrowing
def next_stop(cam, piece, t, target, step):
    """(border, target, end) of the span that begins at t [s]: where the lift's piece ends, where the span was to end
    (moved onto a border within its rounding), and the earlier of the two."""
    last = piece + 2 >= len(cam.borders)
    border = 2.0 * np.pi / cam.speed if last else (cam.borders[piece + 1] - cam.borders[0]) / cam.speed
    if abs(target - border) < 1e-11 * step:
        target = border
    return border, target, max(t, min(target, border))


class Work(NamedTuple):
    """Room for one revolution."""

    y: np.ndarray  # (2n + q) x, v and the lift's coefficients
    status: np.ndarray  # (e) states of the contacts
    out: np.ndarray  # (2n + q + looks) what the table of a span gives
    scratch: tuple  # of `next_switch`
    inside: tuple  # of `advance`
    modes: np.ndarray  # (2r) of the leap
    size: np.ndarray  # (r)


@borrowing
def cross(tables, slot, h, columns, remaining, work):
    """Advances y by the span whose table gave `out`, or by `remaining` steps of it, or to the first switching.

    Returns (steps taken, watch that switched or -1, whether the whole span was taken without a look inside).
    """
    y, out, steps = work.y, work.out, tables.steps.shape[1] - 1
    if abs(remaining - steps) < 2e-11 and first_suspect(out, len(y), tables.count[slot], steps) == steps:
        for i in range(columns):
            y[i] = out[i]
        return float(steps), -1, True
    whole, rest, watch = next_switch(tables, slot, y, columns, out, remaining, TICK / h, work.scratch)
    if watch >= 0:
        copy(work.scratch[0], y)
    advance(tables, slot, h, columns, rest, y, work.inside)
    return whole + rest, watch, False


@compiled
def revolve(train, cam, h, tables, state, rows, trace, most):
    """Runs one revolution from `state` (2n), which it changes in place.

    Returns (code, number of samples or missing key, number of switchings). Where `rows` has room, the motion is sampled
    at every span, switching and border; otherwise only the end is found. Where `trace` has room, every segment is
    written there and segments are counted in place of samples. At most `most` switchings are allowed.
    """
    n2, r = len(state), tables.leap.rate.shape[1]
    n, c = n2 // 2, n2 + cam.pieces.shape[1]
    scratch = np.zeros(c), np.zeros(TERMS + 1), np.zeros(SAMPLES + 1), np.zeros(SAMPLES + 1)
    inside = np.zeros(c), np.zeros(n2 + 2), np.zeros(n)
    status, out = np.zeros(len(train.contact), dtype=np.int64), np.zeros(tables.span.shape[2])
    work = Work(np.zeros(c), status, out, scratch, inside, np.zeros(2 * r), np.zeros(r))
    y = work.y
    y[:n2] = state
    lift_series(cam.pieces[0], 0.0, cam.speed * h, y[n2:])
    classify(train, y[n2], y[n2 + 1] / h, y[:n], y[n:n2], status)
    code, count, switchings = turn(train, cam, h, tables, work, (rows, trace), most)
    if code == DONE:
        state[:] = y[:n2]
        code = DONE if np.all(np.isfinite(state)) else NOT_FINITE
    return code, count, switchings


@borrowing
def turn(train, cam, h, tables, work, room, most):
    """The revolution of `revolve`, with everything made ready in `work`; `room` is (rows, trace)."""
    rows, trace = room
    n2, q, period, scale = 2 * len(train.mass), cam.pieces.shape[1], 2.0 * np.pi / cam.speed, cam.speed * h
    sampled, traced, span = len(rows) > 0, len(trace.length) > 0, (tables.steps.shape[1] - 1) * h
    y, out = work.y, work.out
    t, piece, step, count, switchings = 0.0, 0, 0, 0, 0
    columns = n2 + lift_series(cam.pieces[0], 0.0, scale, y[n2:])
    slot, key = find(tables.keys, work.status, train.contact)
    if sampled:
        count = record(rows, count, t, train, work.status, y, h)
    while t < period:
        if slot < 0:
            return NEED_TABLES, key, switchings
        if columns == n2 and key == tables.leap.key[0] and not (sampled or traced):
            end = next_stop(cam, piece, t, period, h)[2]
            if end - t > span and settles(tables.leap, y[:n2], work.modes, work.size):
                leap_over(tables.leap, end - t, work.modes, y[:n2])
                t = end
                if piece + 2 < len(cam.borders):
                    piece += 1
                    columns = n2 + lift_series(cam.pieces[piece], 0.0, scale, y[n2:])
                continue
        border, target, end = next_stop(cam, piece, t, min((step + 1) * span, period) if sampled else t + span, h)
        apply(tables.span[slot], y, columns, n2 + q + 2 * tables.count[slot] * (tables.steps.shape[1]), out)
        if traced:
            if count >= len(trace.length):
                return TRACE_FULL, count, switchings
            angle, offset = t * cam.speed + cam.borders[0], t * cam.speed + cam.borders[0] - cam.borders[piece]
            begin_segment(trace, count, angle, offset, slot, piece, y, out[n2 + q :])
        length, watch, whole = cross(tables, slot, h, columns, (end - t) / h, work)
        t = t + length * h if watch >= 0 else end
        if watch < 0 and end == border and piece + 2 < len(cam.borders):
            piece += 1
            columns = n2 + lift_series(cam.pieces[piece], 0.0, scale, y[n2:])
        elif not whole:
            lift_series(cam.pieces[piece], t * cam.speed + cam.borders[0] - cam.borders[piece], scale, y[n2:])
        if traced:
            end_segment(trace, count, length, watch, t * cam.speed + cam.borders[0], y)
            count += 1
        if sampled:
            if count + 2 >= len(rows):
                return CHATTER, count, switchings
            count = record(rows, count, t, train, work.status, y, h)
        if watch >= 0:
            work.status[tables.element[slot, watch]] = tables.new[slot, watch]
            slot, key = find(tables.keys, work.status, train.contact)
            switchings += 1
            if switchings > most:
                return CHATTER, count, switchings
            if sampled:
                count = record(rows, count, t, train, work.status, y, h)
        elif end == target:
            step += 1
    return DONE, count, switchings
