"""Polydyne against Eqs. (1) to (3) of Kodama et al., and against coefficients computed elsewhere."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import equivalent_train, polydyne
from camopt.cam.osculating import osculating_pieces
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG2, MM_PER_DEG3

HALF = 72 * DEG


def test_calibrated_member_of_the_reference_fit():
    """Coefficients, nose lift and peaks as the fit of the reference train states them (exponents 2-12-20-32-34)."""
    scene = load_scene("kodama")
    a, b = 1.02, 9.22 * DEG**2
    lift = polydyne(scene, (2, 12, 20, 32, 34), ramp_height_mm=0.25, dynamic=(a, b))
    powers = np.array([0, 2, 12, 20, 32, 34])
    c = np.array([1.0, -1.48482, 1.12132, -0.92831, 0.92071, -0.62891]) * 9.01728 * MM
    x = np.linspace(0.0, 1.0, 50)[:, None]
    second = np.where(powers > 1, powers * (powers - 1) * x ** np.maximum(powers - 2, 0), 0.0) / HALF**2
    stated = 0.25 * MM + (a * x**powers + b * second) @ c
    assert np.abs(lift(x[:, 0] * HALF) - stated).max() < 2e-4 * MM  # the coefficients are printed to five digits
    assert lift(0.0) == pytest.approx(9.4 * MM, abs=1e-15)
    low, high = lift.extremes(2, -HALF, HALF)
    assert (low / MM_PER_DEG2, high / MM_PER_DEG2) == pytest.approx((-0.00527, 0.01424), abs=1e-5)
    assert lift.extremes(3, -HALF, HALF)[1] / MM_PER_DEG3 == pytest.approx(0.01716, abs=1e-5)
    assert lift.area_ratio(9.4 * MM) == pytest.approx(0.5716, abs=5e-5)


@pytest.mark.parametrize("exponents", [(2, 10, 18, 26, 34), (4, 12, 26, 34, 50), (2, 8.5, 20, 30, 41.3)])
def test_conditions_of_the_flank_end(exponents):
    scene = load_scene("kodama")
    lift = polydyne(scene, exponents)
    a, b = lift.parameters["A"], lift.parameters["B_deg2"] * DEG**2
    inner = HALF * (1 - 1e-13)
    assert lift(inner) == pytest.approx(0.265 * MM, rel=1e-9)  # y = 0, y'' = 0
    assert lift(inner, 1) == pytest.approx(-0.011 * MM_PER_DEG, rel=1e-9)  # B y''' is the ramp velocity, y' = 0
    assert lift(inner, 2) == pytest.approx(0.0, abs=1e-8 * MM_PER_DEG2)  # A y'' + B y'''' = 0
    assert lift(0.0) == pytest.approx(9.4 * MM, rel=1e-12)
    assert lift(np.array([0.3, 0.9]), 2) == pytest.approx(lift(-np.array([0.3, 0.9]), 2), rel=1e-9)
    assert a == pytest.approx(1.00125, abs=1e-5)
    assert b / DEG**2 == pytest.approx(3.37, abs=0.01)  # at 7000 r/min


def test_pieces_meet_the_power_law_between_their_borders():
    scene = load_scene("kodama")
    lift = polydyne(scene, (2, 10, 18, 26, 34), dynamic=(1.0, 1e-3))
    theta = np.linspace(0.01, HALF - 0.01, 400)
    a, b, x = 1.0, 1e-3, theta / HALF
    powers = np.array([0, 2, 10, 18, 26, 34])

    def columns(order):
        factor = np.prod([powers - i for i in range(order)], axis=0) if order else np.ones(6)
        return np.where(factor != 0, factor * x[:, None] ** np.maximum(powers - order, 0), 0.0) / HALF**order

    law = a * columns(0) + b * columns(2)
    c, *_ = np.linalg.lstsq(law, lift(theta) - 0.265 * MM, rcond=None)
    assert lift(theta) - 0.265 * MM == pytest.approx(law @ c, abs=1e-12 * MM)
    assert lift(theta, 3) == pytest.approx((a * columns(3) + b * columns(5)) @ c, rel=1e-6, abs=1e-8 * MM_PER_DEG3)


def test_equivalent_train_is_the_series_stiffness_and_the_moving_mass():
    train = build_train(load_scene("kodama"))
    series = 1 / np.sum(1 / np.array([1.52e8, 8.12e7, 9.18e7, 8.01e7, 1.42e8]))
    k_e, k_sp, mass = equivalent_train(train)
    assert k_e == pytest.approx(series, rel=5e-3)
    assert k_sp == pytest.approx(152000 / 6, rel=1e-3)
    assert mass == pytest.approx(0.0509 + 0.0312 + 0.0229 + 0.037 + 0.00833 * 55 / 36, rel=5e-3)
    assert equivalent_train(build_train(load_scene("motori-1"))) == pytest.approx((1.5e8, 38200.0, 0.24))


@pytest.mark.parametrize("exponents", [(2, 2, 3, 4, 5), (2, 10, 18, 26), (1, 10, 18, 26, 34), (2, 4.5, 18, 26, 34)])
def test_unusable_exponents_are_refused(exponents):
    with pytest.raises(InputError, match="polydyne: exponents"):
        polydyne(load_scene("kodama"), exponents)


def test_osculating_pieces_carry_value_and_five_derivatives():
    borders = np.array([0.0, 0.4, 1.0])
    orders = np.arange(6)
    exact = np.exp(2 * borders)[:, None] * 2.0**orders
    pieces = osculating_pieces(borders, exact)
    middle = np.array([sum(c * u**k for k, c in enumerate(p)) for p, u in zip(pieces, (0.2, 0.3), strict=True)])
    assert middle == pytest.approx(np.exp(2 * np.array([0.2, 0.7])), rel=1e-11)
