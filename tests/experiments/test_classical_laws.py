"""The experiment on the classical laws: their known peaks, and what the least ones gain."""

from math import factorial

import numpy as np
import pytest
from scipy.interpolate import PPoly

from experiments import classical_laws
from experiments.classical_laws import least_peak_through

EXPECTED = {
    "modified trapezoid": (4.888, 61.43, 4.728, 3.3),
    "modified sine": (5.528, 69.47, 4.612, 16.6),
    "3-4-5": (5.774, 60.0, 4.753, 17.7),
    "cycloidal": (6.283, 39.48, 5.574, 11.3),
    "4-5-6-7": (7.513, 52.5, 4.923, 34.5),
}
"""Peak acceleration, peak jerk, least acceleration at that jerk, possible gain in per cent."""


def test_the_laws_have_their_known_peaks_and_leave_their_known_gain(tmp_path):
    found = classical_laws.main("small", tmp_path)
    assert [row["law"] for row in found["laws"]] == list(EXPECTED)
    for row in found["laws"]:
        peak, jerk, least, gain = EXPECTED[row["law"]]
        assert row["rise"] == pytest.approx(1.0, abs=1e-6)
        assert row["peak_acceleration"] == pytest.approx(peak, abs=6e-4)
        assert row["peak_jerk"] == pytest.approx(jerk, abs=6e-3)
        assert row["least_acceleration"] == pytest.approx(least, abs=1e-3)  # 500 intervals: 2e-4 above the least
        assert row["bound"] <= row["least_acceleration"] <= row["bound"] * (1 + 3e-4)
        closed = row["peak_jerk"] / 4 * (1 - np.sqrt(1 - 32 / row["peak_jerk"]))
        assert row["least_acceleration"] == pytest.approx(closed, rel=2e-4)
        assert row["possible_gain_percent"] == pytest.approx(gain, abs=0.06)
    assert [row["peak"] for row in found["least_peaks"]] == pytest.approx([4, 32, 384, 6144], rel=1e-6)
    assert (tmp_path / "classical_laws-acceleration.png").exists()
    table = found["table_5_4"]
    assert table["bound_cm_per_rad3"] <= 17.0121 <= table["least_jerk_cm_per_rad3"] * (1 + 1e-6)
    assert table["least_jerk_cm_per_rad3"] <= table["bound_cm_per_rad3"] * (1 + 2e-4)


def test_the_motion_through_the_handbooks_table_meets_every_number_of_it():
    count = classical_laws.TABLE_INTERVALS["small"]
    conditions = [(np.deg2rad(angle), order, value) for angle, order, value in classical_laws.TABLE_5_4]
    jerk = least_peak_through(conditions, 3, count).derivative
    edges = np.linspace(0.0, np.deg2rad(270.0), count + 1)
    motion = PPoly(jerk[None], edges)
    laws = [motion.antiderivative(3 - k) for k in range(3)]
    for angle, order, value in conditions:
        assert float(laws[order](angle)) == pytest.approx(value, abs=1e-9)


def test_the_least_jerk_of_a_rise_is_the_closed_form_of_the_same_conditions():
    found = least_peak_through([(1.0, 0, 1.0), (1.0, 1, 0.0), (1.0, 2, 0.0)], 3, 400)
    assert found.peak == pytest.approx(32.0, rel=1e-9)
    assert found.bound == pytest.approx(32.0, rel=1e-4)
    assert found.bound <= found.peak


@pytest.mark.parametrize("order", [2, 3, 4])
def test_the_least_peak_through_rest_at_the_end_is_that_of_the_rise(order):
    least = 4 ** (order - 1) * factorial(order - 1)
    found = least_peak_through([(1.0, k, float(k == 0)) for k in range(order)], order, 400)
    assert found.bound <= least * (1 + 1e-9) and found.peak >= least * (1 - 1e-9)
    assert (found.peak, found.bound) == pytest.approx((least, least), rel=1e-3)


@pytest.mark.parametrize(("back", "height", "least"), [(2.0, 1.0, 4.0), (3.0, 1.0, 4.0), (1.5, 1.0, 16.0)])
def test_the_shorter_of_a_rise_and_its_return_has_the_peak(back, height, least):
    """From rest to rest in a time T a height needs the acceleration 4 height / T^2."""
    conditions = [(1.0, 0, height), (1.0, 1, 0.0), (back, 0, 0.0), (back, 1, 0.0)]
    found = least_peak_through(conditions, 2, 600)
    assert (found.peak, found.bound) == pytest.approx((least, least), rel=1e-4)
    assert len(found.derivative) == 600 and np.abs(found.derivative).max() == pytest.approx(least)
