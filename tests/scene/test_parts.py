"""Adjusters, friction, force tables and gas forces in a scene: what is refused, what the train holds, and its rest."""

from pathlib import Path

import numpy as np
import pytest

from camopt.scene import build_train, load_scene, parse_scene, state_at_rest
from camopt.scene.laws import FRICTION, LINEAR, OIL, TABLE
from camopt.scene.rest import static_forces
from tests.scene.test_load import assert_one_fault, changed

TEXT = (Path(__file__).parent / "real.toml").read_text()
STIFFNESS = "stiffness_N_per_m = 4.0e7"
PLUNGER = "preload_N = 40.0"
STIFFNESS_OF_OIL = "stiffness_N_per_m = 2.0e7"


@pytest.fixture(scope="module")
def train():
    return build_train(parse_scene(TEXT, "real.toml"))


@pytest.mark.parametrize(
    ("old", "new", "where", "says"),
    [
        ("stroke_mm = 3.0", "", "element.2.stroke_mm", "missing"),
        ("leak_N_s_per_m = 2.0e6", "", "element.2.leak_N_s_per_m", "missing"),
        (PLUNGER, "preload_N = 3.0", "element.2.preload_N", "more than spring_N_per_m times half of stroke_mm"),
        (PLUNGER, PLUNGER + "\ndamping_N_s_per_m = 1.0", "element.2.damping_N_s_per_m", 'does not apply to kind'),
        (PLUNGER, PLUNGER + '\nlaw = "hertz"', "element.2.law", "a law of its own"),
        (PLUNGER, PLUNGER + "\ncam_driven = true", "element.2.cam_driven", "the cam drives a contact"),
        (STIFFNESS, STIFFNESS + "\nslip_N = 3.0", "element.1.slip_N", 'belongs to kind = "friction"'),
        ("slip_N = 15.0", "", "element.4.slip_N", "missing"),
        ("slip_N = 15.0", "slip_N = 300.0", "element", "could hold the valve off its seat"),
        ("[5.0, 420.0]", "[-5.0, 420.0]", "element.3.force_table", "compressions of its rows must ascend"),
        ("[5.0, 420.0]", "[5.0, 42.0]", "element.3.force_table", "forces of its rows must ascend"),
        ("[10.0, 640.0]", "[10000.0, 640.0]", "element.3.force_table", "must be 1e-06 to 500 mm apart"),
        ("[5.0, 420.0]", "[5e-324, 420.0]", "element.3.force_table", "must be 1e-06 to 500 mm apart"),
        ("[5.0, 420.0]", "[0.0000000001, 420.0]", "element.3.force_table", "must be 1e-06 to 500 mm apart"),
        ("[-1.0, 230.0], [0.0, 250.0]", "[-1.0, 0.0], [0.0, 1e-300]", "element.3.force_table", "at least 1e-12 N/m"),
        (STIFFNESS_OF_OIL, "stiffness_N_per_m = 2e-5", "element.2.spring_N_per_m", "oil is stiffer than a spring"),
        (PLUNGER, "preload_N = 1e14", "element.2.preload_N", "presses the oil in by more than 500 mm"),
        ('law = "table"\n', 'law = "table"\npreload_N = 3.0\n', "element.3.preload_N", "its force is all in its law"),
        ("[180.0, 0.0]", "[180.0, 9.0]", "force.1.table", "the same force"),
        ("[-70.0, 0.0]", "[70.0, 0.0]", "force.1.table", "cam angles of its rows must ascend"),
        ('on = "valve"', 'on = "vale"', "force.1.on", "no mass is named 'vale'"),
        ('on = "valve"', "", "force.1.on", "missing"),
    ],
)  # fmt: skip
def test_one_fault_is_one_sentence_with_its_key(old, new, where, says):
    assert_one_fault(changed(TEXT, old, new), f"{where}: ", says)


@pytest.mark.parametrize(
    ("row", "inside", "beyond"),
    [
        ("[5.0, 420.0]", "[1.01e-6, 420.0]", "[0.99e-6, 420.0]"),
        ("[10.0, 640.0]", "[504.9, 640.0]", "[505.1, 640.0]"),
    ],
)
def test_rows_just_within_the_bounds_are_read_and_just_beyond_are_not(row, inside, beyond):
    assert build_train(parse_scene(changed(TEXT, row, inside), "mine.toml")).laws is not None
    assert_one_fault(changed(TEXT, row, beyond), "element.3.force_table: ", "must be 1e-06 to 500 mm apart")


def test_an_adjuster_is_plunger_and_oil(train):
    assert train.element_names == ("cam", "lifter", "beehive", "guide", "seat", "lifter-oil")
    assert list(train.laws.kind) == [LINEAR, TABLE, TABLE, FRICTION, LINEAR, OIL]
    assert train.memory == (3, 5) and train.state_size == 2 * 2 + 2
    assert train.cam_side == (0,), "the plunger follows what it pushes, so that its own gap is no jump"


def test_the_plunger_pushes_between_its_stops(train):
    at = lambda d_mm: float(train.laws.force(np.full(6, d_mm * 1e-3), train.preload)[1])  # noqa: E731
    np.testing.assert_allclose([at(-1.5), at(0.0), at(1.5)], [37.0, 40.0, 43.0])
    assert at(1.6) == pytest.approx(43.0 + 2.0e7 * 1e-4) and at(-1.5019) < 0.0


def test_a_table_spring_follows_its_rows_and_goes_on(train):
    at = lambda d_mm: float(train.laws.force(np.full(6, d_mm * 1e-3), train.preload)[2])  # noqa: E731
    np.testing.assert_allclose([at(d) for d in (-2.0, 0.0, 2.5, 10.0, 12.0)], [210.0, 250.0, 335.0, 640.0, 728.0])
    assert train.preload[2] == 250.0 and train.stiffness[2] == pytest.approx(34_000.0)


def test_at_rest_the_plunger_alone_carries_and_nothing_rubs(train):
    state = state_at_rest(train)
    forces = static_forces(train, np.zeros(1))[0]
    assert len(state) == train.state_size
    np.testing.assert_allclose(state[4:], train.compression(state[:2], 0.0)[[3, 5]])
    np.testing.assert_allclose(forces[[0, 1, 3, 5]], [40.0, 40.0, 0.0, 0.0], atol=0.01)
    assert forces[2] - forces[4] == pytest.approx(40.0, abs=0.1), "spring less seat is what the plunger lifts with"


def test_a_gas_force_repeats(train):
    (gas,) = train.forcing
    angle = np.radians([-65.0, -50.0, 295.0, 670.0])
    np.testing.assert_allclose(gas.at(angle), [-60.0, -90.0, -60.0, -90.0])


@pytest.mark.parametrize("name", ["kodama", "motori-1", "pushrod-5mass"])
def test_a_linear_scene_has_no_laws(name):
    train = build_train(load_scene(name))
    assert train.laws is None and not train.forcing and not train.memory
