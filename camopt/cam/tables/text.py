"""The text of a lift table: any common delimiter, at most one line of column names, and keys in a # header.

A comma between digits is a decimal sign where semicolons, tabs or blanks part the columns.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camopt.scene import InputError
from camopt.scene.text_file import read_text

MAX_FILE_BYTES = 20_000_000
LARGEST = 1e9
"""Of any number in a table: products with a unit stay far from overflow."""
_HEADER_KEY = re.compile(r"\btable[-_](angle|lift|ratio|probe)\s*[=:]\s*([\w.+-]+)")

_WITH_COMMA = re.compile(r"[+-]?\d+(,\d+)?([eE][+-]?\d+)?")
"""A number whose decimal sign, if any, is a comma."""
_TORN = re.compile(r"[+-]?\d+,\d+,[+-]?\d+,\d+([eE][+-]?\d+)?")
"""Two such numbers with a comma between them."""


@dataclass(frozen=True)
class TableText:
    """The numbers of a table file, its column names, and the keys in its # header."""

    names: list[str]
    keys: dict[str, str]
    rows: np.ndarray  # (r, c)
    lines: list[int]  # line number of each row
    said: tuple[str, ...] = ()  # what was mended in reading it

    @property
    def own(self) -> bool:
        """Whether the columns are named as camopt names them, units included."""
        return {"cam_angle_deg", "lift_mm"} <= set(self.names)


def parsed(path: Path) -> TableText:
    """Numbers of a text file with any common delimiter, at most one line of column names, and # comments."""
    text = read_text(path, MAX_FILE_BYTES, "lift table", encoding="utf-8-sig")
    names: list[str] = []
    keys: dict[str, str] = {}
    rows: list[list[float]] = []
    lines: list[int] = []
    for number, line in enumerate(text.splitlines(), 1):
        line = line.strip()
        if line.startswith("#"):
            keys |= dict(_HEADER_KEY.findall(line))
            continue
        if not line:
            continue
        cells = _cells(line)
        values = [_number(cell) for cell in cells]
        if not rows and not names and None in values:
            names = cells
            continue
        finite = [v for v in values if v is not None and np.isfinite(v)]
        if len(finite) != len(cells):
            raise InputError(f"{path}: line {number}: expected finite numbers, found {line[:60]!r}")
        if max(map(abs, finite)) > LARGEST:
            raise InputError(
                f"{path}: line {number}: larger than any angle or lift, whatever its unit: correct {line[:60]!r}"
            )
        if len(finite) < 2 or (rows and len(finite) != len(rows[0])) or (names and len(finite) != len(names)):
            raise InputError(f"{path}: line {number}: {len(finite)} columns; each row needs angle and lift, all alike")
        rows.append(finite)
        lines.append(number)
    if not rows:
        raise InputError(f"{path}: holds no numbers: give an angle and a lift in each row")
    if not names and len(rows[0]) == 4 and all(map(_TORN.fullmatch, text.split())):
        raise InputError(
            f"{path}: line {lines[0]}: commas stand between its columns and in its numbers: part the columns by "
            f"semicolons, or write the numbers with points"
        )
    said = ("its commas are read as decimal signs",) if any(map(_decimal_commas, text.splitlines())) else ()
    return TableText(names, keys, np.array(rows), lines, said)


def _cells(line: str) -> list[str]:
    """A line split at its delimiter; beside semicolons, tabs or blanks a comma between digits is a decimal sign."""
    if _decimal_commas(line):
        line = line.replace(",", ".")
    for delimiter in (";", "\t"):
        if delimiter in line:
            return [cell.strip() for cell in line.split(delimiter)]
    return [cell.strip() for cell in line.split(",")] if "," in line else line.split()


def _decimal_commas(line: str) -> bool:
    """Whether a line has commas in numbers that something else parts."""
    if "," not in line or line.lstrip().startswith("#"):
        return False
    if ";" in line or "\t" in line:
        return True
    cells = line.split()
    return len(cells) > 1 and all(map(_WITH_COMMA.fullmatch, cells))


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None
