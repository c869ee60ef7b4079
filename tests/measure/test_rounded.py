"""The shape of a cam from a rounded table: confirmed where its design is, broken where no rounding explains it."""

import numpy as np
import pytest

from camopt.cam.design_file import as_written
from camopt.cam.exports import write_crank_table, write_rounded_table
from camopt.cam.families.free import free_cam
from camopt.cam.tables.lift_table import read_lift_table, write_lift_table
from camopt.measure.limits import broken_by_shape
from camopt.measure.rounded import rounding_sentence, rows_of
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.units import MM, MM_PER_DEG3

KODAMA = load_scene("kodama")
FLAT = Geometry(follower="flat", base_radius_mm=24.0)
DESIGN = KODAMA.design.model_copy(update={"snap_max_mm_per_deg4": 0.001, "nose_radius_min_mm": 5.0, "waves_max": 5})
DESIGN = DESIGN.within(FLAT, KODAMA.operation)
SCENE = KODAMA.model_copy(update={"geometry": FLAT, "design": DESIGN})


@pytest.fixture(scope="module")
def lift():
    cam = as_written(kinematic_optimum(DESIGN, free_cam(DESIGN, 3.0)).lift)
    assert broken_by_shape(cam, DESIGN) == []
    return cam


@pytest.fixture(scope="module")
def five_digits(lift, tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "lift.csv"
    write_rounded_table(path, lift, 0.1, 5)
    return read_lift_table(path, SCENE)


@pytest.fixture(params=[3, 5, "all", "crank"])
def table(request, lift, tmp_path):
    path = tmp_path / "lift.csv"
    if request.param == "all":
        write_lift_table(path, lift)
    elif request.param == "crank":
        write_crank_table(path, lift, 0.5, 5, 0.5)
    else:
        write_rounded_table(path, lift, 0.1, request.param)
    return read_lift_table(path, SCENE)


def test_a_table_of_any_number_of_digits_is_confirmed_where_its_design_is(table):
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


def test_what_is_said_of_the_jerk_is_a_bound_on_its_means(lift, five_digits):
    rows = rows_of(five_digits)
    for begin, mean, error in rows.means(3):
        width = error and (8 * rows.error / error) ** (1 / 3)
        true = sum((-1) ** (3 - j) * [1, 3, 3, 1][j] * lift(begin + j * width) for j in range(4)) / width**3
        assert np.abs(mean - true)[begin + 3 * width < np.pi].max() <= error
    assert rows.error == pytest.approx(5e-6 * MM, rel=1e-4)
    assert rows.resolution(3) == pytest.approx(8 * rows.error / MM / 1.6**3 * MM_PER_DEG3)
