"""The contour as a drawing, read back by ezdxf's own reader and compared."""

import builtins

import numpy as np
import pytest

from camopt.cam.dxf import BASE_CIRCLE, CONTOUR, write_dxf
from camopt.cam.families.polydyne import polydyne
from camopt.cam.geometry import contact
from camopt.cam.lift import angles_deg
from camopt.scene import InputError, load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM
from tests.cam.test_followers import FOLLOWERS, resting

CAM = polydyne(load_scene("kodama"))


WIDE = Geometry(follower="flat", base_radius_mm=40)


@pytest.mark.parametrize("geometry", [WIDE, *(FOLLOWERS[name] for name in ("roller", "finger, pad", "rocker, roller"))])
def test_read_back(tmp_path, geometry):
    """Every point is the contour's, the drawing is in millimetres, and the follower has its lift on what was read."""
    ezdxf = pytest.importorskip("ezdxf")
    write_dxf(tmp_path / "cam.dxf", CAM, geometry, 0.5)
    drawing = ezdxf.readfile(tmp_path / "cam.dxf")
    assert drawing.units == ezdxf.units.MM
    assert not drawing.audit().errors
    (polyline,) = drawing.modelspace().query(f"LWPOLYLINE[layer=='{CONTOUR}']")
    assert polyline.closed
    points = np.array([p[:2] for p in polyline.get_points()])
    theta = angles_deg(0.5)[:-1] * DEG
    assert points == pytest.approx(contact(CAM, geometry, theta).contour / MM, abs=1e-9)
    lift = np.array([resting(points * MM, geometry, at) for at in theta[::31]])
    assert np.abs(lift - CAM(theta[::31])).max() < 1e-9 * MM
    (circle,) = drawing.modelspace().query(f"CIRCLE[layer=='{BASE_CIRCLE}']")
    assert circle.dxf.radius == geometry.base_radius_mm


def test_no_contour_no_drawing(tmp_path):
    pytest.importorskip("ezdxf")
    with pytest.raises(InputError, match="contour: a flat follower needs"):
        write_dxf(tmp_path / "cam.dxf", CAM, Geometry(follower="flat", base_radius_mm=5), 1.0)
    assert list(tmp_path.iterdir()) == []


def test_without_ezdxf_the_extra_is_named(tmp_path, monkeypatch):
    real = builtins.__import__

    def importing(name, *rest):
        if name == "ezdxf":
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", importing)
    with pytest.raises(InputError, match=r"pip install 'camopt\[dxf\]'"):
        write_dxf(tmp_path / "cam.dxf", CAM, FOLLOWERS["flat"], 1.0)
