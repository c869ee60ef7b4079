"""The experiment on the classical laws: least peaks through conditions, compared with closed forms."""

from math import factorial

import numpy as np
import pytest
from scipy.interpolate import PPoly

from experiments import classical_laws
from experiments.classical_laws import least_peak_through


def test_the_motion_through_the_handbooks_table_meets_every_number_of_it():
    count = classical_laws.TABLE_INTERVALS["small"]
    conditions = [(np.deg2rad(angle), order, value) for angle, order, value in classical_laws.TABLE_5_4]
    jerk = least_peak_through(conditions, 3, count).derivative
    edges = np.linspace(0.0, np.deg2rad(270.0), count + 1)
    motion = PPoly(jerk[None], edges)
    laws = [motion.antiderivative(3 - k) for k in range(3)]
    for angle, order, value in conditions:
        assert float(laws[order](angle)) == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize(("order", "peak_error"), [(2, 1e-9), (3, 1e-9), (4, 1e-4)])
def test_the_least_peak_through_rest_at_the_end_is_that_of_the_rise(order, peak_error):
    least = 4 ** (order - 1) * factorial(order - 1)
    found = least_peak_through([(1.0, k, float(k == 0)) for k in range(order)], order, 400)
    assert found.bound <= least * (1 + 1e-9) and found.peak >= least * (1 - 1e-9)
    assert found.peak == pytest.approx(least, rel=peak_error) and found.bound == pytest.approx(least, rel=1e-4)


@pytest.mark.parametrize(("back", "height", "least"), [(2.0, 1.0, 4.0), (3.0, 1.0, 4.0), (1.5, 1.0, 16.0)])
def test_the_shorter_of_a_rise_and_its_return_has_the_peak(back, height, least):
    """From rest to rest in a time T a height needs the acceleration 4 height / T^2."""
    conditions = [(1.0, 0, height), (1.0, 1, 0.0), (back, 0, 0.0), (back, 1, 0.0)]
    found = least_peak_through(conditions, 2, 600)
    assert (found.peak, found.bound) == pytest.approx((least, least), rel=1e-4)
    assert len(found.derivative) == 600 and np.abs(found.derivative).max() == pytest.approx(least)
