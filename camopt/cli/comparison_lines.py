"""The table that ends `camopt compare`: a line per cam of comparison.csv, its worst over the speeds."""

import csv
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

VERDICTS = ("confirmed", "sensitive", "not converged", "rejected")
"""From the best to the worst; a cam's is the worst of its speeds."""
BROKEN_WIDTH = 48
"""Characters of what is broken that a line shows; comparison.csv holds all of it."""
_AT_SPEED = re.compile(r" at [\d.e+]+ r/min$")
HEAD = ("cam", "area ratio", "bounce mm", "jump mm", "verdict", "broken")


def distinct_names(paths: Sequence[str]) -> list[str]:
    """What designs are called in tables and figures: the last parts of their paths, the whole ones where two agree."""
    last = [Path(path).name or path for path in paths]
    return [str(Path(path)) if last.count(name) > 1 else name for path, name in zip(paths, last, strict=True)]


def comparison_lines(folder: Path) -> list[str]:
    """Lines of a compact table: cam, area ratio, worst bounce and jump over the speeds [mm], verdict, broken limits."""
    with open(folder / "comparison.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    cams = [[row for row in rows if row["cam"] == name] for name in dict.fromkeys(row["cam"] for row in rows)]
    table = [HEAD, *(_line(of_cam) for of_cam in cams)]
    widths = [max(len(line[i]) for line in table) for i in range(len(HEAD))]
    return ["  ".join(_aligned(line, widths)).rstrip() for line in table]


def _line(rows: list[dict[str, str]]) -> tuple[str, ...]:
    named = (_AT_SPEED.sub("", name) for row in rows for name in row["broken"].split("; ") if name)
    broken = ", ".join(dict.fromkeys(named))
    shown = broken if len(broken) <= BROKEN_WIDTH else broken[: BROKEN_WIDTH - 3] + "..."
    verdict = max((row["verdict"] for row in rows), key=lambda word: VERDICTS.index(word) if word in VERDICTS else 99)
    ratio = f"{float(rows[0]['area_ratio']):.4f}" if rows[0]["area_ratio"] else "none"
    bounce = _worst((row["bounce_high_mm"] or row["bounce_mm"]) for row in rows)
    return rows[0]["cam"], ratio, bounce, _worst(row["jump_mm"] for row in rows), verdict, shown or "nothing"


def _worst(cells: Iterable[str]) -> str:
    numbers = [float(cell) for cell in cells if cell]
    return f"{max(numbers):.4f}" if numbers else "none"


def _aligned(line: tuple[str, ...], widths: list[int]) -> list[str]:
    """Words to the left, numbers to the right."""
    cells = enumerate(zip(line, widths, strict=True))
    return [cell.rjust(width) if 1 <= i <= 3 else cell.ljust(width) for i, (cell, width) in cells]
