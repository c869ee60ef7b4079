"""The contour of a cam as a drawing file (DXF) for whoever mills or grinds it; needs the extra `dxf` (ezdxf)."""

import io
from pathlib import Path

import numpy as np

from camopt.cam.arcs import contour_arcs
from camopt.cam.exports import check_contour
from camopt.cam.lift import Lift
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.units import MM
from camopt.storage import write_text

CONTOUR, BASE_CIRCLE, AXES = "CONTOUR", "BASE_CIRCLE", "AXES"
"""Layers of the drawing."""


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
    check_contour(lift, geometry)
    arcs = contour_arcs(lift, geometry, tolerance)
    drawing = new("R2010", units=units.MM)
    for layer, colour in ((CONTOUR, 7), (BASE_CIRCLE, 8), (AXES, 1)):
        drawing.layers.add(layer, color=colour)
    space = drawing.modelspace()
    corners = np.column_stack([arcs.begins / MM, arcs.bulge]).tolist()
    space.add_lwpolyline(corners, format="xyb", close=True, dxfattribs={"layer": CONTOUR})
    space.add_circle((0, 0), geometry.base_radius_mm, dxfattribs={"layer": BASE_CIRCLE})
    reach = 1.1 * float(np.hypot(*arcs.begins.T).max()) / MM  # the axes end a tenth beyond the contour
    for end in ((reach, 0.0), (0.0, reach)):
        space.add_line((-end[0], -end[1]), end, dxfattribs={"layer": AXES})
    text = io.StringIO()
    drawing.write(text)
    write_text(path, text.getvalue())
    return len(arcs.begins), arcs.missed
