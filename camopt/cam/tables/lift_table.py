"""Lift tables: camopt's own `lift.csv`, read without smoothing, and tables from elsewhere with units to be named."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.interpolate import PPoly

from camopt.cam.conversion import converted
from camopt.cam.lift import Lift, lift_table
from camopt.cam.ramps import Ramp, scene_ramps
from camopt.cam.tables.interpolation import centred, event_borders, own_pieces, spline_pieces
from camopt.cam.tables.smoothing import check_between_rows, smoothed
from camopt.cam.tables.text import TableRows, TableText, mended, parsed
from camopt.scene import InputError, Scene
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM
from camopt.storage import write_csv

FEWEST_ROWS = 20
MOST_ROWS = 20_000
DERIVATIVES = {"velocity_mm_per_deg": 1, "acceleration_mm_per_deg2": 2}
"""Columns of camopt's own tables that are read beside the lift, with the order of the derivative."""
LIFT_UNITS_MM = {"mm": 1.0, "m": 1e3, "inch": 25.4}
ANGLE_KINDS = ("cam", "crank")
MOST_DECIMALS = 12
"""Largest number of decimals of a table's lifts [mm]; with more, they count as not rounded."""
PLAUSIBLE = 10.0
"""Largest ratio, either way, of a table's lift to the scene's maximum lift; beyond it the unit counts as wrong."""
PLAUSIBLE_DURATION = 1.8
"""The same for the duration, which changes by a factor of two if the cam angle is taken for the crank angle."""


def write_lift_table(path: str | Path, lift: Lift, step_deg: float = 0.1) -> None:
    """Writes `lift.csv`: angle, lift, velocity, acceleration and jerk at full precision, from -180 to 180 deg."""
    write_csv(path, lift_table(lift, step_deg))


def read_lift_table(
    path: str | Path,
    scene: Scene,
    table_angle: str | None = None,
    table_lift: str | None = None,
    table_ratio: float | None = None,
    table_probe_mm: float | None = None,
    *,
    table_first_line: int | None = None,
    table_columns: Sequence[str | int] | None = None,
) -> Lift:
    """The lift law of a table: camopt's own without smoothing, any other smoothed within its noise.

    A table with the columns cam_angle_deg and lift_mm (camopt's own) needs no other information: the law passes through
    every row, and has the velocity and acceleration that stand beside the lift. Any other table needs `table_angle`
    (cam, crank) and `table_lift` (mm, m, inch), here or as keys in its # header. `table_ratio` (1) converts tappet lift
    into the valve lift of the scene. `table_probe_mm` states that a ball probe of this radius (infinite: a flat one)
    measured the cam itself, whose lift is converted into that of the scene's follower. The first two columns are angle
    [deg] and lift, unless `table_columns` names two others or counts them from 1. The rows begin after a header of any
    length, or in the line `table_first_line`. The table covers a turn, one event that begins and ends on the base
    circle, or half a lobe from its nose, and the middle of its duration becomes angle zero. Everything that was done to
    it (corrections, noise, outliers, largest shift of a row, lift added where a ramp is missing, error of the
    acceleration) is in the lift's `parameters`; see `camopt.cam.tables.text` and `smoothing`. The duration of every
    table lies between the scene's ramp heights. Raises InputError with file and line for anything else.
    """
    where, table = str(path), parsed(Path(path), table_first_line, table_columns)
    arguments = {"angle": table_angle, "lift": table_lift, "ratio": table_ratio, "probe": table_probe_mm}
    options = {key: table.keys.get(key) if value is None else str(value) for key, value in arguments.items()}
    rows = _own(where, table, options) if table.own else mended(_foreign(where, table, options, scene))
    design = scene.required_design
    _check(where, rows, design.max_lift_mm)
    report = {"file": Path(path).name, "rows": len(rows.degrees)}
    if table.own:
        pieces = _own_pieces(where, table, rows)
    else:
        pieces, changes = _measured(where, rows, scene_ramps(design))
        report |= {"angle": options["angle"], "lift": options["lift"]}
        report |= {"ratio": float(options["ratio"] or 1), **changes}
        if rows.notes:
            report["mended"] = list(rows.notes)
    report |= _row_error(rows, report)
    if options["probe"] is not None:
        pieces = _followed(where, pieces, options, scene)
        report["probe_mm"] = options["probe"]
    opening, closing = (h * MM for h, _, _ in design.ramps())
    start, end = event_borders(where, pieces, opening, closing)
    table_deg, scene_deg = (end - start) / DEG, design.duration_deg
    if not 1 / PLAUSIBLE_DURATION <= table_deg / scene_deg <= PLAUSIBLE_DURATION:
        raise InputError(
            f"{where}: {table_deg:.0f} cam degrees lie between the ramp heights against the scene's duration_deg of "
            f"{scene_deg:g}: check --table-angle (crank angles are halved)"
        )
    borders, coefficients = centred(pieces, 0.0 if table.own else 0.5 * (start + end))
    return Lift(borders, coefficients, 0.5 * (end - start), "table", report)


def _own(where: str, table: TableText, options: dict) -> TableRows:
    """The rows of a table that camopt wrote."""
    named = options["angle"] not in (None, "cam") or options["lift"] not in (None, "mm")
    if named or options["ratio"] is not None or options["probe"] is not None:
        raise InputError(
            f"{where}: its columns are named cam_angle_deg and lift_mm, against the units given for it: "
            f"leave these out, or name the columns otherwise"
        )
    degrees, height = (table.rows[:, table.names.index(n)] for n in ("cam_angle_deg", "lift_mm"))
    if abs(degrees[0] + 180) > 1e-9 or abs(degrees[-1] - 180) > 1e-9:
        raise InputError(
            f"{where}: cam_angle_deg runs from {degrees[0]:g} to {degrees[-1]:g} and must run from -180 to 180"
        )
    return TableRows(degrees, height, table.lines)


def _own_pieces(where: str, table: TableText, rows: TableRows) -> PPoly:
    """Pieces [rad, m] over one turn of a table that camopt wrote, with or without the derivatives beside the lift."""
    if not set(DERIVATIVES) <= set(table.names):
        return spline_pieces(where, rows.degrees * DEG, rows.height * MM)
    velocity, acceleration = (
        table.rows[:, table.names.index(name)] * MM / DEG**order for name, order in DERIVATIVES.items()
    )
    return own_pieces(where, rows.degrees * DEG, rows.height * MM, velocity, acceleration, table.lines)


def _foreign(where: str, table: TableText, options: dict, scene: Scene) -> TableRows:
    """The rows of a table from elsewhere."""
    if options["angle"] not in ANGLE_KINDS or options["lift"] not in LIFT_UNITS_MM:
        raise InputError(
            f"{where}: not a table that camopt wrote, so its units must be named: "
            f"--table-angle {'|'.join(ANGLE_KINDS)} --table-lift {'|'.join(LIFT_UNITS_MM)}"
        )
    ratio = _positive(options["ratio"] or "1")
    if not (math.isfinite(ratio) and ratio > 0):
        raise InputError(
            f"{where}: the ratio is {options['ratio']!r}; valve lift over the table's lift must be a number above 0"
        )
    if len(table.rows) > MOST_ROWS:
        raise InputError(f"{where}: {len(table.rows)} rows, more than {MOST_ROWS}: give every n-th row")
    per_unit = scene.required_operation.cam_per_crank if options["angle"] == "crank" else 1.0
    height = table.rows[:, 1] * LIFT_UNITS_MM[options["lift"]] * ratio
    return TableRows(table.rows[:, 0] * per_unit, height, table.lines, table.notes)


def _positive(text: str) -> float:
    """A number above zero, infinity included; NaN for anything else."""
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if value > 0 else math.nan


def _followed(where: str, pieces: PPoly, options: dict, scene: Scene) -> PPoly:
    """The pieces [rad, m] of the scene's follower on the cam that a probe measured with these pieces."""
    radius = _positive(options["probe"])
    if math.isnan(radius) or options["ratio"] is not None:
        raise InputError(
            f"{where}: the probe is {options['probe']!r}; expected the radius of its ball in mm or inf for a flat one, "
            f"and no ratio beside it: the scene's [geometry] has that"
        )
    if scene.geometry is None:
        raise InputError(f"{where}: a probe's lift becomes a follower's by [geometry]: add it to the scene")
    probe = Geometry(follower="flat", base_radius_mm=scene.geometry.base_radius_mm)
    if math.isfinite(radius):
        probe = Geometry(follower="roller", base_radius_mm=scene.geometry.base_radius_mm, roller_radius_mm=radius)
    try:
        law = converted(Lift(*centred(pieces, 0.0), np.pi), probe, scene.geometry)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return PPoly(law.coefficients[:, ::-1].T, law.borders)


def _measured(where: str, rows: TableRows, ramps: tuple[Ramp, Ramp]) -> tuple[PPoly, dict]:
    """Pieces [rad, m] over one turn of a table from elsewhere, and a report on what was done to it."""
    degrees, height = rows.degrees, rows.height
    smooth, report = smoothed(where, degrees, height, rows.lines, ramps)
    if smooth is not None:
        powers = np.arange(len(smooth.c))[::-1, None]
        return PPoly(smooth.c * MM / DEG**powers, smooth.x * DEG), report
    pieces = spline_pieces(where, degrees * DEG, height * MM)
    first = pieces.x[0]
    check_between_rows(
        where, lambda at: pieces(np.mod(at * DEG - first, 2 * np.pi) + first) / MM, degrees, height, rows.lines
    )
    return pieces, report


def _row_error(rows: TableRows, report: dict) -> dict:
    """The largest error of the law at the rows of a table with equal steps whose only error is rounding, and the step;
    empty for tables that were measured, or whose steps differ."""
    step, decimals = float(np.median(np.diff(rows.degrees))), range(MOST_DECIMALS + 1)
    unit = next((10.0**-d for d in decimals if np.array_equal(np.round(rows.height, d), rows.height)), 0.0)
    equal = np.abs(np.diff(rows.degrees) - step).max() < 1e-6 * step and abs(round(360 / step) - 360 / step) < 1e-6
    if not equal or report.get("outliers") or report.get("noise_um", 0.0) > unit / 2 * 1e3:
        return {}
    return {"row_error_mm": unit / 2 + report.get("largest_shift_um", 0.0) * 1e-3, "step_deg": round(step, 9)}


def _check(where: str, rows: TableRows, max_lift_mm: float) -> None:
    degrees, height = rows.degrees, rows.height
    if len(degrees) < FEWEST_ROWS:
        raise InputError(f"{where}: {len(degrees)} rows, and at least {FEWEST_ROWS} are needed for a lift")
    bad = np.flatnonzero(np.diff(degrees) <= 0)
    if len(bad):
        i = int(bad[0])
        kind = "is repeated" if degrees[i + 1] == degrees[i] else "decreases"
        raise InputError(f"{where}: line {rows.lines[i + 1]}: the angle {kind}; angles must ascend from row to row")
    if degrees[-1] - degrees[0] > 360 + 1e-9:
        raise InputError(
            f"{where}: the table covers {degrees[-1] - degrees[0]:g} cam degrees, more than one turn: "
            f"check --table-angle (crank angles are halved) or cut it to one turn"
        )
    ratio = height.max() / max_lift_mm
    if not 1 / PLAUSIBLE <= ratio <= PLAUSIBLE:
        raise InputError(
            f"{where}: the largest lift is {height.max():g} mm against the scene's max_lift_mm of {max_lift_mm:g}: "
            f"check --table-lift"
        )
