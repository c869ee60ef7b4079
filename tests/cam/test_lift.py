"""Lift pieces: values, exact extremes, area, closing angle, ramps, sums of lifts, and the wrap at half a turn."""

import numpy as np
import pytest
from scipy.integrate import quad

from camopt.cam.lift import Lift, lift_table, with_ramps
from camopt.cam.polynomials import recentred
from camopt.cam.ramps import Ramp, scene_ramps
from camopt.scene.units import DEG, MM
from tests.cam.cams import KODAMA, POLYDYNE

H = 0.0094


def bump(half: float = 1.0, height: float = H) -> Lift:
    """height (1 - theta^2)^3 between -1 and 1 rad, zero elsewhere."""
    theta = np.polynomial.Polynomial([-1.0, 1.0])  # theta about the piece's start at -1
    middle = (height * (1 - theta**2) ** 3).coef
    return Lift(np.array([-np.pi, -1.0, 1.0, np.pi]), np.array([np.zeros(7), middle, np.zeros(7)]), half)


def test_values_and_derivatives_of_a_known_lift():
    theta = np.array([-2.0, -0.7, 0.0, 0.3, 1.5])
    u = np.where(np.abs(theta) < 1, 1 - theta**2, 0.0)
    lift = bump()
    np.testing.assert_allclose(lift(theta), H * u**3, atol=1e-16)
    np.testing.assert_allclose(lift(theta, 1), -6 * H * theta * u**2, atol=1e-15)
    np.testing.assert_allclose(lift(theta, 2), H * (24 * theta**2 * u - 6 * u**2), atol=1e-15)
    inside = np.abs(theta) < 1
    np.testing.assert_allclose(lift(theta, 3), inside * H * (72 * theta * u - 48 * theta**3), atol=1e-14)


@pytest.mark.parametrize("turns", [-2, -1, 1, 3])
def test_lift_is_periodic(turns):
    theta = np.linspace(-3.1, 3.1, 41)
    for order in range(4):
        # 1e-13 relative: the angle loses digits in the wrap
        np.testing.assert_allclose(
            POLYDYNE(theta + 2 * np.pi * turns, order),
            POLYDYNE(theta, order),
            atol=1e-12 * np.abs(POLYDYNE.extremes(order)).max(),
        )


def test_extremes_are_exact():
    lift = bump()
    assert lift.max_lift == pytest.approx(H, rel=1e-14)
    fastest = 6 * H / np.sqrt(5) * (4 / 5) ** 2
    np.testing.assert_allclose(lift.extremes(1), [-fastest, fastest], rtol=1e-13)
    # h'' = H (30 t^4 - 36 t^2 ... ) is least at the nose and greatest at t^2 = 3/5
    np.testing.assert_allclose(lift.extremes(2), [-6 * H, H * (24 * 0.6 * 0.4 - 6 * 0.16)], rtol=1e-13)
    low, high = lift.extremes(1, -0.1, 0.1)
    np.testing.assert_allclose([low, high], [-0.6 * H * 0.99**2, 0.6 * H * 0.99**2], rtol=1e-12)


def test_extremes_see_both_sides_of_a_step():
    """The acceleration climbs from 0 to 5, steps to -6 at the nose, and climbs to 0 again."""
    rows = np.array([[0.0, 0.0, 0.0, 5 / (6 * np.pi)], [0.0, 0.0, -3.0, 1 / np.pi]])
    lift = Lift(np.array([-np.pi, 0.0, np.pi]), rows, 1.0)
    assert lift.extremes(2) == pytest.approx((-6.0, 5.0))
    assert lift.extremes(2, 0.5 * np.pi, np.pi) == pytest.approx((-3.0, 0.0))


def test_area_of_a_known_lift_and_against_quadrature():
    assert bump().area == pytest.approx(H * 32 / 35, rel=1e-14)
    half = KODAMA.design.duration_deg * DEG / 2
    area, error = quad(POLYDYNE, -half, half, epsabs=1e-13, limit=200)
    assert POLYDYNE.area == pytest.approx(area, abs=1e-12 + error)
    ratio = POLYDYNE.area / MM / DEG / (9.4 * 144)
    assert POLYDYNE.area_ratio(9.4 * MM) == pytest.approx(ratio, rel=1e-14)


def test_opening_foot_and_closing_angle():
    lift = bump()
    assert lift.opening_foot == -1.0
    assert lift.closing_angle(0.0) == 1.0
    assert lift.closing_angle(H * (1 - 0.81) ** 3) == pytest.approx(0.9, rel=1e-12)
    assert POLYDYNE.closing_angle(0.265 * MM) == pytest.approx(72 * DEG, rel=1e-12)
    with pytest.raises(ValueError, match="never reaches 20 mm"):
        lift.closing_angle(20 * MM)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_ramps_join_with_continuous_acceleration(order):
    """Base circle, foot, straight ramp and event meet with equal lift, velocity and acceleration at every border."""
    factorial = (1, 1, 2)[order]
    start = POLYDYNE.coefficients[:, order] * factorial
    ends = recentred(POLYDYNE, np.arange(len(start)), POLYDYNE.borders[1:])[:, order] * factorial
    scale = np.abs(POLYDYNE.extremes(order)).max()
    np.testing.assert_allclose(ends, np.roll(start, -1), atol=1e-11 * scale)


def test_ramp_height_velocity_and_length():
    opening, closing = scene_ramps(KODAMA.design)
    assert opening == closing == Ramp(0.265 * MM, 0.011 * MM / DEG, 10 * DEG)
    assert opening.length / DEG == pytest.approx(0.265 / 0.011 + 5)
    assert POLYDYNE.opening_foot / DEG == pytest.approx(-72 - 0.265 / 0.011 - 5)
    for side in (-1, 1):
        assert POLYDYNE(side * 72 * DEG) / MM == pytest.approx(0.265, abs=1e-12)
        assert POLYDYNE(side * 80 * DEG, 1) / MM * DEG == pytest.approx(-side * 0.011, rel=1e-12)
        assert POLYDYNE(side * 80 * DEG) / MM == pytest.approx(0.265 - 8 * 0.011, rel=1e-12)


def test_sides_with_different_ramps():
    """The closing ramp keeps its own height, velocity and foot, and falls."""
    opening, closing = Ramp(0.3e-3, 0.6e-3, 0.1), Ramp(0.2e-3, 0.5e-3, 0.3)
    event = np.array([[0.3e-3, -0.1e-3 / 2]])
    lift = with_ramps(np.array([-1.0, 1.0]), event, opening, closing, "test", {})
    assert lift(-1.0) == pytest.approx(0.3e-3)
    assert lift(1.0) == pytest.approx(0.2e-3)
    np.testing.assert_allclose(lift(np.array([-1.2, 1.2]), 1), [0.6e-3, -0.5e-3])
    assert lift.opening_foot == pytest.approx(-1 - 0.3 / 0.6 - 0.05)
    assert lift.closing_angle(0.0) == pytest.approx(1 + 0.2 / 0.5 + 0.15)
    foot_middle = 1 + 0.2 / 0.5  # half of the foot's velocity, by the foot's symmetry
    assert lift(foot_middle, 1) == pytest.approx(-0.25e-3)


def test_ramp_without_foot():
    lift = with_ramps(np.array([-1.0, 1.0]), np.array([[1e-3]]), *[Ramp(1e-3, 2e-3, 0.0)] * 2, "test", {})
    assert lift.opening_foot == pytest.approx(-1.5)
    np.testing.assert_allclose(
        lift(np.array([-1.51, -1.25, 0.0, 1.25, 1.51])), [0, 0.5e-3, 1e-3, 0.5e-3, 0], atol=1e-18
    )


def test_shifted_adds_lifts_and_leaves_them_alone():
    error = bump(height=1e-7)
    before = POLYDYNE.coefficients.copy()
    total = POLYDYNE.shifted(error)
    theta = np.linspace(-np.pi, np.pi, 2003)
    for order in range(4):
        expected = POLYDYNE(theta, order) + error(theta, order)
        np.testing.assert_allclose(total(theta, order), expected, atol=1e-11 * np.abs(expected).max())
    assert total.area == pytest.approx(POLYDYNE.area + error.area, rel=1e-13)
    np.testing.assert_array_equal(POLYDYNE.coefficients, before)


def test_recentred_by_hand():
    """2 + 3 u + u^2 about u = 0 is 12 + 7 w + w^2 about u = 2."""
    lift = Lift(np.array([-np.pi, np.pi]), np.array([[2.0, 3.0, 1.0]]), 1.0)
    np.testing.assert_allclose(recentred(lift, np.array([0]), np.array([2.0 - np.pi])), [[12.0, 7.0, 1.0]])


def test_lift_table_in_field_units():
    table = lift_table(POLYDYNE, 0.5)
    degrees = table["cam_angle_deg"]
    assert (degrees[0], degrees[-1], len(degrees)) == (-180.0, 180.0, 721)
    assert table["lift_mm"][360] == pytest.approx(9.4)
    velocity = np.gradient(table["lift_mm"], degrees)
    # second-order differences at 0.5 deg against a jerk of 0.003 mm/deg^3: 0.003 * 0.25 / 6
    np.testing.assert_allclose(velocity[1:-1], table["velocity_mm_per_deg"][1:-1], atol=1.5e-4)
    acceleration = np.gradient(table["velocity_mm_per_deg"], degrees)
    np.testing.assert_allclose(acceleration[1:-1], table["acceleration_mm_per_deg2"][1:-1], atol=1.5e-3)
    inside = np.abs(degrees) < 60
    jerk = np.gradient(table["acceleration_mm_per_deg2"], degrees)
    np.testing.assert_allclose(jerk[inside], table["jerk_mm_per_deg3"][inside], atol=1e-4)


@pytest.mark.parametrize(
    ("borders", "rows", "says"),
    [
        ([-3.0, np.pi], [[0.0]], "cover -pi to pi"),
        ([-np.pi, 1.0, 1.0, np.pi], [[0.0]] * 3, "ascending"),
        ([-np.pi, np.pi], [[0.0]] * 2, "one row"),
        ([-np.pi, np.pi], [[np.nan]], "finite"),
    ],
)
def test_unusable_pieces_are_refused(borders, rows, says):
    with pytest.raises(ValueError, match=says):
        Lift(np.array(borders), np.array(rows), 1.0)
