"""Lift tables: camopt's own come back unsmoothed, as the same cam, and tables from elsewhere only with their units
named; every record shows itself."""

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

# A quintic spline at 0.1 deg, whose only blemish is the jerk's step at the ramp tops (measured 7e-9 mm)
OWN_TABLE = 2e-8 * MM


@pytest.fixture
def file(tmp_path):
    """camopt's own table of the polydyne."""
    write_lift_table(tmp_path / "lift.csv", POLYDYNE)
    return tmp_path / "lift.csv"


class TestOwnTable:
    def test_round_trip(self, file):
        header, first = file.read_text().splitlines()[:2]
        assert header == "cam_angle_deg,lift_mm,velocity_mm_per_deg,acceleration_mm_per_deg2,jerk_mm_per_deg3"
        assert first == "-180.0,0.0,0.0,0.0,0.0"
        back = read_cam(str(file), KODAMA)
        assert difference(back, POLYDYNE) < OWN_TABLE
        assert difference(back, POLYDYNE, 1) < 1e-6 * MM / DEG
        assert back.half_duration == POLYDYNE.half_duration
        assert back.area == pytest.approx(POLYDYNE.area, rel=1e-11)

    def test_passes_through_every_sample(self, tmp_path):
        file = tmp_path / "lift.csv"
        write_lift_table(file, POLYDYNE, step_deg=1.0)
        grid = np.arange(-180, 181) * DEG
        np.testing.assert_allclose(read_cam(str(file), KODAMA)(grid), POLYDYNE(grid), atol=1e-12 * MM)

    def test_base_circle_is_exactly_zero_and_joined_smoothly(self, file):
        lift = read_cam(str(file), KODAMA)
        assert lift.opening_foot == pytest.approx(POLYDYNE.opening_foot, abs=0.1 * DEG)
        assert lift.opening_foot <= POLYDYNE.opening_foot
        outside = np.concatenate([np.linspace(-np.pi, lift.opening_foot, 50), np.linspace(102 * DEG, np.pi, 50)])
        assert np.all(lift(outside) == 0)
        assert np.abs(lift(lift.opening_foot + 1e-9, 2)) < 1e-6 * np.abs(lift.extremes(2)).max()

    def test_shifted_angles_are_refused(self, file):
        file.write_text("\n".join(file.read_text().splitlines()[:-5]))
        with pytest.raises(InputError, match="must run from -180 to 180"):
            read_cam(str(file), KODAMA)

    def test_units_against_its_own_names_are_refused(self, file):
        with pytest.raises(InputError, match="against the units"):
            read_cam(str(file), KODAMA, table_angle="crank", table_lift="mm")
        assert difference(read_cam(str(file), KODAMA, "cam", "mm"), POLYDYNE) < OWN_TABLE

    @pytest.mark.parametrize("step", [0.7, -1.0, float("nan")])
    def test_steps_that_do_not_divide_the_turn(self, tmp_path, step):
        with pytest.raises(InputError, match="divides 360"):
            write_lift_table(tmp_path / "lift.csv", POLYDYNE, step)


TURN = np.arange(-180, 180.1, 0.5)


def foreign(folder, degrees, lift, delimiter=",", header="", name="cam.dat"):
    file = folder / name
    rows = [f"{a:.10f}{delimiter}{h:.15e}" for a, h in zip(degrees, lift, strict=True)]
    file.write_text("\n".join([*filter(None, [header]), *rows]) + "\n")
    return file


class TestForeignTable:
    @pytest.mark.parametrize("nose_deg", [-33.3, 0.0, 100.25, 180.0, 300.0])
    @pytest.mark.parametrize(("kind", "per_cam"), [("cam", 1), ("crank", 2)])
    def test_nose_goes_to_zero_wherever_the_table_has_it(self, tmp_path, nose_deg, kind, per_cam):
        degrees = np.arange(0, 360.1, 0.25)
        file = foreign(tmp_path, per_cam * degrees, POLYDYNE((degrees - nose_deg) * DEG) / MM)
        lift = read_lift_table(file, KODAMA, kind, "mm")
        # the step is 2.5 times that of camopt's own tables; the error at the jerk's step grows with its cube
        assert difference(lift, POLYDYNE) < 20 * OWN_TABLE
        # that error in lift, at the ramp's slope of 0.011 mm/deg
        assert lift.half_duration / DEG == pytest.approx(72, abs=20 * OWN_TABLE / MM / 0.011)

    @pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("m", 1.0), ("inch", 0.0254)])
    def test_units_of_lift(self, tmp_path, unit, metres):
        file = foreign(tmp_path, TURN, POLYDYNE(TURN * DEG) / metres)
        assert read_lift_table(file, KODAMA, "cam", unit).max_lift == pytest.approx(9.4 * MM, abs=1e-6 * MM)

    @pytest.mark.parametrize("delimiter", [",", ", ", ";", "\t", "  ", " ; "])
    @pytest.mark.parametrize("header", ["", "angle{}lift", "# from a machine"])
    def test_delimiters_and_headers(self, tmp_path, delimiter, header):
        file = foreign(tmp_path, TURN, POLYDYNE(TURN * DEG) / MM, delimiter, header.format(delimiter))
        assert difference(read_lift_table(file, KODAMA, "cam", "mm"), POLYDYNE) < 1e-5 * MM

    @pytest.mark.parametrize("delimiter", [";", "\t"])
    def test_decimal_commas(self, tmp_path, delimiter):
        file = foreign(tmp_path, TURN, POLYDYNE(TURN * DEG) / MM, delimiter)
        file.write_text(file.read_text().replace(".", ","))
        assert difference(read_lift_table(file, KODAMA, "cam", "mm"), POLYDYNE) < 1e-5 * MM

    def test_event_alone_is_completed_by_the_base_circle(self, tmp_path):
        degrees = np.arange(-102, 102.1, 0.25)
        file = foreign(tmp_path, degrees + 500, POLYDYNE(degrees * DEG) / MM)
        lift = read_lift_table(file, KODAMA, "cam", "mm")
        assert difference(lift, POLYDYNE) < 20 * OWN_TABLE
        assert lift(2.5) == lift(-2.5) == 0

    def test_turn_without_base_circle_is_interpolated_periodically(self, tmp_path):
        degrees = np.arange(0, 360, 2.0)
        file = foreign(tmp_path, degrees, 4 * (1 - np.cos((degrees - 77) * DEG)) + 0.1)
        lift = read_lift_table(file, with_design(duration_deg=300), "cam", "mm")
        # interpolation of a sine by a quintic spline: a few times (2 deg)^6 / 720 of 4 mm
        np.testing.assert_allclose(lift(THETA) / MM, 4 * (1 + np.cos(THETA)) + 0.1, atol=1e-9)
        half = np.pi - np.arccos(1 - (0.265 - 0.1) / 4)
        assert lift.half_duration == pytest.approx(half, abs=1e-8)

    def test_keys_in_the_header_stand_for_the_options(self, tmp_path):
        header = "# table-angle = cam\n# table_lift: inch"
        file = foreign(tmp_path, TURN, POLYDYNE(TURN * DEG) / 0.0254, header=header)
        assert read_cam(str(file), KODAMA).max_lift == pytest.approx(9.4 * MM, abs=1e-6 * MM)

    @pytest.mark.parametrize("options", [{}, {"table_angle": "cam"}, {"table_lift": "mm"}])
    def test_unnamed_units_are_refused(self, tmp_path, options):
        file = foreign(tmp_path, TURN, POLYDYNE(TURN * DEG) / MM)
        with pytest.raises(InputError, match=r"--table-angle cam\|crank --table-lift mm\|m\|inch") as error:
            read_cam(str(file), KODAMA, **options)
        assert "\n" not in str(error.value)

    @pytest.mark.parametrize(
        ("change", "says"),
        [
            (lambda rows: rows[::40], "19 rows, and at least 20"),
            (lambda rows: [*rows[:30], rows[29], *rows[30:]], "line 31: the angle is repeated"),
            (lambda rows: [*rows[:30], rows[31], rows[30], *rows[32:]], "line 32: the angle decreases"),
            (lambda rows: [*rows[:30], "7,high", *rows[31:]], "line 31: expected finite numbers, found '7,high'"),
            (lambda rows: [*rows[:30], "7,nan", *rows[31:]], "line 31: expected finite numbers"),
            (lambda rows: [*rows[:30], "7", *rows[31:]], "line 31: 1 columns"),
            (lambda rows: [rows[0], "c,d", *rows[1:]], "line 2: expected finite numbers"),
            (lambda rows: [], "holds no numbers"),
            (lambda rows: rows[200:], "begin and end on the base circle"),
            (lambda rows: [*rows[:-1], "180,5"], "the two must be equal"),
            (lambda rows: [*rows, "300,0"], "more than one turn"),
            (lambda rows: [r.split(",")[0] + ",0" for r in rows], "check --table-lift"),
            (lambda rows: [r + "e3" if "e" not in r else r.replace("e", "e+1") for r in rows], "check --table-lift"),
            (lambda rows: [r if i in (360, 361) else r.split(",")[0] + ",0" for i, r in enumerate(rows)], "too coarse"),
        ],
    )
    def test_faults(self, tmp_path, change, says):
        rows = [f"{a},{h:.9f}" for a, h in zip(TURN, POLYDYNE(TURN * DEG) / MM, strict=True)]
        file = tmp_path / "cam.csv"
        file.write_text("\n".join(change(rows)))
        with pytest.raises(InputError, match=says) as error:
            read_cam(str(file), KODAMA, "cam", "mm")
        assert "\n" not in str(error.value)

    def test_lift_below_the_ramp_height_has_no_duration(self, tmp_path):
        file = foreign(tmp_path, TURN, 0.99 * POLYDYNE(TURN * DEG) / MM)
        with pytest.raises(InputError, match="never passes"):
            read_lift_table(file, with_design(ramp_height_mm=9.39), "cam", "mm")

    def test_binary_and_missing_files(self, tmp_path):
        file = tmp_path / "cam.dat"
        file.write_bytes(b"\xff\xfe\x00\x01")
        with pytest.raises(InputError, match="UTF-8"):
            read_cam(str(file), KODAMA, "cam", "mm")
        with pytest.raises(InputError, match="there is no such file"):
            read_cam(str(tmp_path / "none.csv"), KODAMA)


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
