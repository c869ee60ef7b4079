"""The text of a lift table: any common delimiter, a header of any length before the rows, and keys in # lines.

Where semicolons, tabs or blanks separate the columns, a comma between digits is a decimal sign. The rows begin where
lines of numbers with equally many columns begin; the last line before them may name the columns. Rows in another order
and half a lobe are corrected, and gaps are reported, with one sentence (a note) on each.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from camopt.cam.tables.event import BASE_MM, CLOSING_SHARE, TURN
from camopt.scene import InputError
from camopt.scene.text_file import excerpt, read_text

MAX_FILE_BYTES = 20_000_000
LARGEST = 1e9
"""Largest magnitude of a number in a table; products with a unit then stay far from overflow."""
ALIKE = 3
"""Number of lines of numbers with equally many columns that count as the beginning of the rows."""
_HEADER_KEY = re.compile(r"\btable[-_](angle|lift|ratio|probe)\s*[=:]\s*([\w.+-]+)")

_OWN = {"cam_angle_deg", "lift_mm"}
"""Names of the columns of a table that camopt wrote."""
_WITH_COMMA = re.compile(r"[+-]?\d+(,\d+)?([eE][+-]?\d+)?")
"""A number whose decimal sign, if any, is a comma."""
_TORN = re.compile(r"[+-]?\d+,\d+,[+-]?\d+,\d+([eE][+-]?\d+)?")
"""Two such numbers separated by a comma."""
TOP_SHARE = 0.999
"""Lift of the first or last row, relative to the largest, from which half a lobe ends at its nose."""
GAP = 1.6
"""Step between two rows, relative to the larger of its neighbours, from which rows are missing between them."""
MOST_GAPS = 5
"""Largest number of gaps that are listed; the number of further ones is stated."""


@dataclass(frozen=True)
class TableText:
    """The numbers of a table file, its column names, and the keys in its # header."""

    names: list[str]
    keys: dict[str, str]
    rows: np.ndarray  # (r, c)
    lines: list[int]  # line number of each row
    notes: tuple[str, ...] = ()  # one sentence per correction made in reading it

    @property
    def own(self) -> bool:
        """Whether the columns have the names that camopt gives them, units included."""
        return _OWN <= set(self.names)


@dataclass(frozen=True)
class _Line:
    """A line of a table that is neither empty nor a comment."""

    number: int
    text: str
    cells: list[str]
    values: list[float]  # of its cells; empty if one of them is not a finite number


def parsed(path: Path, first_line: int | None = None, columns: Sequence[str | int] | None = None) -> TableText:
    """Numbers of a text file with any common delimiter, a header before them, and # comments.

    `first_line` is the line in which the rows begin, if the text does not show it; `columns` names the two that hold
    angle and lift, or counts them from 1. Raises InputError for rows that are not numbers in equal columns.
    """
    text = read_text(path, MAX_FILE_BYTES, "lift table", encoding="utf-8-sig")
    numbered = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1)]
    keys = dict(match for _, line in numbered if line.startswith("#") for match in _HEADER_KEY.findall(line))
    lines = [_line(number, line) for number, line in numbered if line and not line.startswith("#")]
    begin = _first_row(lines) if first_line is None else sum(line.number < first_line for line in lines)
    if begin == len(lines) or not any(line.values for line in lines[begin:]):
        after = "" if first_line is None else f" from line {first_line} on"
        raise InputError(f"{path}: holds no numbers{after}: give an angle and a lift in each row")
    rows = _rows(path, lines[begin:])
    names = _names(path, lines[:begin], rows.shape[1])
    if not names and rows.shape[1] == 4 and all(_TORN.fullmatch(cell) for line in lines for cell in line.text.split()):
        raise InputError(
            f"{path}: line {lines[begin].number}: commas separate columns and are decimal signs too: separate the "
            f"columns by semicolons, or write the numbers with points"
        )
    decimal_commas = any(_decimal_commas(line.text) for line in lines[begin:])
    notes = ("its commas are read as decimal signs",) if decimal_commas else ()
    if begin > 1:
        notes += (
            f"its rows begin in line {lines[begin].number}: the {begin} lines of text before them are its header",
        )
    table = TableText(names, keys, rows, [line.number for line in lines[begin:]], notes)
    return table if columns is None else _chosen(path, table, columns)


def _line(number: int, text: str) -> _Line:
    cells = _cells(text)
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        values = []
    return _Line(number, text, cells, values if np.all(np.isfinite(values)) else [])


def _first_row(lines: list[_Line]) -> int:
    """Index of the line in which the rows begin. A line of the header with as many numbers counts as the first row, so
    that a row which cannot be read is reported and not skipped."""
    widths = [len(line.values) for line in lines]
    runs = (i for i in range(len(lines)) if widths[i] > 1 and set(widths[i : i + ALIKE]) == {widths[i]})
    begin = next(runs, None)
    if begin is None:
        return next((i for i, width in enumerate(widths) if width > 1), len(lines))
    return next(i for i in range(begin + 1) if widths[i] == widths[begin])


def _rows(path: Path, lines: list[_Line]) -> np.ndarray:
    """The numbers (r, c) of lines that must all be rows with equally many columns."""
    width = len(lines[0].cells)
    for line in lines:
        where, shown = f"{path}: line {line.number}", f"{line.text[:60]!r}"
        if not line.values:
            raise InputError(
                f"{where}: expected finite numbers, found {shown}: correct it, begin it with # to leave it out, or "
                f"give the line in which the rows begin (--table-first-line)"
            )
        if max(map(abs, line.values)) > LARGEST:
            raise InputError(f"{where}: larger than any angle or lift, whatever its unit: correct {shown}")
        if len(line.values) < 2 or len(line.values) != width:
            raise InputError(f"{where}: {len(line.values)} columns; every row needs angle and lift in the same columns")
    return np.array([line.values for line in lines])


def _names(path: Path, header: list[_Line], width: int) -> list[str]:
    """The names of the columns, if the last line of the header has one for each."""
    cells = header[-1].cells if header else []
    if len(cells) != width and _OWN <= set(cells):
        raise InputError(f"{path}: {width} columns, and line {header[-1].number} names {len(cells)}: give all alike")
    return cells if len(cells) == width else []


def _chosen(path: Path, table: TableText, columns: Sequence[str | int]) -> TableText:
    """The table with only two of its columns, as angle and lift."""
    names = [name.lower() for name in table.names]
    at = []
    for column in map(str, columns):
        if column.isdecimal() and 1 <= int(column) <= table.rows.shape[1]:
            at.append(int(column) - 1)
        elif names.count(column.strip().lower()) == 1:
            at.append(names.index(column.strip().lower()))
        else:
            named = f", named {', '.join(map(repr, table.names))}" if table.names else " without names"
            raise InputError(
                f"{path}: no column {excerpt(column)} among its {table.rows.shape[1]}{named}: count them from 1, or "
                f"give a name that one column has"
            )
    if len(at) != 2 or at[0] == at[1]:
        wanted = excerpt(",".join(map(str, columns)))
        raise InputError(f"{path}: columns {wanted}: give one for the angle and one for the lift")
    return replace(table, names=[], rows=table.rows[:, at])


def _cells(line: str) -> list[str]:
    """A line split at its delimiter; with semicolons, tabs or blanks, a comma between digits is a decimal sign."""
    if _decimal_commas(line):
        line = line.replace(",", ".")
    for delimiter in (";", "\t"):
        if delimiter in line:
            return [cell.strip() for cell in line.split(delimiter)]
    return [cell.strip() for cell in line.split(",")] if "," in line else line.split()


def _decimal_commas(line: str) -> bool:
    """Whether commas in a line are decimal signs, because something else separates its numbers."""
    if "," not in line or line.lstrip().startswith("#"):
        return False
    if ";" in line or "\t" in line:
        return True
    cells = line.split()
    return len(cells) > 1 and all(map(_WITH_COMMA.fullmatch, cells))


@dataclass(frozen=True)
class TableRows:
    """Cam angles [deg] and lifts [mm] of a table's rows, their line numbers, and one sentence per correction."""

    degrees: np.ndarray = field(repr=False)
    height: np.ndarray = field(repr=False)
    lines: list[int] = field(repr=False)
    notes: tuple[str, ...] = ()


def mended(rows: TableRows) -> TableRows:
    """The rows in ascending order over at most one turn, with half a lobe made a whole one. Ambiguous rows (angles that
    repeat or jump) are left as they are and refused by the check of the rows."""
    return _gaps_named(_whole_lobe(_unwrapped(_ascending(rows))))


def _ascending(rows: TableRows) -> TableRows:
    if len(rows.degrees) < 2 or np.any(np.diff(rows.degrees) >= 0):
        return rows
    note = "its angles descend throughout: the rows are read from the last to the first"
    return TableRows(rows.degrees[::-1], rows.height[::-1], rows.lines[::-1], (*rows.notes, note))


def _unwrapped(rows: TableRows) -> TableRows:
    """The rows of a table that passes once from the end of a turn to its beginning, in ascending order."""
    drops = np.flatnonzero(np.diff(rows.degrees) < 0)
    if len(drops) != 1:
        return rows
    at = int(drops[0]) + 1
    degrees = np.append(rows.degrees[:at], rows.degrees[at:] + TURN)
    if rows.degrees[at - 1] - rows.degrees[at] < TURN / 2 or degrees[-1] - degrees[0] > TURN + 1e-9:
        return rows
    note = f"from line {rows.lines[at]} on its angles begin anew: they are read as those of the following turn"
    height, lines = rows.height, rows.lines
    shared = degrees[at] == degrees[at - 1] and abs(height[at] - height[at - 1]) <= CLOSING_SHARE * height.max()
    if shared:  # the same row at the end of a turn and at its beginning
        degrees, height, lines = np.delete(degrees, at), np.delete(height, at), [*lines[:at], *lines[at + 1 :]]
        note += f", line {rows.lines[at]} as the one before"
    return TableRows(degrees, height, lines, (*rows.notes, note))


def _whole_lobe(rows: TableRows) -> TableRows:
    """Half a lobe, from nose to base circle or from base circle to nose, completed by its mirror image."""
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
    if whole[0][-1] - whole[0][0] > TURN - 1e-9:  # both halves end in the same row of the base circle
        whole = whole[0][:-1], whole[1][:-1], whole[2][:-1]
    note = f"it is half a lobe, from line {rows.lines[nose]} at its nose: the other half is taken as its mirror image"
    return TableRows(*whole, (*rows.notes, note))


def _gaps_named(rows: TableRows) -> TableRows:
    """Adds a sentence for each step that is longer than both its neighbours because rows were left out."""
    steps = np.diff(rows.degrees)
    if len(steps) < 3 or np.any(steps <= 0):
        return rows
    beside = np.maximum(np.append(steps[1], steps[:-1]), np.append(steps[1:], steps[-2]))
    long = np.flatnonzero(steps > GAP * beside)
    notes = [
        f"rows are missing between lines {rows.lines[i]} and {rows.lines[i + 1]}, {steps[i]:g} cam degrees apart: "
        f"the law there is that of their neighbours"
        for i in long[:MOST_GAPS]
    ]
    if len(long) > MOST_GAPS:
        notes.append(f"rows are missing at {len(long) - MOST_GAPS} places more")
    return TableRows(rows.degrees, rows.height, rows.lines, (*rows.notes, *notes))
