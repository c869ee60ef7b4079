"""The comparison of searches, small: every method has its row, and CMA-ES gets the same program both ways."""

import json

import numpy as np
import pytest

pytest.importorskip("cma")

from camopt.optimizer.program.force_rows import Margins
from camopt.scene import load_scene
from experiments.search_methods import EFFORTS, Given, main, reached


def test_small_run_has_every_method_and_when_it_reached_what(tmp_path):
    content = main("small", tmp_path)
    rows = json.loads((tmp_path / "search_methods.json").read_text())["motori-1 nominal"]
    assert [r["method"] for r in rows] == [r["method"] for r in content["motori-1 nominal"]]
    assert len(rows) == 7
    own = rows[0]
    assert own["area_ratio"] == own["stairs"][-1][1] > 0.5
    assert own["ratio_to_first"] == own["ratio_to_last"] == 1.0
    assert np.all(np.diff([area for _, area in own["stairs"]]) > 0)
    assert rows[4]["judged"] > 0


def test_ratios_are_of_the_first_cam_that_is_large_enough():
    rows = [{"stairs": [(2.0, 0.5), (10.0, 0.6)]}, {"stairs": [(4.0, 0.4), (6.0, 0.55)]}, {"stairs": []}]
    reached(rows)
    assert [r["ratio_to_first"] for r in rows] == [1.0, 3.0, None]
    assert [r["seconds_to_last"] for r in rows] == [10.0, None, None]
    assert [r["ratio_to_best"] for r in rows] == [1.0, 0.6, None]


def test_the_program_by_scipy_has_camopts_answer():
    given = Given(load_scene("kodama"), "nominal", EFFORTS["small"])
    found = given.program.solve(Margins(5.0, -5.0, 0.0))
    np.testing.assert_allclose(given.cold(Margins(5.0, -5.0, 0.0)), found.z, atol=1e-8)
    assert given.cold(Margins(900.0, 900.0, 900.0)) is None
