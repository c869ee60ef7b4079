"""The experiment on the cam families: its stored members, and its orders of continuity."""

import json
from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.new_design import new_design
from experiments import cam_families
from experiments.cam_families import orders_of_continuity
from tests.cam.cams import KODAMA, MULTI_POL

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
