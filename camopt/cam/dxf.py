"""The contour of a cam as a drawing file (DXF) for whoever mills or grinds it; needs the extra `dxf` (ezdxf)."""

import io
from pathlib import Path

from camopt.cam.exports import made_contour
from camopt.cam.geometry import Contact
from camopt.cam.lift import Lift
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.units import MM
from camopt.storage import write_text

CONTOUR, BASE_CIRCLE, AXES = "CONTOUR", "BASE_CIRCLE", "AXES"
"""Layers of the drawing."""


def write_dxf(path: str | Path, lift: Lift, geometry: Geometry, step_deg: float) -> None:
    """Writes the contour as a closed polyline through its points at every step of the cam angle, in millimetres.

    The axis of the cam is the origin and the nose lies towards +x, as in `camopt.cam.exports.write_contour`; base
    circle and axes lie on layers of their own. Coordinates have every digit; between two points a chord misses the
    contour by step^2 / 8 of its radius of curvature. Raises InputError where no contour gives this lift to this
    follower, and where ezdxf is not installed.
    """
    try:
        from ezdxf import units  # pyright: ignore[reportMissingImports]  # an extra
        from ezdxf.filemanagement import new  # pyright: ignore[reportMissingImports]  # an extra
    except ImportError:
        raise InputError("--dxf: needs the package ezdxf: pip install 'camopt[dxf]'") from None
    points = made_contour(lift, geometry, step_deg)
    drawing = new("R2010", units=units.MM)
    for layer, colour in ((CONTOUR, 7), (BASE_CIRCLE, 8), (AXES, 1)):
        drawing.layers.add(layer, color=colour)
    space = drawing.modelspace()
    corners = [(float(x), float(y)) for x, y in points.contour[:-1] / MM]
    space.add_lwpolyline(corners, close=True, dxfattribs={"layer": CONTOUR})
    space.add_circle((0, 0), geometry.base_radius_mm, dxfattribs={"layer": BASE_CIRCLE})
    for end in _axes(points):
        space.add_line((-end[0], -end[1]), end, dxfattribs={"layer": AXES})
    text = io.StringIO()
    drawing.write(text)
    write_text(path, text.getvalue())


def _axes(points: Contact) -> list[tuple[float, float]]:
    """Ends of the two axes [mm], a tenth beyond the contour."""
    reach = 1.1 * float(points.polar[1].max()) / MM
    return [(reach, 0.0), (0.0, reach)]
