"""The price list of tolerances: the small size, widths that are what they say, and what the full size left."""

import json

import numpy as np
import pytest

from camopt.measure.as_built import trains_as_built
from camopt.scene import load_scene
from experiments import yield_price


def test_small_size(tmp_path):
    content = yield_price.main("small", tmp_path)
    (row,) = content["rows"].values()
    assert 0.0 < row["common_margin_area_ratio"] <= row["slopes_area_ratio"] < 1.0
    assert row["slopes_low"] < row["slopes_share"] <= row["slopes_high"]
    assert content["literature"] and all(0.0 <= one["share"] <= 1.0 for one in content["literature"].values())
    assert (tmp_path / "yield_price.json").is_file()


@pytest.mark.parametrize("width", [0.5, 2.0])
def test_twice_the_tolerance_scatters_twice_as_far(width):
    scene = load_scene("motori-1")
    plain, wider = (trains_as_built(made, 30, seed=3) for made in (scene, yield_price.scattered(scene, width)))
    masses = [[one.train.mass[0] for one in trains] for trains in (plain, wider)]
    assert np.std(masses[1]) / np.std(masses[0]) == pytest.approx(width, rel=1e-6)


def test_narrower_tolerances_give_larger_cams():
    content = json.loads((yield_price.RESULTS / "yield_price.json").read_text())
    areas = [content["rows"][f"{width:g}"]["slopes_area_ratio"] for width in yield_price.WIDTHS["full"]]
    assert areas == sorted(areas, reverse=True)
    for row in content["rows"].values():
        assert row["slopes_area_ratio"] > row["common_margin_area_ratio"]
        assert row["slopes_low"] >= content["least_low"] and row["slopes_agrees"]
    assert all(one["high"] < content["wanted"] for one in content["literature"].values())
