"""The experiment on the cam families at its small size."""

import json

import pytest

from experiments import cam_families


def test_small_size(tmp_path, monkeypatch):
    monkeypatch.setattr(cam_families, "RESULTS", tmp_path)
    cam_families.main("small")
    rows = json.loads((tmp_path / "cam_families-small.json").read_text())["cams"]
    assert {(r["cam"], r["limits"]) for r in rows} == {
        (cam, limits) for cam in cam_families.SMALL for limits in ("Table 4", "kodama")
    }
    for row in rows:
        assert 0.5 < row["area_ratio"] < 0.65082  # the bang-bang bound without a jerk limit
        assert row["section_step_velocity_mm_per_deg"] < 1e-12
        assert row["ramp_step_acceleration_mm_per_deg2"] < 1e-12
    polydyne, _, trapezoid = rows[:3]
    assert polydyne["ramp_step_jerk_mm_per_deg3"] == pytest.approx(0.00323, abs=1e-5)
    assert trapezoid["section_step_jerk_mm_per_deg3"] == pytest.approx(trapezoid["jerk_max_mm_per_deg3"])
    assert trapezoid["broken"] == []
    assert (tmp_path / "cam_families-small.png").stat().st_size > 10_000
