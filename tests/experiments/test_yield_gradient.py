"""What gradients add to a cam for a yield: the small size, and what the full size left."""

import json

import numpy as np
import pytest

from experiments import yield_gradient


def test_small_size(tmp_path):
    content = yield_gradient.main("small", tmp_path)
    assert list(content["seeds"]) == ["0", "1"]
    gains = [row["area_ratio"] - row["without_gradients_area_ratio"] for row in content["seeds"].values()]
    assert min(gains) >= 0.0 and content["gain"]["mean"] == pytest.approx(np.mean(gains), abs=1e-15)
    assert all(0.5 < row["area_ratio"] < 1.0 for row in content["seeds"].values())


def test_ten_seeds_are_stored():
    content = json.loads((yield_gradient.RESULTS / "yield_gradient.json").read_text())
    areas = np.array([[row["without_gradients_area_ratio"], row["area_ratio"]] for row in content["seeds"].values()])
    assert areas.shape == (yield_gradient.SEEDS["full"], 2) and np.all(np.diff(areas, axis=1) >= 0.0)
    assert content["gain"]["mean"] == pytest.approx(np.diff(areas, axis=1).mean(), abs=1e-12)
