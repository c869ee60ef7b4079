"""Cams from rounded tables: confirmed where their design is, broken where no rounding explains it, and their means."""

import re

import numpy as np
import pytest

from camopt.cam.design_file import as_written
from camopt.cam.exports import write_crank_table, write_rounded_table
from camopt.cam.families.free import free_cam
from camopt.cam.families.polydyne import polydyne
from camopt.cam.geometry import contact
from camopt.cam.tables.lift_table import read_lift_table, write_lift_table
from camopt.cli.parser import parser
from camopt.measure.limits import broken_by_shape
from camopt.measure.rounded import (
    MEANS,
    RAMP_VELOCITY,
    RoundedRows,
    moving_average,
    rounding_sentence,
    rows_of,
    violated_beyond_rounding,
)
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG3
from camopt.study.cam_exports import export
from camopt.study.cam_sheet import sheet

KODAMA = load_scene("kodama")
FLAT = Geometry(follower="flat", base_radius_mm=24.0)
DESIGN = KODAMA.design.model_copy(update={"snap_max_mm_per_deg4": 0.001, "nose_radius_min_mm": 5.0, "waves_max": 5})
DESIGN = DESIGN.within(FLAT, KODAMA.operation)
SCENE = KODAMA.model_copy(update={"geometry": FLAT, "design": DESIGN})


@pytest.fixture(scope="module")
def cam():
    cam = as_written(kinematic_optimum(DESIGN, free_cam(DESIGN, 3.0)).lift)
    assert broken_by_shape(cam, DESIGN) == []
    return cam


def read_back(folder, write, *how):
    """The cam of the table that `write` makes in a folder."""
    write(folder / "lift.csv", *how)
    return read_lift_table(folder / "lift.csv", SCENE)


@pytest.fixture(scope="module")
def five_digits(cam, tmp_path_factory):
    return read_back(tmp_path_factory.mktemp("table"), write_rounded_table, cam, 0.1, 5)


@pytest.mark.parametrize(
    ("write", "how"),
    [
        (write_rounded_table, (0.1, 3)),
        (write_rounded_table, (0.1, 5)),
        (write_lift_table, ()),
        (write_crank_table, (0.5, 5, 0.5)),
    ],
)
def test_a_table_of_any_number_of_digits_is_confirmed_where_its_design_is(cam, tmp_path, write, how):
    table = read_back(tmp_path, write, cam, *how)
    assert broken_by_shape(table, DESIGN) == []
    assert rounding_sentence(table).startswith("The table's rows are off by up to ")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("jerk_max_mm_per_deg3", 0.0025),
        ("acceleration_max_mm_per_deg2", 0.01485),
        ("acceleration_min_mm_per_deg2", -0.00792),
        ("snap_max_mm_per_deg4", 0.0005),
        ("max_lift_mm", 9.3),
        ("nose_radius_min_mm", 5.2),
        ("waves_max", 3),
        ("nose_deg", 60.0),
    ],
)
def test_a_table_with_five_digits_breaks_a_limit_that_its_cam_breaks_by_a_little(five_digits, key, value):
    assert broken_by_shape(five_digits, DESIGN.model_copy(update={key: value})) == [key]


def test_what_is_said_of_the_jerk_is_a_bound_on_its_means(cam, five_digits):
    rows = rows_of(five_digits)
    for span, mean, error in rows.means(3):
        width = span / 3
        true = sum((-1) ** (3 - j) * [1, 3, 3, 1][j] * cam(rows.theta + j * width) for j in range(4)) / width**3
        assert np.abs(mean - true)[rows.theta + span < np.pi].max() <= error == 8 * rows.error / width**3
    assert rows.error == pytest.approx(5e-6 * MM, rel=1e-4)
    assert rows.resolution(3) == pytest.approx(8 * rows.error / MM / 1.6**3 * MM_PER_DEG3)


class Law:
    """A lift as a function, with its largest value [m]."""

    def __init__(self, lift, max_lift=1.0):
        self.lift, self.max_lift = lift, max_lift

    def __call__(self, theta):
        return self.lift(theta)


def broken_beyond_rounding(key, lift, max_lift=1.0, error=1e-9, **limits):
    """Whether rows of a known law, off by an error, surely break a limit."""
    rows = RoundedRows(Law(lift, max_lift), error, 0.1 * DEG)
    return violated_beyond_rounding([key], rows, KODAMA.design.model_copy(update=limits)) == [key]


@pytest.mark.parametrize(("half_deg", "changes"), [(89.0, 0), (89.9, 0), (91.9, 2)])
def test_only_changes_of_sign_between_the_ends_count_as_waves(half_deg, changes):
    """The jerk of the sine changes its sign at -90 and at 90 degrees."""
    for most in (changes - 1, changes):
        broken = broken_beyond_rounding("waves_max", np.sin, duration_deg=2 * half_deg, waves_max=most)
        assert broken == (most < changes)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("limit", "broken"), [(1.5, True), (2.01, False)])
def test_the_jerk_is_limited_to_both_sides(sign, limit, broken):
    """cos x + cos 2x has a largest value of 2 and a least of -9/8."""
    key = "jerk_max_mm_per_deg3"
    limits = {key: limit / MM_PER_DEG3}
    assert broken_beyond_rounding(key, lambda x: sign * (np.sin(x) + np.sin(2 * x) / 8), **limits) == broken


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(("part", "broken"), [(0.5, False), (1.5, True)])
def test_a_ramp_may_be_faster_by_the_stated_share(part, broken, side):
    velocity = KODAMA.design.ramp_velocity_mm_per_deg * MM_PER_DEG * (1 + part * RAMP_VELOCITY)
    key = "ramp_velocity_mm_per_deg"
    assert broken_beyond_rounding(key, lambda x: velocity * (np.pi - np.abs(x)) * (side * x > 0)) == broken


@pytest.mark.parametrize(("roundings", "broken"), [(1.0, False), (3.0, True)])
def test_the_maximum_lift_is_missed_where_twice_the_rounding_does_not_reach_it(roundings, broken):
    error, key = 1e-3 * MM, "reach_max_lift"
    top = KODAMA.design.max_lift_mm * MM - roundings * error
    assert broken_beyond_rounding(key, lambda x: top * np.cos(x / 2) ** 2, top, error, reach_max_lift=True) == broken


@pytest.mark.parametrize(("roundings", "broken"), [(0.5, False), (1.5, True)])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_lift_at_an_angle_is_missed_where_the_rounding_does_not_reach_it(side, roundings, broken):
    error, lift = 1e-3 * MM, polydyne(KODAMA)
    level = float(lift(30.0 * DEG) - side * roundings * error) / MM
    row = (30.0, 0.0, level) if side > 0 else (30.0, level, KODAMA.design.max_lift_mm)
    design = KODAMA.design.model_copy(update={"lift_at": (row,)})
    found = RoundedRows(lift, error, 0.1 * DEG)
    assert violated_beyond_rounding(["lift_at"], found, design) == ["lift_at"] * broken


def test_means_tell_the_extremes_of_the_cam_where_the_rows_law_shows_rounding(cam, five_digits):
    law, said = moving_average(five_digits)
    for order, near in ((2, 0.01), (3, 0.08)):
        assert law.extremes(order) == pytest.approx(cam.extremes(order), rel=near)
    assert np.abs(five_digits.extremes(3)).max() > 10 * np.abs(cam.extremes(3)).max()
    assert said.startswith("The table's rows are off by up to 5e-06 mm: ")
    true, found = contact(cam, FLAT), contact(law, FLAT)
    assert found.smallest_convex == pytest.approx(true.smallest_convex, rel=0.02)
    assert found.face_width == pytest.approx(true.face_width, rel=0.01)
    assert MEANS == 4  # windows, of a variance of H^2 / 12 each
    at, widest = np.linspace(-np.pi, np.pi, 3601), np.radians(2.0)
    assert np.abs(law(at) - cam(at)).max() < widest**2 / 6 * np.abs(cam.extremes(2)).max()


def test_a_table_with_every_digit_and_a_designed_cam_are_taken_as_they_are(cam, tmp_path):
    table = read_back(tmp_path, write_lift_table, cam)
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
    _, said = moving_average(read_back(tmp_path, write_rounded_table, polydyne(KODAMA), 0.1, 5))
    numbers = re.search(r"over (\S+) deg.* to (\S+) mm/deg\^2 .* to (\S+) mm/deg\^3$", said)
    assert numbers is not None
    span, acceleration, jerk = map(float, numbers.groups())
    rows = span / MEANS / 0.1
    assert rows == pytest.approx(round(rows)) and round(rows) % 2 == 1
    assert acceleration == pytest.approx(4 * 5e-6 / (0.1 * rows) ** 2, rel=0.5)  # one digit is told
    assert jerk == pytest.approx(8 * 5e-6 / (0.1 * rows) ** 3, rel=0.5)
