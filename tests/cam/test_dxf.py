"""The contour as a drawing, read back by ezdxf's own reader and compared."""

import builtins

import numpy as np
import pytest
from scipy.spatial import KDTree

from camopt.cam.exports import BASE_CIRCLE, CONTOUR, write_dxf
from camopt.cam.geometry import contact
from camopt.cam.lift import angles_deg
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM, UM
from tests.cam.cams import FOLLOWERS, WIDE, resting
from tests.cam.cams import POLYDYNE as CAM

KINDS = [WIDE, *(FOLLOWERS[name] for name in ("roller", "finger, pad", "rocker, roller"))]


def drawn(folder, geometry, tolerance_um):
    ezdxf = pytest.importorskip("ezdxf")
    said = write_dxf(folder / "cam.dxf", CAM, geometry, tolerance_um * UM)
    drawing = ezdxf.readfile(folder / "cam.dxf")
    assert drawing.units == ezdxf.units.MM
    assert not drawing.audit().errors
    (polyline,) = drawing.modelspace().query(f"LWPOLYLINE[layer=='{CONTOUR}']")
    assert polyline.closed
    return drawing, polyline, said


@pytest.mark.parametrize("geometry", KINDS)
def test_the_arcs_keep_the_tolerance_and_the_lift(tmp_path, geometry):
    """Points of the arcs, made by ezdxf, lie within the tolerance of the contour's dense chords, and the follower has
    its lift on them within the tolerance over the cosine of the largest pressure angle."""
    drawing, polyline, (count, missed) = drawn(tmp_path, geometry, 0.5)
    assert len(polyline) == count and missed <= 0.5 * UM
    from ezdxf.path import make_path

    points = np.array([(p.x, p.y) for p in make_path(polyline).flattening(1e-6)]) * MM
    fine = contact(CAM, geometry, np.linspace(-np.pi, np.pi, 40_001))
    nearest = KDTree(fine.contour).query(points)[1]
    along = ((points - fine.contour[nearest]) * fine.normal[nearest]).sum(axis=1)
    assert np.abs(along).max() < 0.5 * UM + 2e-9  # flattening, and the curvature over half a step of 3 um
    theta = angles_deg(0.5)[:-1:31] * DEG
    lift = np.array([resting(points, geometry, at) for at in theta])
    most = 1 / np.cos(np.abs(fine.pressure_angle).max()) * np.abs(fine.ratio).max()
    assert np.abs(lift - CAM(theta)).max() < 0.5 * UM * max(most, 1.0) + 5e-9
    (circle,) = drawing.modelspace().query(f"CIRCLE[layer=='{BASE_CIRCLE}']")
    assert circle.dxf.radius == geometry.base_radius_mm


@pytest.mark.parametrize("geometry", KINDS)
def test_neighbouring_arcs_join_without_a_corner(tmp_path, geometry):
    polyline = drawn(tmp_path, geometry, 0.5)[1]
    x, y, bulge = np.array(polyline.get_points("xyb")).T
    chord = np.angle(np.roll(x, -1) - x + 1j * (np.roll(y, -1) - y))
    half = 2 * np.arctan(bulge)
    corner = np.angle(np.exp(1j * (chord - half - np.roll(chord + half, 1))))
    assert np.abs(corner).max() < 1e-6  # coordinates of 1e-12 mm over arcs of a tenth of a micrometre and more


def test_a_tighter_tolerance_takes_more_arcs_and_is_kept(tmp_path):
    counts = []
    for tolerance_um in (5.0, 0.05):
        count, missed = drawn(tmp_path, WIDE, tolerance_um)[2]
        assert missed <= tolerance_um * UM
        counts.append(count)
    assert counts[0] < counts[1]


def test_no_contour_no_drawing(tmp_path):
    pytest.importorskip("ezdxf")
    with pytest.raises(InputError, match="contour: a flat follower needs"):
        write_dxf(tmp_path / "cam.dxf", CAM, Geometry(follower="flat", base_radius_mm=5), UM)
    assert list(tmp_path.iterdir()) == []


def test_without_ezdxf_the_extra_is_named(tmp_path, monkeypatch):
    real = builtins.__import__

    def importing(name, *rest):
        if name == "ezdxf":
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", importing)
    with pytest.raises(InputError, match=r"pip install 'camopt\[dxf\]'"):
        write_dxf(tmp_path / "cam.dxf", CAM, FOLLOWERS["flat"], UM)
