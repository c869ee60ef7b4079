"""The optimiser's experiments at their small size."""

import json
from dataclasses import replace

import pytest

from camopt.optimizer.accuracy import ACCURACIES
from experiments import fronts, optimiser


def test_optimiser_row_is_within_its_bound_and_limits(tmp_path):
    (row,) = optimiser.main("small", tmp_path)["rows"]
    assert 0.54 < row["area_ratio"] < row["area_ratio_bound"] < 0.65
    assert row["bounce_mm"] <= optimiser.BOUNCE_MM
    assert row["acceleration_sign_changes"] >= 2 and row["acceleration_sign_changes"] % 2 == 0  # up, nose, down
    assert json.loads((tmp_path / "optimiser.json").read_text())["rows"] == [pytest.approx(row)]
    assert "| kodama, nominal |" in optimiser.table([row])


@pytest.mark.long
def test_fronts_and_the_spring_that_goes_with_the_cam(tmp_path, monkeypatch):
    coarse = replace(ACCURACIES["draft"], knot_deg=8.0, program_speeds=2)
    monkeypatch.setitem(ACCURACIES, "draft", coarse)
    content = fronts.main("small", tmp_path)
    tight, loose = content["fronts"]["jerk_max_mm_per_deg3"]["area_ratio"]
    assert 0.3 < tight < loose < 0.6
    spring = content["spring"]
    assert spring["area_ratio_program"] >= spring["area_ratio_program_as_given"]
    assert 0.9 <= spring["rate"] <= 1.1 and 0.9 <= spring["preload"] <= 1.1
    assert (tmp_path / "fronts-jerk_max_mm_per_deg3.png").stat().st_size > 10_000
