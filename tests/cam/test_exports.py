"""What is written for the grinder: lift table and contour, read back with half a unit to spare, and the contour as a
drawing, read back by ezdxf's own reader."""

import builtins
import csv

import numpy as np
import pytest
from scipy.spatial import KDTree

from camopt.cam.exports import (
    BASE_CIRCLE,
    CONTOUR,
    table_error,
    write_contour,
    write_crank_table,
    write_dxf,
    write_rounded_table,
)
from camopt.cam.geometry import contact
from camopt.cam.lift import angles_deg
from camopt.cam.tables.lift_table import read_lift_table
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM, UM
from tests.cam.cams import CAMS, FLAT, FOLLOWERS, KODAMA, WIDE, resting
from tests.cam.cams import POLYDYNE as CAM

ROUND_OFF = 1e-13
"""Of the lift [mm]: where it lies in the middle between two of the digits, half a unit is met only up to that."""


def columns(path) -> dict[str, np.ndarray]:
    with open(path, newline="") as text:
        rows = list(csv.DictReader(text))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def decimals(path, name: str) -> set[int]:
    with open(path, newline="") as text:
        return {len(row[name].partition(".")[2]) for row in csv.DictReader(text)}


def lift_from_contour(points: np.ndarray, geometry: Geometry, theta: np.ndarray) -> np.ndarray:
    """Lift (k) [m] of the follower that rests on points (p, 2) [m] of a contour at cam angles (k) [rad]; between the
    angles of the points it is short by about step^2 / 8 times the radius of curvature."""
    return np.array([resting(points, geometry, at) for at in theta])


@pytest.mark.parametrize("digits", [3, 4, 5, 6])
@pytest.mark.parametrize("name", CAMS)
class TestRoundTrip:
    def test_lift_table(self, tmp_path, name, digits):
        lift, path = CAMS[name], tmp_path / "lift.csv"
        write_rounded_table(path, lift, 0.5, digits, rocker_ratio=1.6)
        theta = np.linspace(-180, 180, 721) * DEG
        half = 0.5 * 10.0**-digits + ROUND_OFF
        read = read_lift_table(path, KODAMA)
        assert np.abs(read(theta) - lift(theta)).max() / MM <= half
        written = columns(path)
        assert np.abs(written["tappet_lift_mm"] - lift(theta) / 1.6 / MM).max() <= half
        assert decimals(path, "lift_mm") == decimals(path, "tappet_lift_mm") == {digits}
        assert written["cam_angle_deg"] * DEG == pytest.approx(theta, abs=1e-12)

    @pytest.mark.parametrize("geometry", [WIDE, FOLLOWERS["roller"]], ids=["flat", "roller"])
    def test_contour(self, tmp_path, name, digits, geometry):
        """Lift rebuilt from all the points by the follower that rests on them, Cartesian and polar."""
        lift, path = CAMS[name], tmp_path / "contour.csv"
        write_contour(path, lift, geometry, 1.0, digits)
        written = columns(path)
        theta = written["cam_angle_deg"] * DEG
        angle, radius = written["polar_angle_deg"] * DEG, written["radius_mm"]
        cartesian = np.column_stack([written["x_mm"], written["y_mm"]]) * MM
        polar = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]) * MM
        for points in (cartesian, polar):
            error = lift_from_contour(points, geometry, theta) - lift(theta)
            assert np.abs(error).max() / MM < 0.5 * 10.0**-digits
            assert np.abs(error).max() / MM > 1e-3 * 10.0**-digits  # rounded indeed
        assert decimals(path, "radius_mm") == decimals(path, "x_mm") == {digits + 1}


ROCKED = FOLLOWERS["roller"].model_copy(update={"rocker_ratio": 1.5})


@pytest.mark.parametrize("geometry", [WIDE, ROCKED], ids=["flat", "roller"])
def test_rebuilt_lift_sees_a_change_of_the_contour(tmp_path, geometry):
    lift, path = CAMS["multi-pol"], tmp_path / "contour.csv"
    write_contour(path, lift, geometry, 0.1, 9)
    written = columns(path)
    theta = written["cam_angle_deg"] * DEG
    points = np.column_stack([written["x_mm"], written["y_mm"]]) * MM
    assert lift_from_contour(points, geometry, theta) == pytest.approx(lift(theta), abs=1e-9 * MM)
    between = theta[:-1] + 0.05 * DEG  # short by step^2 / 8 times the radius, with the roller's added
    short = lift(between) - lift_from_contour(points, geometry, between)
    assert -1e-9 * MM < short.min()
    assert short.max() < 1.5 * 200 * MM * (0.1 * DEG) ** 2 / 8
    grown = points * (1 + 1 * MM / np.hypot(*points.T))[:, None]
    ratio = geometry.rocker_ratio
    assert lift_from_contour(grown, geometry, theta[:1]) == pytest.approx(lift(theta[:1]) + ratio * MM, rel=1e-6)


@pytest.mark.parametrize(("step", "digits"), [(0.5, 4), (1.0, 5), (2.0, 6)])
def test_crank_table(tmp_path, step, digits):
    """Read back without a word about its units: the header has them; at its rows within half a unit, then smoothed."""
    lift, path = CAMS["multi-pol"], tmp_path / "lift.csv"
    write_crank_table(path, lift, step, digits, 0.5)
    rows = np.loadtxt(path, delimiter=",", skiprows=3)
    assert rows[:, 0] == pytest.approx(np.linspace(-360, 360, round(720 / step) + 1))
    assert np.abs(rows[:, 1] - lift(rows[:, 0] / 2 * DEG) / MM).max() <= 0.5 * 10.0**-digits + ROUND_OFF
    read = read_lift_table(path, KODAMA)
    assert read.parameters["angle"] == "crank"
    theta = np.linspace(-60, 60, 241) * DEG
    assert np.abs(read(theta) - lift(theta)).max() / MM < 10.0**-digits + 2e-4


@pytest.mark.parametrize("digits", [3, 5, None])
def test_stated_errors_of_a_table(digits):
    """Against sums of their own: rows by rounding, lines by a grid ten times finer than the one they are found on."""
    lift, step = CAMS["polydyne"], 1.0
    found = table_error(lift, step, digits)
    degrees = np.arange(-180.0, 180.5, step)
    exact = lift(degrees * DEG) / MM
    table = exact if digits is None else np.array([round(float(v), digits) for v in exact])
    assert found.rows == pytest.approx(np.abs(table - exact).max(), abs=1e-12)
    assert found.rows <= (0.0 if digits is None else 0.5 * 10.0**-digits + ROUND_OFF)
    fine = np.linspace(-180, 180, 36_001)
    lines = np.abs(np.interp(fine, degrees, table) - lift(fine * DEG) / MM).max()
    assert found.lines == pytest.approx(lines, rel=0.05)
    assert found.spline < found.lines
    bend = max(map(abs, lift.extremes(2))) * DEG**2 / MM
    assert lines <= bend * step**2 / 8 + found.rows + ROUND_OFF


def test_bad_exports(tmp_path):
    lift = CAMS["polydyne"]
    with pytest.raises(InputError, match=r"step 0\.7 deg: a step that divides 360 deg"):
        write_rounded_table(tmp_path / "a.csv", lift, 0.7, 4)
    with pytest.raises(InputError, match="13 digits"):
        write_rounded_table(tmp_path / "a.csv", lift, 1.0, 13)
    with pytest.raises(InputError, match="contour: a flat follower needs"):
        write_contour(tmp_path / "a.csv", CAMS["multi-pol"], FLAT, 1.0, 4)
    assert list(tmp_path.iterdir()) == []


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
