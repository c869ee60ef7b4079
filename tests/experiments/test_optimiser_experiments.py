"""The optimiser's experiments at their small size."""

import json
from dataclasses import replace

import pytest

from camopt.optimizer.accuracy import ACCURACIES
from experiments import fronts, gradient_value, optimiser, price_list


def test_optimiser_row_is_within_its_bound_and_limits(tmp_path):
    (row,) = optimiser.main("small", tmp_path)["rows"]
    assert 0.4 < row["area_ratio_no_jump"] <= row["area_ratio"] < row["area_ratio_bound"] < 0.65
    assert row["bounce_mm"] <= optimiser.BOUNCE_MM
    assert row["acceleration_sign_changes"] >= 2 and row["acceleration_sign_changes"] % 2 == 0  # up, nose, down
    assert json.loads((tmp_path / "optimiser.json").read_text())["rows"] == [pytest.approx(row)]
    assert "| kodama, nominal |" in optimiser.table([row])


@pytest.mark.long
def test_price_of_preload_is_a_price(tmp_path):
    content = price_list.main("small", tmp_path)
    (price,) = content["prices"]
    assert price["group"] == "preload" and price["price_percent"] > 1.0  # less preload, sooner afloat
    assert {p["perturbation"] for p in content["as_designed"]} >= {"spring rate less", "lash more", "grinding 0"}


@pytest.mark.long
def test_with_few_coefficients_either_gradient_adds_area(tmp_path):
    few = gradient_value.main("small", tmp_path)["few coefficients"]
    assert few["none"]["gain"] == 0.0
    assert few["smooth"]["gain"] > 1e-3 and few["exact"]["gain"] > 1e-3


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
