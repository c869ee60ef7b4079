"""Dwell-rise-dwell: program and bound meet the closed forms."""

from math import factorial

import numpy as np
import pytest

from camopt.scene import InputError
from camopt.study.rise import least_acceleration, least_peak


@pytest.mark.parametrize(("order", "least"), [(2, 4.0), (3, 32.0), (4, 384.0), (5, 6144.0)])
def test_the_least_peak_of_a_derivative(order, least):
    assert least == 4 ** (order - 1) * factorial(order - 1)
    found = least_peak(order)
    assert found.bound <= least * (1 + 1e-9) and found.peak >= least * (1 - 1e-9)
    turns = np.flatnonzero(np.diff(np.sign(found.derivative))) / len(found.derivative)
    expected = (1 - np.cos(np.arange(1, order) * np.pi / order)) / 2
    assert turns == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("jerk", [39.48, *(pytest.param(j, marks=pytest.mark.long) for j in (36.0, 60.0, 69.47))])
def test_the_least_peak_acceleration_under_a_jerk(jerk):
    least = jerk / 4 * (1 - np.sqrt(1 - 32 / jerk))
    found = least_acceleration(jerk)
    assert found.bound <= least * (1 + 1e-9) and found.peak >= least * (1 - 1e-9)
    assert found.peak == pytest.approx(least, rel=1e-6)
    assert found.bound == pytest.approx(least, rel=1e-6)
    assert np.abs(np.diff(found.derivative)).max() * (len(found.derivative) - 1) <= jerk * (1 + 1e-6)


def test_too_little_of_either_is_refused():
    with pytest.raises(InputError, match="more than 32"):
        least_acceleration(32.0)
    with pytest.raises(InputError, match="2, which is the acceleration"):
        least_peak(1)
