"""One event-exact revolution: spans by the exact propagator, shortened at switchings and at borders of the lift."""

from typing import NamedTuple

import numpy as np

from camopt.exact.kernel.advance import advance, apply, copy
from camopt.exact.kernel.arrays import CamArrays, TrainArrays
from camopt.exact.kernel.building import slot_of
from camopt.exact.kernel.elements import classify
from camopt.exact.kernel.leap import modal_step, no_switch_possible
from camopt.exact.kernel.switching import SAMPLES, TICK, first_suspect, next_switch
from camopt.exact.kernel.tables import TERMS, Tables
from camopt.exact.kernel.trace import begin_segment, cut, end_segment
from camopt.programs import compiled, inner, njit_no_refcount
from camopt.scene.settled import UNBOUND

DONE, TABLES_FULL, TRACE_FULL = range(3)
"""Codes of a revolution that was completed, or for which the tables or the trace must be enlarged."""
WHOLE = 2.0 * np.pi
"""A whole revolution [rad]."""
CHATTER, NO_BOUND = -1, -2
"""Codes of a revolution whose motion is refused: too many switchings, or an unbounded motion."""
MOST_SWITCHINGS = 20_000
"""Largest number of switchings in one revolution; a motion with more is refused as chatter."""


class Setting(NamedTuple):
    """A train with its tables; a cam and its speed."""

    train: TrainArrays
    cam: CamArrays
    step: float  # s
    tables: Tables
    half_duration: float  # rad
    opening_foot: float  # rad


@njit_no_refcount
def inputs_at(piece, forces, offset, scale, u):
    """Coefficients u (q + 2f) in tau of lift and `forces` about the angle `offset` [rad] inside a piece (q + 2f).

    `scale` [rad] is the angle per tau. Returns the number of coefficients to use: 0 if all vanish (base circle).
    """
    q, still = len(piece) - 2 * forces, True
    for k in range(len(piece)):
        u[k] = piece[k]
        still = still and piece[k] == 0.0
    if still:
        return 0
    if offset != 0.0:
        for low in range(q - 1):
            carried = u[q - 1]  # held in a register, which halves the time
            for k in range(q - 2, low - 1, -1):
                carried = u[k] + offset * carried
                u[k] = carried
    power = 1.0
    for k in range(q):
        u[k] *= power
        power *= scale
    for k in range(q, len(piece), 2):
        u[k] += offset * u[k + 1]
        u[k + 1] *= scale
    return len(piece)


@njit_no_refcount
def next_stop(cam, piece, t, target, step):
    """(border, target, end) of the span that begins at t [s]: end of the lift's piece, intended end of the span (moved
    onto the border if it is equal except for rounding), and the earlier of the two."""
    last = piece + 2 >= len(cam.borders)
    border = 2.0 * np.pi / cam.speed if last else (cam.borders[piece + 1] - cam.borders[0]) / cam.speed
    if abs(target - border) < 1e-11 * step:
        target = border
    return border, target, max(t, min(target, border))


class Workspace(NamedTuple):
    """Work arrays of one revolution."""

    y: np.ndarray  # (2n + r + q + 2f) x, v, z and the inputs
    status: np.ndarray  # (e) pieces that hold, by their numbers within the elements
    out: np.ndarray  # (len(y) + looks) result of the table of a span
    scratch: tuple  # of `next_switch`
    inside: tuple  # of `advance`
    modes: np.ndarray  # (2 m) of the leap
    size: np.ndarray  # (m)


@njit_no_refcount
def cross(tables, slot, h, columns, remaining, work):
    """Advance y by the span whose table gave `out`, or by `remaining` steps of it, or to the first switching.

    Returns (steps taken, watch that switched or -1, whether the whole span was taken without a search for switchings).
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
def follow(s, state, starts, regular, trace):
    """`follow_inside` for Python."""
    return follow_inside(s, state, starts, regular, trace, WHOLE)


@inner
def follow_inside(s, state, starts, regular, trace, last):
    """Simulate successive revolutions from `state` (2n + r), which is overwritten by the end state.

    All revolutions are whole, except that the last one covers the angle `last` [rad]. `starts` (revolutions + 1)
    receives the segments of the trace at which they begin, and the end of the last one. Returns (code, number of
    switchings of the last revolution); `regular` and `trace` have the meaning that they have in `revolve`.
    """
    switchings = 0
    for turn in range(len(starts) - 1):
        if len(trace.length) > 0 and starts[turn] == len(trace.length):
            return TRACE_FULL, switchings  # a revolution without room would not be traced
        rest = cut(trace, starts[turn], len(trace.length))
        angle = last if turn == len(starts) - 2 else WHOLE
        code, count, switchings = revolve(s, state, regular, rest, angle)
        if code != DONE:
            return code, switchings
        if len(trace.length) > 0:
            for k in range(count + 1):
                rest.angle[k] += 2.0 * np.pi * turn
        starts[turn + 1] = starts[turn] + count
    return DONE, switchings


@inner
def revolve(s, state, regular, trace, angle):
    """Simulate one revolution, or its first `angle` [rad], from `state` (2n + r), which is overwritten by its end.

    The angle must end at a border of the lift's pieces. Returns (code, number of segments, number of switchings). Every
    segment is written to `trace`, unless this is empty. With `regular` spans end at whole multiples of their length;
    otherwise a new span begins at every switching.
    """
    tables, at = s.tables, len(state)
    modes, (inputs, rates), c = tables.leap.rate.shape[1], tables.motion.shape[1:], at + s.cam.pieces.shape[1]
    scratch = np.zeros(c), np.zeros(TERMS + 1), np.zeros(SAMPLES + 1), np.zeros(SAMPLES + 1)
    inside = np.zeros(c), np.zeros(inputs - 1), np.zeros(rates)
    status, out = np.zeros(len(s.train.contact), dtype=np.int64), np.zeros(tables.span.shape[2])
    work = Workspace(np.zeros(c), status, out, scratch, inside, np.zeros(2 * modes), np.zeros(modes))
    y = work.y
    y[:at] = state
    inputs_at(s.cam.pieces[0], tables.sizes.forces, 0.0, s.cam.speed * s.step, y[at:])
    classify(s.train, s.step, y, status)
    code, count, switchings = turn(s, work, regular, trace, angle)
    if code == DONE:
        state[:] = y[:at]
        if not np.all(np.isfinite(state)) or np.abs(state[: tables.sizes.masses]).max() > UNBOUND:
            code = NO_BOUND
    return code, count, switchings


@njit_no_refcount
def turn(s, work, regular, trace, angle):
    """The revolution of `revolve`, with the start state and its pieces in `work`."""
    train, cam, h, tables = s.train, s.cam, s.step, s.tables
    at, forces, period, scale = tables.sizes.state, tables.sizes.forces, angle / cam.speed, cam.speed * h
    traced, span = len(trace.length) > 0, (tables.steps.shape[1] - 1) * h
    y, out = work.y, work.out
    t, piece, step, count, switchings = 0.0, 0, 0, 0, 0
    columns = at + inputs_at(cam.pieces[0], forces, 0.0, scale, y[at:])
    slot = slot_of(train, h, tables, work.status)
    if slot < 0:
        return TABLES_FULL, count, switchings
    while t < period:
        if columns == at and tables.keys[slot] == tables.leap.key[0] and not traced:
            end = next_stop(cam, piece, t, period, h)[2]
            if end - t > span and no_switch_possible(tables.leap, y[:at], work.modes, work.size):
                modal_step(tables.leap, end - t, work.modes, y[:at])
                t = end
                if piece + 2 < len(cam.borders):
                    piece += 1
                    columns = at + inputs_at(cam.pieces[piece], forces, 0.0, scale, y[at:])
                continue
        border, target, end = next_stop(cam, piece, t, min((step + 1) * span, period) if regular else t + span, h)
        apply(tables.span[slot], y, columns, len(y) + 2 * tables.count[slot] * tables.steps.shape[1], out)
        if traced:
            if count >= len(trace.length):
                return TRACE_FULL, count, switchings
            at_cam, offset = t * cam.speed + cam.borders[0], t * cam.speed + cam.borders[0] - cam.borders[piece]
            begin_segment(trace, count, at_cam, offset, slot, piece, y, out[len(y) :])
        length, watch, whole = cross(tables, slot, h, columns, (end - t) / h, work)
        t = t + length * h if watch >= 0 else end
        if watch < 0 and end >= border and piece + 2 < len(cam.borders):
            piece += 1
            columns = at + inputs_at(cam.pieces[piece], forces, 0.0, scale, y[at:])
        elif not whole:
            offset = t * cam.speed + cam.borders[0] - cam.borders[piece]
            inputs_at(cam.pieces[piece], forces, offset, scale, y[at:])
        if traced:
            end_segment(trace, count, length, watch, t * cam.speed + cam.borders[0], y)
            count += 1
        if watch >= 0:
            work.status[tables.element[slot, watch]] = train.then[tables.watch[slot, watch]]
            slot = slot_of(train, h, tables, work.status)
            switchings += 1
            if switchings > MOST_SWITCHINGS:
                return CHATTER, count, switchings
            if slot < 0:
                return TABLES_FULL, count, switchings
        elif end == target:
            step += 1
    return DONE, count, switchings
