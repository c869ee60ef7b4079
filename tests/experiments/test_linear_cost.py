"""Linear trains beside the tree before real ones: the small size, the stored ratios, a history too short."""

import json

import pytest

from camopt.scene import InputError
from experiments import linear_cost


def test_small_size(tmp_path):
    content = linear_cost.main("small", tmp_path)
    assert len(content["rows"]) == 3 * len(linear_cost.SCENES)
    assert all(row["before_us"] > 1.0 for row in content["rows"].values())
    assert content["largest_ratio"] == max(row["ratio"] for row in content["rows"].values())


def test_a_linear_train_costs_no_more_than_before():
    content = json.loads((linear_cost.RESULTS / "linear_cost.json").read_text())
    assert content["before"] == linear_cost.BEFORE
    assert 0.0 < content["largest_ratio"] <= content["allowed"] == linear_cost.ALLOWED


def test_a_history_without_the_commit_is_said(tmp_path):
    with pytest.raises(InputError, match="0000dead is not in this history: run it in a whole clone"):
        linear_cost.older_tree("0000dead", tmp_path)


def test_the_fastest_calls_count():
    sizes = iter([90_000, 90_000, *[30_000] * 18, 1000, 1000])
    seconds = linear_cost.fastest_tenth(lambda: sum(range(next(sizes))), 20)
    assert 0.0 < seconds < 2e-4
