"""The contour of a cam as a drawing file (DXF) for whoever mills or grinds it; needs the extra `dxf` (ezdxf).

The contour is drawn as circular arcs that join without a corner, within a tolerance. Between two points of the contour
with their tangents lie two arcs (Bolton 1975, Computer-Aided Design 7, 101): with points p0, p1, v = p1 - p0 and unit
tangents t0, t1 they meet at (p0 + p1 + d (t0 - t1)) / 2, where

    v v - 2 d v (t0 + t1) - 2 d^2 (1 - t0 t1) = 0.

Where two arcs miss the contour by more than the tolerance, their interval of the cam angle is halved.
"""

import io
from pathlib import Path

import numpy as np

from camopt.cam.followers import cross
from camopt.cam.geometry import contact
from camopt.cam.lift import APART, Lift
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM
from camopt.storage import write_text

CONTOUR, BASE_CIRCLE, AXES = "CONTOUR", "BASE_CIRCLE", "AXES"
"""Layers of the drawing."""
LONGEST = 15.0 * DEG
"""Interval of the cam angle with which the search for arcs begins."""
LOOKED_AT = 16
"""Places in each interval at which the distance of the contour from its arcs is taken."""
FINEST = 12
"""Halvings of an interval, at most."""


def write_dxf(path: str | Path, lift: Lift, geometry: Geometry, tolerance: float) -> tuple[int, float]:
    """Writes the contour as a closed polyline of arcs that join without a corner, in millimetres.

    The contour misses them by at most `tolerance` [m]; returned is how many there are, and by how much it misses them
    [m]. The axis of the cam is the origin and the nose lies towards +x, as in `camopt.cam.exports.write_contour`; base
    circle and axes lie on layers of their own. Coordinates have every digit. Raises InputError where no contour gives
    this lift to this follower, and where ezdxf is not installed.
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
    corners = np.column_stack([begins / MM, bulge]).tolist()
    space.add_lwpolyline(corners, format="xyb", close=True, dxfattribs={"layer": CONTOUR})
    space.add_circle((0, 0), geometry.base_radius_mm, dxfattribs={"layer": BASE_CIRCLE})
    reach = 1.1 * float(np.hypot(*begins.T).max()) / MM  # the axes end a tenth beyond the contour
    for end in ((reach, 0.0), (0.0, reach)):
        space.add_line((-end[0], -end[1]), end, dxfattribs={"layer": AXES})
    text = io.StringIO()
    drawing.write(text)
    write_text(path, text.getvalue())
    return len(begins), missed


def contour_arcs(
    lift: Lift, geometry: Geometry, tolerance: float
) -> tuple[Float[np.ndarray, "k 2"], Float[np.ndarray, " k"], float]:
    """A closed chain of arcs in ascending cam angle from the back of the cam: where each begins [m], its bulge, and by
    how much the contour is missed at most [m], which is no more than `tolerance` [m].

    A bulge is the tangent of a quarter of the angle that the arc turns through, positive to the left.
    """
    edges = np.unique(np.append(lift.borders, np.arange(lift.borders[0], lift.borders[-1], LONGEST)))
    edges = edges[np.append(np.diff(edges) > APART, True)]
    for _ in range(FINEST):
        first, second, missed = _biarcs(lift, geometry, edges)
        wide = np.flatnonzero(missed > tolerance)
        if len(wide) == 0:
            break
        edges = np.sort(np.append(edges, 0.5 * (edges[wide] + edges[wide + 1])))
    else:
        first, second, missed = _biarcs(lift, geometry, edges)
    begins = np.stack([first[0], second[0]], axis=1).reshape(-1, 2)
    bulge = np.stack([first[1], second[1]], axis=1).ravel()
    return begins, bulge, float(missed.max())


def _biarcs(lift: Lift, geometry: Geometry, edges: np.ndarray):
    """The first and the second arc of every interval, as points (k, 2) and bulges (k), and what both miss (k) [m]."""
    ends = contact(lift, geometry, edges)
    tangent = np.stack([-ends.normal[:, 1], ends.normal[:, 0]], axis=1)
    p0, p1, t0, t1 = ends.contour[:-1], ends.contour[1:], tangent[:-1], tangent[1:]
    v, both, turn = p1 - p0, (t0 + t1), 2 * (1 - (t0 * t1).sum(axis=1))
    along, square = (v * both).sum(axis=1), (v * v).sum(axis=1)
    d = square / (along + np.sqrt(along**2 + turn * square))
    joint = 0.5 * (p0 + p1 + d[:, None] * (t0 - t1))
    first, last = _angle(t0, joint - p0), _angle(p1 - joint, t1)
    share = (np.arange(LOOKED_AT) + 0.5) / LOOKED_AT
    theta = (edges[:-1, None] + np.diff(edges)[:, None] * share).ravel()
    there = contact(lift, geometry, theta).contour.reshape(len(p0), LOOKED_AT, 2)
    before = ((there - joint[:, None]) * v[:, None]).sum(axis=2) < 0
    away = np.where(before, _distance(there, p0, t0, first, joint - p0), _distance(there, p1, t1, last, p1 - joint))
    return (p0, np.tan(first / 2)), (joint, np.tan(last / 2)), np.abs(away).max(axis=1)


def _angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle (k) from vectors a (k, 2) to b, to the left; zero where one is no longer than rounding."""
    angle = np.arctan2(cross(a, b), (a * b).sum(axis=1))
    return np.where(np.hypot(*b.T) * np.hypot(*a.T) > 0, angle, 0.0)


def _distance(points: np.ndarray, on: np.ndarray, tangent: np.ndarray, half_turn: np.ndarray, chord: np.ndarray):
    """Distance (k, q) of points (k, q, 2) from circles through `on` (k, 2) with a tangent there, to the left; one turns
    by twice `half_turn` over a chord."""
    length = np.hypot(*chord.T)
    curvature = np.divide(2 * np.sin(half_turn), length, out=np.zeros_like(length), where=length > 0)[:, None]
    from_there = points - on[:, None]
    side = 2 * cross(tangent[:, None], from_there) - curvature * (from_there**2).sum(axis=2)
    return side / (1 + np.sqrt(np.maximum(1 - curvature * side, 0.0)))
