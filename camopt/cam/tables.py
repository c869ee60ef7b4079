"""Lift tables: camopt's own `lift.csv`, read back unsmoothed, and tables from elsewhere with their units named."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camopt.cam.lift import Lift, lift_table
from camopt.cam.table_spline import centred, event_borders, table_pieces
from camopt.scene import InputError, Scene
from camopt.scene.units import DEG, MM
from camopt.storage import write_csv

MAX_FILE_BYTES = 20_000_000
FEWEST_ROWS = 20
LIFT_UNITS_MM = {"mm": 1.0, "m": 1e3, "inch": 25.4}
ANGLE_KINDS = ("cam", "crank")
PLAUSIBLE = 10.0
"""Largest ratio, either way, of a table's lift to the scene's maximum lift: beyond it the unit is taken to be wrong."""
_HEADER_KEY = re.compile(r"table[-_](angle|lift)\s*[=:]\s*(\w+)")


@dataclass(frozen=True)
class _Table:
    """The numbers of a table file, its column names, and the keys in its # header."""

    names: list[str]
    keys: dict[str, str]
    rows: np.ndarray  # (r, c)
    lines: list[int]  # line number of each row

    @property
    def own(self) -> bool:
        """Whether the columns are named as camopt names them, units included."""
        return {"cam_angle_deg", "lift_mm"} <= set(self.names)


def write_lift_table(path: str | Path, lift: Lift, step_deg: float = 0.1) -> None:
    """Writes `lift.csv`: angle, lift, velocity, acceleration and jerk with every digit, -180 to 180 deg."""
    if not (step_deg > 0 and abs(round(360 / step_deg) * step_deg - 360) < 1e-9 * 360 / step_deg):
        raise InputError(f"lift table: step {step_deg} deg: a step that divides 360 deg is needed")
    write_csv(path, lift_table(lift, step_deg))


def read_lift_table(
    path: str | Path, scene: Scene, table_angle: str | None = None, table_lift: str | None = None
) -> Lift:
    """The lift law of a table, interpolated by a quintic spline without smoothing.

    A table with the columns cam_angle_deg and lift_mm (camopt's own) needs no more; its duration is the scene's. Any
    other needs `table_angle` (cam, crank) and `table_lift` (mm, m, inch), here or as keys in its # header: its first
    two columns are angle [deg] and lift, it covers a turn or one event that begins and ends on the base circle, and its
    duration is what lies between the scene's ramp heights, whose middle becomes angle zero.
    Raises InputError with file and line for anything else.
    """
    assert scene.design is not None and scene.operation is not None, "load_scene(..., need=...) guarantees both"
    table = _parsed(Path(path))
    given = {k: v or table.keys.get(k) for k, v in (("angle", table_angle), ("lift", table_lift))}
    if table.own:
        if given["angle"] not in (None, "cam") or given["lift"] not in (None, "mm"):
            raise InputError(f"{path}: its columns are named cam_angle_deg and lift_mm, against the units given for it")
        degrees, height = (table.rows[:, table.names.index(n)] for n in ("cam_angle_deg", "lift_mm"))
        if abs(degrees[0] + 180) > 1e-9 or abs(degrees[-1] - 180) > 1e-9:
            raise InputError(
                f"{path}: cam_angle_deg runs from {degrees[0]:g} to {degrees[-1]:g} and must run from -180 to 180"
            )
    else:
        degrees, height = _foreign(path, table, given, scene)
    _check(path, table, degrees, height, scene.design.max_lift_mm)
    pieces = table_pieces(str(path), degrees * DEG, height * MM)
    if table.own:
        middle, half = 0.0, scene.design.duration_deg * DEG / 2
    else:
        opening, closing = (h * MM for h, _, _ in scene.design.ramps())
        start, end = event_borders(str(path), pieces, opening, closing)
        middle, half = 0.5 * (start + end), 0.5 * (end - start)
    borders, coefficients = centred(pieces, middle)
    return Lift(borders, coefficients, half, "table", {"file": Path(path).name, "rows": len(degrees)})


def _foreign(path, table: _Table, given: dict, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Cam angle [deg] and lift [mm] of a table from elsewhere."""
    if given["angle"] not in ANGLE_KINDS or given["lift"] not in LIFT_UNITS_MM:
        raise InputError(
            f"{path}: not a table that camopt wrote, so its units must be named: "
            f"--table-angle {'|'.join(ANGLE_KINDS)} --table-lift {'|'.join(LIFT_UNITS_MM)}"
        )
    assert scene.operation is not None
    per_unit = scene.operation.cam_per_crank if given["angle"] == "crank" else 1.0
    return table.rows[:, 0] * per_unit, table.rows[:, 1] * LIFT_UNITS_MM[given["lift"]]


def _check(path, table: _Table, degrees: np.ndarray, height: np.ndarray, max_lift_mm: float) -> None:
    if len(degrees) < FEWEST_ROWS:
        raise InputError(f"{path}: {len(degrees)} rows, and at least {FEWEST_ROWS} are needed to interpolate a lift")
    bad = np.flatnonzero(np.diff(degrees) <= 0)
    if len(bad):
        i = int(bad[0])
        kind = "is repeated" if degrees[i + 1] == degrees[i] else "decreases"
        raise InputError(f"{path}: line {table.lines[i + 1]}: the angle {kind}; angles must ascend from row to row")
    if degrees[-1] - degrees[0] > 360 + 1e-9:
        raise InputError(
            f"{path}: the table covers {degrees[-1] - degrees[0]:g} cam degrees, more than one turn: "
            f"check --table-angle (crank angles are halved) or cut it to one turn"
        )
    ratio = height.max() / max_lift_mm
    if not 1 / PLAUSIBLE <= ratio <= PLAUSIBLE:
        raise InputError(
            f"{path}: the largest lift is {height.max():g} mm against the scene's max_lift_mm of {max_lift_mm:g}: "
            f"check --table-lift"
        )


def _parsed(path: Path) -> _Table:
    """Numbers of a text file with any common delimiter, at most one line of column names, and # comments."""
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise InputError(f"{path}: larger than {MAX_FILE_BYTES} bytes, which no lift table needs")
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as UTF-8 text ({error})") from error
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
        if len(finite) < 2 or (rows and len(finite) != len(rows[0])) or (names and len(finite) != len(names)):
            raise InputError(f"{path}: line {number}: {len(finite)} columns; each row needs angle and lift, all alike")
        rows.append(finite)
        lines.append(number)
    if not rows:
        raise InputError(f"{path}: holds no numbers; a lift table has an angle and a lift in each row")
    return _Table(names, keys, np.array(rows), lines)


def _cells(line: str) -> list[str]:
    """A line split at its delimiter; beside semicolons or tabs a comma is a decimal sign."""
    for delimiter in (";", "\t"):
        if delimiter in line:
            return [cell.strip().replace(",", ".") for cell in line.split(delimiter)]
    return [cell.strip() for cell in line.split(",")] if "," in line else line.split()


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None
