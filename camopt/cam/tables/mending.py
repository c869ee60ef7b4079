"""Tables that are not as they should be, but say clearly what they mean: put right, with a sentence on each mend."""

from dataclasses import dataclass, field

import numpy as np

from camopt.cam.tables.event import BASE_MM, CLOSING_SHARE, TURN

TOP_SHARE = 0.999
"""Lift of the first or last row over the largest, from which on half a lobe ends at its nose."""
GAP = 1.6
"""Step from one row to the next over the larger of its neighbours', from which on rows are missing between."""
MOST_GAPS = 5
"""Gaps that are named; how many more there are is said."""


@dataclass(frozen=True)
class TableRows:
    """Cam angles [deg] and lifts [mm] of a table's rows, their line numbers, and what was mended, a sentence each."""

    degrees: np.ndarray = field(repr=False)
    height: np.ndarray = field(repr=False)
    lines: list[int] = field(repr=False)
    said: tuple[str, ...] = ()


def mended(rows: TableRows) -> TableRows:
    """The rows in ascending order over one turn at most where they say how, half a lobe as a whole one.

    What cannot be told (angles that repeat or jump) is left as it is, for the check of the rows to refuse.
    """
    return _gaps_named(_whole_lobe(_unwrapped(_ascending(rows))))


def _ascending(rows: TableRows) -> TableRows:
    if len(rows.degrees) < 2 or np.any(np.diff(rows.degrees) >= 0):
        return rows
    said = "its angles descend throughout: the rows are read from the last to the first"
    return TableRows(rows.degrees[::-1], rows.height[::-1], rows.lines[::-1], (*rows.said, said))


def _unwrapped(rows: TableRows) -> TableRows:
    """A table that passes from the end of a turn to its begin, once."""
    drops = np.flatnonzero(np.diff(rows.degrees) < 0)
    if len(drops) != 1:
        return rows
    at = int(drops[0]) + 1
    degrees = np.append(rows.degrees[:at], rows.degrees[at:] + TURN)
    if rows.degrees[at - 1] - rows.degrees[at] < TURN / 2 or degrees[-1] - degrees[0] > TURN + 1e-9:
        return rows
    said = f"from line {rows.lines[at]} on its angles begin anew: they are read as those of the following turn"
    height, lines = rows.height, rows.lines
    shared = degrees[at] == degrees[at - 1] and abs(height[at] - height[at - 1]) <= CLOSING_SHARE * height.max()
    if shared:  # the row that closes a turn and the one that begins it
        degrees, height, lines = np.delete(degrees, at), np.delete(height, at), [*lines[:at], *lines[at + 1 :]]
        said += f", line {rows.lines[at]} as the one before"
    return TableRows(degrees, height, lines, (*rows.said, said))


def _whole_lobe(rows: TableRows) -> TableRows:
    """Half a lobe from nose to base circle, or the other way round, mirrored about its nose."""
    degrees, height = rows.degrees, rows.height
    if len(degrees) < 2 or np.any(np.diff(degrees) <= 0) or degrees[-1] - degrees[0] > TURN / 2 + 1e-9:
        return rows
    first, last = height[0], height[-1]
    nose = 0 if first > last else -1
    if max(first, last) < TOP_SHARE * height.max() or abs(min(first, last)) > BASE_MM:
        return rows
    mirror = slice(None, 0, -1) if nose == 0 else slice(-2, None, -1)
    away = 2 * degrees[nose] - degrees[mirror]
    parts = [(away, height[mirror], rows.lines[mirror]), (degrees, height, rows.lines)]
    (a, h, n), (b, g, m) = parts if nose == 0 else parts[::-1]
    whole = np.append(a, b), np.append(h, g), [*n, *m]
    if whole[0][-1] - whole[0][0] > TURN - 1e-9:  # the base circle's last row is met from both sides
        whole = whole[0][:-1], whole[1][:-1], whole[2][:-1]
    said = f"it is half a lobe, from line {rows.lines[nose]} at its nose: the other half is taken as its mirror image"
    return TableRows(*whole, (*rows.said, said))


def _gaps_named(rows: TableRows) -> TableRows:
    """Steps that are longer than both their neighbours, as rows left out make them."""
    steps = np.diff(rows.degrees)
    if len(steps) < 3 or np.any(steps <= 0):
        return rows
    beside = np.maximum(np.append(steps[1], steps[:-1]), np.append(steps[1:], steps[-2]))
    long = np.flatnonzero(steps > GAP * beside)
    said = [
        f"rows are missing between lines {rows.lines[i]} and {rows.lines[i + 1]}, {steps[i]:g} cam degrees apart: "
        f"the law there is that of their neighbours"
        for i in long[:MOST_GAPS]
    ]
    if len(long) > MOST_GAPS:
        said.append(f"rows are missing at {len(long) - MOST_GAPS} places more")
    return TableRows(rows.degrees, rows.height, rows.lines, (*rows.said, *said))
