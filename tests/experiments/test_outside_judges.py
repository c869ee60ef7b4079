"""The experiment on the judge from outside at its small size: motori-1 at one speed, and two changes that show."""

import numpy as np
import pytest

import camopt
from camopt.scene import load_scene
from camopt.verifier.from_outside import find_spec
from experiments import outside_judges
from experiments.support.outside_changes import CHANGES

needs_exudyn = pytest.mark.skipif(find_spec("exudyn") is None, reason="the extra `outside` is not installed")


@needs_exudyn
def test_the_small_size(tmp_path):
    content = outside_judges.main("small", tmp_path)
    (row,) = content["rows"]
    assert row["agrees"] and row["difference_nm"] < 1.0 and row["jump_mm"] < 0.05
    assert all(figure["same"] for figure in row["settled"].values())
    assert row["settled"]["contact_force_max_N"]["theirs"][1] > 1000.0
    assert [change["noticed"] for change in content["changes"]] == [True, True]
    assert content["summary"]["calm_within_nm"] == row["difference_nm"]
    assert (tmp_path / "outside_judges.json").is_file()


def test_every_change_changes_what_the_judge_is_given():
    scene = load_scene(outside_judges.CHANGED)
    lift = camopt.polydyne(scene)
    assert len(CHANGES) == 10
    for change in CHANGES:
        moved = np.abs(change.cam(lift).coefficients - lift.coefficients).max() > 0
        assert moved + (change.scene(scene) != scene) + (change.law != CHANGES[0].law) == 1, change.name


def test_figures_beside_each_other():
    theirs = [{"jump_mm": 0.10}, {"jump_mm": 0.1004}]
    assert outside_judges._beside("jump_mm", (0.1, 0.1), 0.0, theirs, True)["same"]
    assert not outside_judges._beside("jump_mm", (0.1, 0.102), 0.0, theirs, True)["same"]
    assert not outside_judges._beside("jump_mm", (0.2, 0.3), 0.0, theirs, False)["same"]
    assert not outside_judges._beside("jump_mm", (0.1, 0.1), 0.0, [{"jump_mm": None}], True)["same"]
