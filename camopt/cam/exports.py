"""Files for grinding and for engine simulation: lift tables and the contour, in millimetres with a number of digits.

The contour gives the point that touches the follower at each cam angle of the table. Its coordinates carry one digit
more than the lift: two rounded coordinates miss a point by up to 0.71 of a unit, and a roller's lift by that over the
cosine of the pressure angle, so with the lift's own digits half a unit of lift could not be kept. As each point comes
with its cam angle, nothing need be interpolated to rebuild the lift there: the support function of the points (flat
follower) or the roller laid on them meets it within half a unit of the lift's last digit.

Engine simulations read the valve's lift by the crank's angle, a row each degree: EngMod4T takes two columns without a
header, parted by a tab. The lift is the static one, which is the cam's less the lash, or that of a motion at a speed.
Degree 0 is the last whole one before the valve opens.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camopt.cam.geometry import contact, crossing
from camopt.cam.lift import Lift, angles_deg
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM
from camopt.storage import write_csv, write_text

MOST_DIGITS = 12
BETWEEN = 8
"""Places between two rows at which an interpolation is looked at."""
NOTHING = 5e-4 * MM
"""Lift [m] from which a valve without lash counts as open."""


def write_rounded_table(path: str | Path, lift: Lift, step_deg: float, digits: int, rocker_ratio: float = 1.0) -> None:
    """Writes cam_angle_deg, lift_mm (at the valve) and, with a rocker ratio other than 1, tappet_lift_mm.

    Lifts carry `digits` decimals: at the table's angles what is read back differs by at most half a unit of the last;
    between them the interpolation of rounded lifts adds up to a third of a unit where the step is 0.1 deg.
    """
    degrees = angles_deg(step_deg)
    height = lift(degrees * DEG) / MM
    columns = {"cam_angle_deg": _angle_cells(degrees), "lift_mm": rounded(height, digits)}
    if rocker_ratio != 1.0:
        columns["tappet_lift_mm"] = rounded(height / rocker_ratio, digits)
    write_csv(path, columns)


def write_crank_table(path: str | Path, lift: Lift, step_crank_deg: float, digits: int, cam_per_crank: float) -> None:
    """Writes crank_angle_deg, zero at the middle of the duration, and lift_mm over the crank's turns of one of the cam.

    A # header names the units, so that `camopt.cam.tables.lift_table.read_lift_table` reads it back as any other
    table. Raises InputError for a step that does not divide the cam's turn.
    """
    degrees = angles_deg(step_crank_deg * cam_per_crank)
    cells = zip(_angle_cells(degrees / cam_per_crank), rounded(lift(degrees * DEG) / MM, digits), strict=True)
    head = ["# table-angle = crank", "# table-lift = mm", "crank_angle_deg,lift_mm"]
    write_text(path, "\n".join([*head, *map(",".join, cells)]) + "\n")


@dataclass(frozen=True)
class TableError:
    """What a lift table is off by [mm]: at its `rows`, and between them along straight `lines` and along the periodic
    cubic `spline` through them."""

    rows: float
    lines: float
    spline: float


def table_error(lift: Lift, step_deg: float, digits: int | None) -> TableError:
    """The largest errors of a table in steps of cam degrees with this many decimals, every digit where None."""
    from scipy.interpolate import CubicSpline  # brings SciPy's splines, which nothing else here needs

    degrees = angles_deg(step_deg)
    true = lift(degrees * DEG) / MM
    table = true if digits is None else np.round(true, digits)
    table[-1] = table[0]
    between = np.linspace(-180.0, 180.0, BETWEEN * (len(degrees) - 1) + 1)
    there = lift(between * DEG) / MM
    curves = np.interp(between, degrees, table), CubicSpline(degrees, table, bc_type="periodic")(between)
    lines, spline = (float(np.abs(curve - there).max()) for curve in curves)
    return TableError(float(np.abs(table - true).max()), lines, spline)


def write_contour(path: str | Path, lift: Lift, geometry: Geometry, step_deg: float, digits: int) -> None:
    """Writes the contour by cam angle: x_mm, y_mm, polar_angle_deg and radius_mm of the point of contact.

    The axis of the cam is the origin, the nose towards +x, the cam turning against the angle (mirror it for the other
    sense). `digits` are the lift's; lengths carry one more, the polar angle three more. Raises InputError where no
    contour gives this lift to this follower.
    """
    contact(lift, geometry).require_contour("contour")
    degrees = angles_deg(step_deg)
    points = contact(lift, geometry, degrees * DEG)
    x, y = points.contour.T
    angle, radius = points.polar
    columns = {
        "cam_angle_deg": _angle_cells(degrees),
        "x_mm": rounded(x / MM, digits + 1),
        "y_mm": rounded(y / MM, digits + 1),
        "polar_angle_deg": rounded(angle / DEG, digits + 3),
        "radius_mm": rounded(radius / MM, digits + 1),
    }
    write_csv(path, columns)


def rounded(values: Float[np.ndarray, " k"], digits: int) -> list[str]:
    """Numbers with a fixed number of decimals, 0 to 12; no minus before a zero."""
    if not 0 <= digits <= MOST_DIGITS:
        raise InputError(f"export: {digits} digits: give 0 to {MOST_DIGITS} decimals of a millimetre")
    return [f"{value:z.{digits}f}" for value in values]


def _angle_cells(degrees: np.ndarray) -> list[str]:
    """Angles to 1e-9 deg, whole ones without a point."""
    return [f"{angle:.12g}" for angle in degrees]


def crank_rows(lift: Lift, lash: float, cam_per_crank: float) -> Float[np.ndarray, " k"]:
    """Crank angles [deg] from the middle of the cam's duration, a degree apart, from before the opening to after the
    closing, which are where the lift passes the lash [m], or half a micrometre without one.

    Raises InputError where the lift never does.
    """
    opens, closes = (angle / DEG / cam_per_crank for angle in crossing(lift, max(lash, NOTHING)))
    return np.arange(np.floor(opens), np.ceil(closes) + 1)


def static_lift(lift: Lift, lash: float, theta: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """The valve's lift [m] at cam angles [rad] where it follows the cam: max(0, lift - lash)."""
    return np.maximum(lift(theta) - lash, 0.0)


def write_valve_lift(path: str | Path, lift: Float[np.ndarray, " k"], digits: int) -> None:
    """Writes a valve's lifts [m], a crank degree apart, with this many decimals of a millimetre."""
    rows = enumerate(rounded(lift / MM, digits))
    write_text(path, "".join(f"{degree}\t{height}\n" for degree, height in rows))
