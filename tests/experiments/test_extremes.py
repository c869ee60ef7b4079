"""The experiment over every extreme, at its small size, and what its full one left."""

import json

from camopt.study.extremes.classification import VERDICTS, WITHIN, WRONG
from experiments.extremes import RESULTS, SCENES, main


def test_small_size(tmp_path):
    content = main("small", tmp_path)
    assert content["wrong"] == [] and content["rows"] == 9 + 8  # methods, and five past their limit, three layers
    as_it_is = content["verdicts"]["motori-2"]["as it is"]
    assert as_it_is["event"] == as_it_is["dop853"] == WITHIN
    assert (tmp_path / "extremes.json").exists()


def test_full_size_left_every_scene_and_nothing_wrong():
    content = json.loads((RESULTS / "extremes.json").read_text())
    assert set(content["by_scene"]) == set(SCENES["full"])
    assert content["wrong"] == [] and all(WRONG not in found for found in content["by_scene"].values())
    assert content["rows"] == sum(sum(found.values()) for found in content["by_scene"].values())
    assert {v for found in content["by_method"].values() for v in found} <= set(VERDICTS)
