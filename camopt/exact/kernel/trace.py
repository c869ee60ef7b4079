"""The trace of a motion, from which it can be differentiated: one row per segment of exact propagation."""

from typing import NamedTuple

import numpy as np

from camopt.programs import inner, njit_no_refcount


class Trace(NamedTuple):
    """Segments of one or more revolutions; in each, one combination of pieces and one piece of the lift hold.

    A segment ends at a switching (`watch` >= 0), at a border of the lift's pieces, or after the steps of one span.
    `looks` are the values and slopes of the watched quantities at every step, from the span's table.
    """

    angle: np.ndarray  # (k + 1) rad from -pi, at the segments' starts and the last one's end
    offset: np.ndarray  # (k) rad from the start of the lift's piece
    length: np.ndarray  # (k) in steps
    slot: np.ndarray  # (k) slot of the tables, which identifies the combination of pieces
    piece: np.ndarray  # (k) piece of the lift
    watch: np.ndarray  # (k) watch that ended the segment by turning negative; -1 for none
    y: np.ndarray  # (k + 1, c - 1): x, v, z and the inputs by the step
    looks: np.ndarray  # (k, 2 w (m + 1))


def empty_trace(segments: int, width: int, looks: int) -> Trace:
    """A trace with room for a number of segments; y has `width` numbers, and a row of looks has `looks`."""
    return Trace(
        np.empty(segments + 1),
        np.empty(segments),
        np.empty(segments),
        np.empty(segments, dtype=np.int64),
        np.empty(segments, dtype=np.int64),
        np.empty(segments, dtype=np.int64),
        np.empty((segments + 1, width)),
        np.empty((segments, looks)),
    )


NO_TRACE = empty_trace(0, 0, 0)
"""Trace of a motion that is not recorded."""


@njit_no_refcount
def begin_segment(trace, k, angle, offset, slot, piece, y, looks):
    """Write row k of a trace, except for the end of its segment."""
    trace.angle[k], trace.offset[k] = angle, offset
    trace.slot[k], trace.piece[k] = slot, piece
    row, looks_row = trace.y[k], trace.looks[k]
    for i in range(len(y)):
        row[i] = y[i]
    for i in range(min(len(looks), len(looks_row))):
        looks_row[i] = looks[i]


@njit_no_refcount
def end_segment(trace, k, length, watch, angle, y):
    """Write the end of row k: the length of the segment, the watch that ended it, and the state at its end."""
    trace.length[k], trace.watch[k], trace.angle[k + 1] = length, watch, angle
    row = trace.y[k + 1]
    for i in range(len(y)):
        row[i] = y[i]


def rows_of(trace, begin, end):
    """The segments `begin` to `end` of a trace, as views."""
    return Trace(
        trace.angle[begin : end + 1],
        trace.offset[begin:end],
        trace.length[begin:end],
        trace.slot[begin:end],
        trace.piece[begin:end],
        trace.watch[begin:end],
        trace.y[begin : end + 1],
        trace.looks[begin:end],
    )


cut = inner(rows_of)
"""`rows_of` for compiled functions."""
