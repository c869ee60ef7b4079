"""Files for grinding and for engine simulation: rounded lift tables and the contour, in millimetres.

The contour gives the point that touches the follower at each cam angle of the table. Its coordinates have one digit
more than the lift, so that the support function of the points (flat follower), or a roller placed on them, reproduces
the lift to half a unit of its last digit. Two rounded coordinates displace a point by up to 0.71 of a unit.

Engine simulations read the valve lift, static or at a speed, against the crank angle, with one row per degree. EngMod4T
takes two columns without a header, separated by a tab. Degree 0 is the last whole degree before the valve opens.

A drawing of the contour (DXF; needs the extra `dxf`, ezdxf) consists of circular arcs that join without a corner and
keep a tolerance. Between two points p0, p1 of the contour with the unit tangents t0, t1 there are two arcs (Bolton
1975, Computer-Aided Design 7, 101), which with v = p1 - p0 meet at (p0 + p1 + d (t0 - t1)) / 2, where

    v v - 2 d v (t0 + t1) - 2 d^2 (1 - t0 t1) = 0.

If two arcs deviate from the contour by more than the tolerance, their interval of the cam angle is halved.
"""

import io
from pathlib import Path
from typing import NamedTuple

import numpy as np

from camopt.cam.followers import cross, pairs
from camopt.cam.geometry import contact, crossing
from camopt.cam.lift import Lift, angles_deg, without_narrow
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM
from camopt.storage import write_csv, write_text

MOST_DIGITS = 12
BETWEEN = 8
"""Number of intervals between two rows at whose ends an interpolation is evaluated."""
OPEN_LIFT = 5e-4 * MM
"""Lift [m] above which a valve without lash counts as open."""


def write_rounded_table(path: str | Path, lift: Lift, step_deg: float, digits: int, rocker_ratio: float = 1.0) -> None:
    """Writes cam_angle_deg, lift_mm (at the valve) and, with a rocker ratio other than 1, tappet_lift_mm.

    Lifts have `digits` decimals. At the angles of the table the rounded lift is within half a unit of the last decimal;
    between them, the interpolation of rounded lifts adds up to a third of a unit if the step is 0.1 deg.
    """
    degrees = angles_deg(step_deg)
    height = lift(degrees * DEG) / MM
    columns = {"cam_angle_deg": _angle_cells(degrees), "lift_mm": rounded(height, digits)}
    if rocker_ratio != 1.0:
        columns["tappet_lift_mm"] = rounded(height / rocker_ratio, digits)
    write_csv(path, columns)


def write_crank_table(path: str | Path, lift: Lift, step_crank_deg: float, digits: int, cam_per_crank: float) -> None:
    """Writes crank_angle_deg, zero at the middle of the duration, and lift_mm over one turn of the cam, below a #
    header with the units. Raises InputError for a step that does not divide the turn of the cam."""
    degrees = angles_deg(step_crank_deg * cam_per_crank)
    cells = zip(_angle_cells(degrees / cam_per_crank), rounded(lift(degrees * DEG) / MM, digits), strict=True)
    head = ["# table-angle = crank", "# table-lift = mm", "crank_angle_deg,lift_mm"]
    write_text(path, "\n".join([*head, *map(",".join, cells)]) + "\n")


class TableError(NamedTuple):
    """Largest errors of a table [mm]: at its `rows`, and between them along straight `lines` and a cubic `spline`."""

    rows: float
    lines: float
    spline: float


def table_error(lift: Lift, step_deg: float, digits: int | None) -> TableError:
    """The largest errors of a table with this step in cam degrees and this many decimals; None means no rounding."""
    from scipy.interpolate import CubicSpline  # imported here because only this function needs SciPy's splines

    degrees = angles_deg(step_deg)
    exact = lift(degrees * DEG) / MM
    table = exact if digits is None else np.round(exact, digits)
    table[-1] = table[0]
    between = np.linspace(-180.0, 180.0, BETWEEN * (len(degrees) - 1) + 1)
    exact_between = lift(between * DEG) / MM
    curves = np.interp(between, degrees, table), CubicSpline(degrees, table, bc_type="periodic")(between)
    lines, spline = (float(np.abs(curve - exact_between).max()) for curve in curves)
    return TableError(float(np.abs(table - exact).max()), lines, spline)


def write_contour(path: str | Path, lift: Lift, geometry: Geometry, step_deg: float, digits: int) -> None:
    """Writes the contour against cam angle: x_mm, y_mm, polar_angle_deg and radius_mm of the point of contact.

    The axes are those of `Contact.contour`. `digits` is the number of decimals of the lift; lengths have one more, the
    polar angle three more. Raises InputError if no contour produces this lift with this follower.
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
    """Numbers with a fixed number of decimals, 0 to 12, and without a minus sign before zero."""
    if not 0 <= digits <= MOST_DIGITS:
        raise InputError(f"export: {digits} digits: give 0 to {MOST_DIGITS} decimals of a millimetre")
    return [f"{value:z.{digits}f}" for value in values]


def _angle_cells(degrees: np.ndarray) -> list[str]:
    """Angles to 1e-9 deg, whole ones without a decimal point."""
    return [f"{angle:.12g}" for angle in degrees]


def crank_rows(lift: Lift, lash: float, cam_per_crank: float) -> Float[np.ndarray, " k"]:
    """Crank angles [deg] from the middle of the cam's duration, a degree apart, from just before to just after the lift
    exceeds the lash [m], or half a micrometre without lash. Raises InputError if it never does."""
    opens, closes = (angle / DEG / cam_per_crank for angle in crossing(lift, max(lash, OPEN_LIFT)))
    return np.arange(np.floor(opens), np.ceil(closes) + 1)


def write_valve_lift(path: str | Path, lift: Float[np.ndarray, " k"], digits: int) -> None:
    """Writes lifts of a valve [m], a crank degree apart, with this many decimals of a millimetre."""
    rows = enumerate(rounded(lift / MM, digits))
    write_text(path, "".join(f"{degree}\t{height}\n" for degree, height in rows))


CONTOUR, BASE_CIRCLE, AXES = "CONTOUR", "BASE_CIRCLE", "AXES"
"""Layers of the drawing."""
FIRST_INTERVAL = 15.0 * DEG
"""Interval of the cam angle [rad] with which the search for arcs begins."""
POINTS_PER_INTERVAL = 16
"""Number of points per interval at which the distance of the contour from its arcs is evaluated."""
MOST_HALVINGS = 12
"""Largest number of times that an interval is halved."""


def write_dxf(path: str | Path, lift: Lift, geometry: Geometry, tolerance: float) -> tuple[int, float]:
    """Writes the contour as a closed polyline of arcs that join without a corner, in millimetres at full precision.

    Returns the number of arcs and their largest distance from the contour [m], which is at most `tolerance` [m] unless
    `MOST_HALVINGS` do not suffice. Base circle and axes are on layers of their own. Raises InputError if no contour
    produces this lift with this follower, and if ezdxf is not installed.
    """
    try:
        from ezdxf import units  # pyright: ignore[reportMissingImports]  # an extra
        from ezdxf.filemanagement import new  # pyright: ignore[reportMissingImports]  # an extra
    except ImportError:
        raise InputError("--dxf: needs the package ezdxf: pip install 'camopt[dxf]'") from None
    contact(lift, geometry).require_contour("contour")
    begins, bulge, missed = contour_arcs(lift, geometry, tolerance)
    drawing = new("R2010", units=units.MM)
    for layer, colour in ((CONTOUR, 7), (BASE_CIRCLE, 8), (AXES, 1)):
        drawing.layers.add(layer, color=colour)
    space = drawing.modelspace()
    corners = np.column_stack([pairs(begins) / MM, bulge]).tolist()
    space.add_lwpolyline(corners, format="xyb", close=True, dxfattribs={"layer": CONTOUR})
    space.add_circle((0, 0), geometry.base_radius_mm, dxfattribs={"layer": BASE_CIRCLE})
    reach = 1.1 * float(np.abs(begins).max()) / MM  # the axes end a tenth beyond the contour
    for end in ((reach, 0.0), (0.0, reach)):
        space.add_line((-end[0], -end[1]), end, dxfattribs={"layer": AXES})
    text = io.StringIO()
    drawing.write(text)
    write_text(path, text.getvalue())
    return len(begins), missed


def contour_arcs(lift: Lift, geometry: Geometry, tolerance: float) -> tuple[np.ndarray, Float[np.ndarray, " k"], float]:
    """A closed chain of arcs in ascending cam angle: the start of each (k), complex [m], its bulge (k), and their
    largest distance from the contour [m], at most `tolerance` [m] unless `MOST_HALVINGS` do not suffice.

    The bulge is the tangent of a quarter of the angle of the arc, positive for a turn to the left.
    """
    regular = np.arange(lift.borders[0], lift.borders[-1], FIRST_INTERVAL)
    edges = without_narrow(np.union1d(lift.borders, regular))
    first, second, missed = _biarcs(lift, geometry, edges)
    for _ in range(MOST_HALVINGS):
        wide = np.flatnonzero(missed > tolerance)
        if len(wide) == 0:
            break
        edges = np.sort(np.append(edges, 0.5 * (edges[wide] + edges[wide + 1])))
        first, second, missed = _biarcs(lift, geometry, edges)
    begins, bulge = (np.stack(both, axis=1).ravel() for both in zip(first, second, strict=True))
    return begins, bulge, float(missed.max())


def _biarcs(lift: Lift, geometry: Geometry, edges: np.ndarray):
    """The first and the second arc of every interval, as points (k) and bulges (k), and their largest error (k) [m]."""
    ends = contact(lift, geometry, edges)
    points, tangent = ends.contour @ (1, 1j), ends.normal @ (1j, -1)
    p0, p1, t0, t1 = points[:-1], points[1:], tangent[:-1], tangent[1:]
    v, turn = p1 - p0, 2 * (1 - np.real(np.conj(t0) * t1))
    along, square = np.real(np.conj(v) * (t0 + t1)), np.abs(v) ** 2
    d = square / (along + np.sqrt(along**2 + turn * square))
    joint = 0.5 * (p0 + p1 + d * (t0 - t1))
    first, last = _angle(t0, joint - p0), _angle(p1 - joint, t1)
    share = (np.arange(POINTS_PER_INTERVAL) + 0.5) / POINTS_PER_INTERVAL
    theta = (edges[:-1, None] + np.diff(edges)[:, None] * share).ravel()
    samples = (contact(lift, geometry, theta).contour @ (1, 1j)).reshape(len(p0), POINTS_PER_INTERVAL)
    before = np.real(np.conj(v)[:, None] * (samples - joint[:, None])) < 0
    error = np.where(
        before, _distance(samples, p0, t0, first, joint - p0), _distance(samples, p1, t1, last, p1 - joint)
    )
    return (p0, np.tan(first / 2)), (joint, np.tan(last / 2)), np.abs(error).max(axis=1)


def _angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle (k) from a (k) to b, positive to the left; zero if one of them is zero."""
    return np.where(np.abs(b) * np.abs(a) > 0, np.angle(np.conj(a) * b), 0.0)


def _distance(points: np.ndarray, on: np.ndarray, tangent: np.ndarray, half_turn: np.ndarray, chord: np.ndarray):
    """Distance (k, q) of points (k, q) from arcs through `on` (k) with this tangent there, positive to the left. An arc
    turns by twice `half_turn` over its chord."""
    length = np.abs(chord)
    curvature = np.divide(2 * np.sin(half_turn), length, out=np.zeros_like(length), where=length > 0)[:, None]
    offset = points - on[:, None]
    side = 2 * cross(tangent[:, None], offset) - curvature * np.abs(offset) ** 2
    return side / (1 + np.sqrt(np.maximum(1 - curvature * side, 0.0)))
