"""The law by means of a rounded table: its figures are those of the cam, not of the rounding."""

import re

import numpy as np
import pytest

from camopt.cam.design_file import as_written
from camopt.cam.exports import write_rounded_table
from camopt.cam.families.free import free_cam
from camopt.cam.families.polydyne import polydyne
from camopt.cam.geometry import contact
from camopt.cam.tables.lift_table import read_lift_table, write_lift_table
from camopt.cli.parser import parser
from camopt.measure.rounded import MEANS, moving_average
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import load_scene
from camopt.scene.geometry import Geometry
from camopt.study.cam_exports import export
from camopt.study.cam_sheet import sheet

FLAT = Geometry(follower="flat", base_radius_mm=24.0)
KODAMA = load_scene("kodama")
SCENE = KODAMA.model_copy(update={"geometry": FLAT})


@pytest.fixture(scope="module")
def cam():
    return as_written(kinematic_optimum(KODAMA.design, free_cam(KODAMA.design, 3.0)).lift)


@pytest.fixture
def five_digits(cam, tmp_path):
    write_rounded_table(tmp_path / "lift.csv", cam, 0.1, 5)
    return read_lift_table(tmp_path / "lift.csv", SCENE)


def test_means_tell_the_extremes_of_the_cam_where_the_rows_law_shows_rounding(cam, five_digits):
    law, said = moving_average(five_digits)
    for order, near in ((2, 0.01), (3, 0.08)):
        assert law.extremes(order) == pytest.approx(cam.extremes(order), rel=near)
    assert np.abs(five_digits.extremes(3)).max() > 10 * np.abs(cam.extremes(3)).max()
    assert said.startswith("The table's rows are off by up to 5e-06 mm: ")
    true, found = contact(cam, FLAT), contact(law, FLAT)
    assert found.smallest_convex == pytest.approx(true.smallest_convex, rel=0.02)
    assert found.face_width == pytest.approx(true.face_width, rel=0.01)


def test_the_lift_of_the_means_is_as_near_as_the_module_says(cam, five_digits):
    law, _ = moving_average(five_digits)
    assert MEANS == 4  # windows, of a variance of H^2 / 12 each
    at = np.linspace(-np.pi, np.pi, 3601)
    widest = np.radians(2.0)
    assert np.abs(law(at) - cam(at)).max() < widest**2 / 6 * np.abs(cam.extremes(2)).max()


def test_a_table_with_every_digit_and_a_designed_cam_are_taken_as_they_are(cam, tmp_path):
    write_lift_table(tmp_path / "lift.csv", cam)
    table = read_lift_table(tmp_path / "lift.csv", SCENE)
    assert moving_average(table) == (table, "")
    assert moving_average(cam) == (cam, "")


def test_the_sheet_and_the_contour_of_a_rounded_table_show_no_cusp(five_digits, tmp_path):
    lines = sheet(SCENE, five_digits)
    assert not [line for line in lines if "fault" in line]
    assert [line for line in lines if "by means over" in line]
    assert [line for line in lines if line.split() == ["smallest", "concave", "radius", "none"]]
    words = ["cam", "motori-1", "--cam", "polydyne", "--contour", str(tmp_path / "contour.csv")]
    export(SCENE, five_digits, parser().parse_args(words))
    assert (tmp_path / "contour.csv").is_file()


def test_what_is_said_is_told_by_the_errors_of_differences_over_the_window(tmp_path):
    """A row that is off by q shows in the k-th difference over H as 2^k q / H^k."""
    write_rounded_table(tmp_path / "lift.csv", polydyne(KODAMA), 0.1, 5)
    _, said = moving_average(read_lift_table(tmp_path / "lift.csv", SCENE))
    numbers = re.search(r"over (\S+) deg.* to (\S+) mm/deg\^2 .* to (\S+) mm/deg\^3$", said)
    assert numbers is not None
    span, acceleration, jerk = map(float, numbers.groups())
    rows = span / MEANS / 0.1
    assert rows == pytest.approx(round(rows)) and round(rows) % 2 == 1
    assert acceleration == pytest.approx(4 * 5e-6 / (0.1 * rows) ** 2, rel=0.5)  # one digit is told
    assert jerk == pytest.approx(8 * 5e-6 / (0.1 * rows) ** 3, rel=0.5)
