"""The whole way of a spring by its measured load: table, place of the closed valve, tolerance, free number, slider."""

from dataclasses import replace

import numpy as np
import pytest

import camopt.smooth  # noqa: F401 - double precision
from camopt.designer.controls import controls
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.ascent.variables import TrainVariables
from camopt.optimizer.free_numbers import free_number, free_numbers, with_values
from camopt.scene import InputError, build_train, parse_scene, rest_position
from camopt.scene.as_built import deviates, scene_as_built
from camopt.scene.load import scene_with
from camopt.scene.notes import scene_notes
from camopt.scene.parameters import number_of, valve_spring, with_number, with_spring
from camopt.scene.rest import static_forces
from camopt.study.fronts import joint_spring
from camopt.study.identify.lift_fit import FreeParameters
from tests.scene.test_load import assert_one_fault, changed

ROWS = [[0.0, 210], [1, 244], [2, 279], [4, 350], [6, 423], [8, 499], [10.2, 585]]
FREE = [[0.0, 0.0], *([at + 11.5, force] for at, force in ROWS)]
TEXT = """
format = 1
name = "measured"
valve = "valve"
seat = "seat"

[operation]
speeds_rpm = [6000, 9000]
band_rpm = [6000, 9000]

[design]
duration_deg = 148
max_lift_mm = 9.95
ramp_height_mm = 0.2
ramp_velocity_mm_per_deg = 0.012
acceleration_max_mm_per_deg2 = 0.025
acceleration_min_mm_per_deg2 = -0.006
jerk_max_mm_per_deg3 = 0.005

[[mass]]
name = "valve"
mass_kg = 0.062

[[element]]
name = "cam"
kind = "contact"
between = ["ground", "valve"]
cam_driven = true
stiffness_N_per_m = 3.0e7
damping_N_s_per_m = 270.0
gap_mm = 0.15

[[element]]
name = "spring"
kind = "spring"
between = ["valve", "ground"]
law = "table"
force_table = ROWS
damping_N_s_per_m = 2.0

[[element]]
name = "seat"
kind = "contact"
between = ["ground", "valve"]
stiffness_N_per_m = 1.0e8
damping_N_s_per_m = 500.0
preload_N = 210.0
"""


def text(rows=ROWS, more: str = "", tolerance: str = "") -> str:
    """The scene with a spring of these rows, further keys of it, and a tolerance."""
    return TEXT.replace("ROWS", f"{rows}\n{more}") + (tolerance and f"\n[[tolerance]]\n{tolerance}\n")


def measured(*parts, **more):
    return parse_scene(text(*parts, **more), "measured")


INSTALLED = "installed_mm = 11.5"
FROM_FREE = measured(FREE, INSTALLED)


def spring_force(scene, compression_mm: np.ndarray) -> np.ndarray:
    train = build_train(scene)
    return train.laws.along(1, compression_mm * 1e-3, 0.0)[0]


def test_a_table_from_the_free_length_is_the_one_from_the_closed_valve():
    at = np.linspace(0.0, 10.2, 52)
    assert spring_force(FROM_FREE, at) == pytest.approx(spring_force(measured(), at), abs=1e-9)
    train = build_train(FROM_FREE)
    assert static_forces(train, np.zeros(1))[0, train.seat] == pytest.approx(210.0, rel=1e-3)  # the seat gives way
    assert rest_position(train) == pytest.approx(rest_position(build_train(measured())), abs=1e-12)


def test_a_table_from_the_free_length_that_does_not_say_so_is_noted_with_the_remedy():
    (said,) = scene_notes(measured(FREE))
    assert "counts compression from the closed valve" in said and "with installed_mm = 11.5 it is the 210 N" in said
    assert scene_notes(FROM_FREE) == () == scene_notes(measured())


def test_compression_in_metres_is_noticed():
    said = scene_notes(measured([[at / 1e3, force] for at, force in ROWS]))
    assert any("it looks like a number in m, which would be 10.2 here" in one for one in said)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (text(FREE, "installed_mm = 25"), "must lie in force_table, from 0 to 21.7 mm"),
        (text(FREE, "installed_mm = -1"), "greater than or equal to 0"),
        (text(FREE, "preload_N = 20"), "its force is all in its law"),
        (changed(text(), "gap_mm = 0.15", "installed_mm = 0.15"), 'belongs to law = "table"'),
    ],
    ids=["beyond", "negative", "preload", "linear"],
)
def test_faults_are_one_sentence(more, says):
    assert_one_fault(more, "element.", says)


@pytest.mark.parametrize("scene", [measured(), FROM_FREE], ids=["closed", "free"])
def test_rate_and_preload_are_those_with_the_valve_closed(scene):
    spring = scene.element[1]
    assert number_of(spring, "preload_N") == pytest.approx(210.0)
    assert number_of(spring, "stiffness_N_per_m") == pytest.approx(34_000.0)
    changed = with_number(with_number(spring, "stiffness_N_per_m", 37_400.0), "preload_N", 190.0)
    assert number_of(changed, "preload_N") == pytest.approx(190.0)
    assert number_of(changed, "stiffness_N_per_m") == pytest.approx(37_400.0)
    at = np.linspace(0.0, 10.2, 9)
    stiffer = spring_force(scene.model_copy(update={"element": (scene.element[0], changed, scene.element[2])}), at)
    assert stiffer - 190.0 == pytest.approx(1.1 * (spring_force(scene, at) - 210.0))


def test_its_loads_scatter_by_a_share():
    """Rate and preload in one array: every load of the table moves by the same share."""
    loads = 'name = "loads"\nof = ["spring.preload_N", "spring.stiffness_N_per_m"]\nrelative = 0.03'
    scene = measured(FREE, INSTALLED, loads)
    draws = deviates(scene, 0, 3)
    built = scene_as_built(scene, draws)
    share = 1 + 0.03 * draws["loads"][0]
    at = np.linspace(0.0, 10.2, 9)
    assert abs(share - 1) > 1e-3
    assert spring_force(built, at) == pytest.approx(share * spring_force(scene, at), rel=1e-12)


def test_its_place_scatters_in_millimetres():
    scene = measured(FREE, INSTALLED, 'of = "spring.installed_mm"\nplus_minus = 0.2')
    draws = deviates(scene, 0, 3)
    moved = 0.2 * draws["spring.installed_mm"][0]
    built, at = scene_as_built(scene, draws), np.linspace(1.0, 9.0, 9)
    assert spring_force(built, at) == pytest.approx(spring_force(scene, at + moved), rel=1e-12)


def test_it_is_free_by_preload_rate_or_place():
    for name, value, force in (
        ("spring.preload_N", 230.0, 230.0),
        ("spring.installed_mm", 12.5, 244.0),
        ("spring.stiffness_N_per_m", 40_000.0, 210.0),
    ):
        free = free_numbers(FROM_FREE, {name: (0.9 * value, 1.1 * value)})
        changed = with_values(FROM_FREE, free, [value])
        assert number_of(changed.element[1], "preload_N") == pytest.approx(force)
    with pytest.raises(InputError, match=r"free 'cam\.leak_N_s_per_m': the scene measured does not state"):
        free_number(FROM_FREE, "cam.leak_N_s_per_m", 1.0, 2.0)


def test_it_scatters_with_all_others_that_have_the_key():
    scene = measured(tolerance='of = "*.preload_N"\nrelative = 0.03')
    assert len(deviates(scene, 0, 3)["*.preload_N"]) == 2  # its own and the seat's


def test_its_rate_and_preload_are_factors_of_an_objective():
    """The arrays of the train that an ascent differentiates are those of the scene with the factors on it."""
    variables = TrainVariables(FROM_FREE, {"spring.stiffness_N_per_m": (0.5, 2.0), "*.preload_N": (0.5, 2.0)})
    factors = np.array([1.2, 0.9])
    applied = variables.applied(variables.arrays(FROM_FREE), factors)
    for name, array in build_train(variables.scene_with(factors)).parameters.items():
        np.testing.assert_allclose(applied[name], array, rtol=1e-12)
    with pytest.raises(InputError, match=r"spring\.preload_N has two factors"):
        TrainVariables(FROM_FREE, {"spring.preload_N": (0.5, 2.0), "*.preload_N": (0.5, 2.0)})


def test_its_rate_and_preload_are_fitted():
    free = FreeParameters(FROM_FREE, ["spring.stiffness_N_per_m", "spring.preload_N"])
    spring = free.moved_scene(np.log([1.2, 0.9])).element[1]
    assert number_of(spring, "stiffness_N_per_m") == pytest.approx(1.2 * 34_000.0)
    assert number_of(spring, "preload_N") == pytest.approx(0.9 * 210.0)


def test_another_number_of_it_is_set():
    changed = scene_with(FROM_FREE, {"spring.preload_N": 230.0, "design.max_lift_mm": 9.0}).element[1]
    assert number_of(changed, "preload_N") == pytest.approx(230.0)


def test_it_is_a_valve_spring_with_sliders():
    assert valve_spring(FROM_FREE) == ["spring"]
    changed = with_spring(FROM_FREE, 1.1, 1.2)
    assert number_of(changed.element[1], "preload_N") == pytest.approx(252.0) == changed.element[2].preload_N
    assert {"spring_rate_percent", "spring_preload_percent"} <= {one.key for one in controls(FROM_FREE)}


def test_joint_spring_changes_it(monkeypatch):
    """More preload keeps the contacts closed at the top speed, so that the program takes all it may have."""
    monkeypatch.setitem(ACCURACIES, "draft", replace(ACCURACIES["draft"], knot_deg=6.0, program_speeds=3))
    found = joint_spring(FROM_FREE, rate=(1.0, 1.2), preload=(1.0, 1.2), margin_N=150.0, evaluations=3)
    assert found.area_ratio > found.area_ratio_as_given
    changed = found.scene.element[1]
    assert number_of(changed, "preload_N") == pytest.approx(210.0 * found.preload)
    assert number_of(changed, "stiffness_N_per_m") == pytest.approx(34_000.0 * found.rate)
    assert found.preload > 1.0
