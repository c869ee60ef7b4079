"""The experiment on the cam families: its stored members, and its orders of continuity."""

import json
from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.new_design import new_design
from camopt.cam.read import read_cam
from camopt.scene.units import DEG, MM
from experiments import cam_families
from experiments.cam_families import orders_of_continuity
from tests.cam.cams import CAMS, KODAMA, MULTI_POL, with_design

STORED = json.loads((cam_families.RESULTS / "cam_families.json").read_text())["cams"]


@pytest.mark.parametrize(
    ("cam", "reached"), [("multi-pol", 0.636), ("new-design", 0.635), ("new-design:start_ratio=0", 0.612)]
)
def test_stored_members_reach_the_literature(cam, reached):
    (row,) = [r for r in STORED if r["cam"] == cam and r["limits"] == "Table 4"]
    assert row["area_ratio"] >= reached - 0.002
    assert row["acceleration_max_mm_per_deg2"] <= 0.015
    assert row["acceleration_min_mm_per_deg2"] >= -0.008
    assert min(row["parameters"]["sections_deg"]) >= 2 - 1e-9
    assert [b["speed_rpm"] for b in row["bounce"]] == [5000, 6000, 6500, 7000]


class TestContinuity:
    def test_multi_pol(self):
        assert orders_of_continuity(MULTI_POL) == {"ramp": [2], "sections": [3, 3, 3, 3], "nose": [4]}

    @pytest.mark.parametrize(("ratio", "ramp", "first"), [(0.95, 1, 2), (0.0, 3, 2), (1.0, 1, 3)])
    def test_new_design(self, ratio, ramp, first):
        lift = new_design(KODAMA, (15.8, 9.9, 11.0, 35.3), a12=0.0125, j34=0.00044, start_ratio=ratio)
        assert orders_of_continuity(lift) == {"ramp": [ramp], "sections": [first, 3, 3], "nose": [4]}

    def test_a_small_step_is_seen(self):
        nose, pieces = int(np.argmin(np.abs(MULTI_POL.borders))), MULTI_POL.coefficients.copy()
        pieces[nose, 1] += 1e-5 * np.abs(MULTI_POL.extremes(1)).max()
        assert orders_of_continuity(replace(MULTI_POL, coefficients=pieces))["nose"] == [0]


def step(lift, angle, k):
    """The step of the k-th derivative [mm/deg^k] at a border of the lift's pieces [rad]."""
    i = int(np.argmin(np.abs(lift.borders - angle)))
    one, other = (np.polynomial.Polynomial(c).deriv(k) for c in lift.coefficients[i - 1 : i + 1])
    return abs(other(0.0) - one(lift.borders[i] - lift.borders[i - 1])) / MM * DEG**k


def test_steps_are_rounding_and_the_polydynes_jerk_is_known():
    for lift in (CAMS[name] for name in ("polydyne", "exponent", "trapezoid")):
        half = lift.half_duration
        assert max(step(lift, angle, k) for angle in (-half, half) for k in (1, 2)) < 1e-12
        assert all(step(lift, border, 1) < 1e-12 for border in lift.borders[1:-1] if abs(border) < half - 1e-9)
    lift = read_cam("polydyne", with_design(jerk_max_mm_per_deg3=None, nose_deg=None))
    assert step(lift, -lift.half_duration, 3) == pytest.approx(0.00323, abs=1e-5)
