"""A table that camopt read comes back from camopt's own lift.csv as the same cam, and every record shows itself."""

from pathlib import Path

import numpy as np
import pytest

from camopt.cam.exports import write_rounded_table
from camopt.cam.families.trapezoid import trapezoid
from camopt.cam.geometry import contact
from camopt.cam.hertz import HertzStress
from camopt.cam.lift import Lift
from camopt.cam.ramps import scene_ramps
from camopt.cam.read import read_cam
from camopt.cam.tables.lift_table import read_lift_table, write_lift_table
from camopt.scene import InputError
from camopt.scene.units import DEG, MM
from tests.cam.cams import CAMS, KODAMA, MEASURED, POLYDYNE, THETA, WIDE, difference, with_design


def noisy_raw_table(folder: Path, lift: Lift, scale: float = 1.0) -> Path:
    """A raw table in crank angles, its nose at 100 deg, 2 um of noise; `scale` lengthens its angles."""
    degrees = np.arange(0.0, 360.5)
    from_nose = np.mod(degrees - 100 + 180, 360) - 180
    height = lift(from_nose / scale * DEG) / MM * (np.abs(from_nose) < 104 * scale)
    height[height > 0] += np.random.default_rng(5).normal(0, 2e-3, np.count_nonzero(height))
    height[-1] = height[0]
    file = folder / "raw.dat"
    np.savetxt(file, np.column_stack([2 * degrees, height]), header="table-angle = crank\ntable-lift = mm")
    return file


def assert_same_cam(back: Lift, lift: Lift) -> None:
    # the columns have every digit; a spline's knots between two rows leave 1e-10 mm (measured 4e-11)
    assert difference(back, lift) < 3e-10 * MM
    assert difference(back, lift, 2) < 1e-4 * np.abs(lift.extremes(2)).max()
    # the crossing of a ramp of 0.01 mm/deg moves by the error in lift over that slope
    assert back.half_duration == pytest.approx(lift.half_duration, abs=3e-8 * DEG)
    assert back.area_ratio(9.4 * MM) == pytest.approx(lift.area_ratio(9.4 * MM), rel=1e-9)


@pytest.mark.parametrize("scale", [0.85, 1.0, 1.2])
def test_a_raw_table_comes_back_through_lift_csv_as_the_same_cam(tmp_path, scale):
    lift = read_cam(noisy_raw_table(tmp_path, POLYDYNE, scale), KODAMA)
    # 2 um over a slope of 0.011 mm/deg on either side: 0.26 deg, and twice that
    assert 2 * lift.half_duration / DEG == pytest.approx(144 * scale, abs=0.52)
    write_lift_table(tmp_path / "lift.csv", lift)
    assert_same_cam(read_cam(tmp_path / "lift.csv", KODAMA), lift)


@pytest.mark.parametrize("lift", CAMS.values(), ids=CAMS)
def test_families_with_steps_come_back_with_their_duration(tmp_path, lift):
    write_lift_table(tmp_path / "lift.csv", lift)
    back = read_cam(tmp_path / "lift.csv", KODAMA)
    # a step of 0.015 mm/deg^2 inside an interval of 0.1 deg is worth 0.015 (0.1)^2 / 8 at most
    assert difference(back, lift) < 2e-5 * MM
    assert back.half_duration == pytest.approx(lift.half_duration, abs=1e-9)
    assert back.area_ratio(9.4 * MM) == pytest.approx(lift.area_ratio(9.4 * MM), rel=1e-7)


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured tables lie outside the repository")
@pytest.mark.parametrize("name", ["motorbike-exhaust-ramps", "motorbike-intake-coarse"])
def test_motorbike_tables_come_back(tmp_path, name):
    lift = read_cam(MEASURED / f"{name}.dat", KODAMA, "crank", "m")
    write_lift_table(tmp_path / "lift.csv", lift)
    assert_same_cam(read_cam(tmp_path / "lift.csv", KODAMA), lift)


def test_a_shorter_cam_keeps_its_own_duration_when_rounded(tmp_path):
    lift = trapezoid(with_design(duration_deg=118), (5.0, 8.0, 13.0, 33.0))
    write_rounded_table(tmp_path / "lift.csv", lift, 0.5, 5)
    back = read_lift_table(tmp_path / "lift.csv", KODAMA)
    # half a unit of the last digit over the ramp's slope
    assert 2 * back.half_duration / DEG == pytest.approx(118, abs=2 * 0.5e-5 / 0.011)


def test_columns_that_contradict_each_other_are_refused(tmp_path):
    file = tmp_path / "lift.csv"
    write_lift_table(file, POLYDYNE)
    rows = file.read_text().splitlines()
    cells = rows[1500].split(",")
    rows[1500] = ",".join([cells[0], str(float(cells[1]) + 0.01), *cells[2:]])
    file.write_text("\n".join(rows))
    with pytest.raises(InputError, match=r"line 1501.*velocity_mm_per_deg") as error:
        read_cam(file, KODAMA)
    assert "\n" not in str(error.value)


def test_angles_are_short_decimals_where_the_step_is_one(tmp_path):
    for step in (0.1, 0.05, 0.2, 1.0):
        write_lift_table(tmp_path / "lift.csv", POLYDYNE, step)
        angles = [row.split(",")[0] for row in (tmp_path / "lift.csv").read_text().splitlines()[1:]]
        assert max(len(angle) for angle in angles) <= len("-179.95")
        assert [float(a) for a in angles] == [round(-180 + i * step, 6) for i in range(len(angles))]
    write_lift_table(tmp_path / "lift.csv", POLYDYNE, 360 / 1080)
    angles = np.loadtxt(tmp_path / "lift.csv", delimiter=",", skiprows=1)[:, 0]
    np.testing.assert_allclose(angles, np.linspace(-180, 180, 1081), atol=1e-13)  # every digit of a third


def test_records_of_a_cam_print_in_a_line(tmp_path):
    said = repr(POLYDYNE)
    assert len(said) < 200 and "\n" not in said
    assert all(part in said for part in ("polydyne", "144 deg", "9.4 mm"))
    assert "<table" in POLYDYNE._repr_html_()
    for record in (contact(POLYDYNE, WIDE), HertzStress(THETA, THETA, THETA), scene_ramps(KODAMA.design)[0]):
        assert len(repr(record)) < 500 and "array" not in repr(record)
    assert "0.265 mm" in repr(scene_ramps(KODAMA.design)[0])
