"""Optimisers at one judge: a few of them at small size, and what the figure draws."""

import numpy as np
import pytest

pytest.importorskip("cma")  # of the extra `peers`
from experiments import optimisers
from experiments.support import optimisers_figure, optimisers_table


def test_a_few_at_small_size(tmp_path):
    content = optimisers.main("small", tmp_path)
    rows = {optimisers_table.name_of(row): row for row in content["runs"]}
    assert len(rows) == len(optimisers.FEW)
    program, climbed = rows["program alone"], rows["L-BFGS, exact gradients, from program"]
    assert 0.5 < program["area_ratio"] <= climbed["area_ratio"] < 0.7
    assert program["ended"] == "ended by itself" and climbed["ended"] == ""
    assert all(at <= content["budget_s"] for row in rows.values() for at, _ in row["stairs"])
    assert all(np.all(np.diff([area for _, area in row["stairs"]]) > 0) for row in rows.values())
    assert (tmp_path / "optimisers-area.png").stat().st_size > 10_000


def test_the_figure_holds_the_last_area():
    time = np.array([0.0, 1.0, 2.0, 3.0])
    found = optimisers_figure.held([[1.0, 0.5], [2.5, 0.6]], time)
    np.testing.assert_array_equal(found, [np.nan, 0.5, 0.5, 0.6])
