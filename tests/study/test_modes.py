"""Modes against the printed digits of the literature and of the calibration, and against their own equations."""

import numpy as np
import pytest

from camopt.scene import InputError, build_train, load_scene
from camopt.scene.parameters import matching, with_numbers
from camopt.scene.vibration import assembled, highest_rate
from camopt.study.modes import mode_lines, modes

OHV = modes(load_scene("ohv-3dof"))
KODAMA, MOTOR = load_scene("kodama"), load_scene("motori-1")


def test_overhead_valve_train_of_the_literature():
    """Every digit of Tables 1 and 2 of the eigen analysis."""
    assert [f"{one:.6g}" for one in OHV.frequency_Hz] == ["2832.25", "15642.9", "72247.8"]
    assert [f"{one:.6g}" for one in OHV.angular] == ["17795.6", "98287.4", "453946"]
    shapes = [[0.6894, 0.6557, 0.3078], [-0.0217, 0.0745, 0.9970], [0.0104, -0.9997, 0.0232]]
    assert np.round(OHV.shape, 4).tolist() == shapes
    assert np.all(OHV.damping_ratio == 0)


CALIBRATED = {
    "lifted": (
        (352, 679, 961, 1177, 1313, 2351, 4212, 7767, 12839, 18427),
        (2.3, 4.4, 6.3, 7.7, 8.6, 2.3, 2.4, 3.9, 4.8, 3.8),
    ),
    "seated": (
        (352, 680, 961, 1177, 1313, 3353, 5527, 8602, 13081, 18622),
        (2.3, 4.4, 6.3, 7.7, 8.6, 3.6, 9.7, 10.9, 6.8, 6.1),
    ),
}


@pytest.mark.parametrize("state", CALIBRATED)
def test_kodama_against_the_calibration(state):
    """Printed in whole hertz and tenths of a percent; half a unit of the last digit is rounding."""
    frequency, percent = CALIBRATED[state]
    found = modes(KODAMA, state)
    np.testing.assert_allclose(found.frequency_Hz, frequency, atol=0.51)
    np.testing.assert_allclose(100 * found.damping_ratio, percent, atol=0.051)


def test_shapes_solve_the_undamped_equations():
    train = build_train(load_scene("ohv-3dof"))
    _, stiffness = assembled(train, np.ones(4, dtype=bool))
    for shape, angular in zip(OHV.shape, OHV.angular, strict=True):
        np.testing.assert_allclose(stiffness @ shape, angular**2 * train.mass * shape, rtol=1e-6, atol=1e-3)
        assert np.linalg.norm(shape) == pytest.approx(1, rel=1e-14)


def test_damped_shapes_move_together_and_have_unit_norm():
    found = modes(KODAMA)
    np.testing.assert_allclose(np.linalg.norm(found.shape, axis=1), 1, rtol=1e-14)
    surge = found.shape[0]  # first spring surge: half a sine over the coils, the train all but still
    np.testing.assert_allclose(surge[5:] / surge[7], np.sin(np.arange(1, 6) * np.pi / 6), atol=0.01)
    assert np.abs(surge[:5]).max() < 0.01


def test_damped_shapes_tend_to_the_undamped_ones():
    dampings = matching(KODAMA, "*.damping_N_s_per_m")
    light, none = ({number: share * number.of(KODAMA) for number in dampings} for share in (1e-6, 0.0))
    shapes = [modes(with_numbers(KODAMA, numbers)).shape for numbers in (light, none)]
    np.testing.assert_allclose(*shapes, atol=1e-6)


def test_one_mass_by_hand():
    """MOTORI: one mass between springs; seated adds the seat's stiffness and damping, the clash stays open."""
    for state, k, c in (("lifted", 1.5e8 + 38200, 1200.4), ("seated", 1.5e8 + 38200 + 1.8e8, 5200.4)):
        found = modes(MOTOR, state)
        assert found.angular == pytest.approx([np.sqrt(k / 0.24)])
        assert found.damping_ratio == pytest.approx([c / (2 * np.sqrt(k * 0.24))])
        assert found.frequency_Hz == pytest.approx(found.angular / (2 * np.pi))
        np.testing.assert_array_equal(found.shape, [[1.0]])


def test_closed_contacts_are_named():
    """The coils of MOTORI's spring, which clash at no such state, are not among them."""
    assert modes(KODAMA, "lifted").closed == ("cam_follower", "follower_valve")
    assert modes(KODAMA, "seated").closed == ("cam_follower", "follower_valve", "seat")
    assert modes(MOTOR, "lifted").closed == ("train", "spring")
    assert modes(MOTOR, "seated").closed == ("train", "spring", "seat")


def damped(scene, name, damping_N_s_per_m):
    """The scene with another damping of one element."""
    number = matching(scene, f"{name}.damping_N_s_per_m")[0]
    return with_numbers(scene, {number: damping_N_s_per_m})


def test_overdamped_pairs_are_left_out_and_said_to_be_so():
    stuck = damped(KODAMA, "seat", 1e6)
    assert len(modes(stuck, "seated").frequency_Hz) == 9
    assert len(modes(stuck, "lifted").frequency_Hz) == 10
    heavy = modes(damped(MOTOR, "train", 1e5))
    assert mode_lines(heavy)[1:] == ["overdamped: 1 of 1 modes, damped by more than 100 %: no oscillation"]
    assert not any("overdamped" in line for line in mode_lines(modes(MOTOR)))


def test_highest_rate_counts_every_element():
    assert highest_rate(build_train(KODAMA)) == pytest.approx(2 * np.pi * modes(KODAMA, "seated").frequency_Hz[-1])
    k, c = 1.5e8 + 38200 + 1.8e8 + 1.8e8, 1200.4 + 8000
    slow = np.roots([0.24, c, k])
    assert highest_rate(build_train(MOTOR)) == pytest.approx(np.abs(slow).max())


def test_unknown_state():
    with pytest.raises(InputError, match="'open'"):
        modes(KODAMA, "open")
