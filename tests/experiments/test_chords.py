"""The experiment on chords at its small size: forces miss by what is predicted, and a table of one line is a spring."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare
from camopt.scene import build_train, load_scene
from camopt.scene.rest import state_at_rest
from experiments import chords


def test_the_small_size(tmp_path):
    content = chords.main("small", tmp_path)
    for rows in content["chords"].values():
        for row in rows:
            assert row["force_error_N"] == pytest.approx(row["predicted_N"], rel=2e-3)
        assert [row["chords"] for row in rows] == [8, 16]
    coarse, fine = (row["slope_off"]["dynamic_area_mm_deg"] for row in content["chords"]["kodama-hertz"])
    assert 0.0 < fine < coarse < 1e-3
    leading = 5000 / (6 * 8**2)  # what is left of it falls with a further power of the chords' number
    assert content["chords"]["kodama-hertz"][0]["predicted_N"] == pytest.approx(leading, rel=1e-3)
    assert all(0.3 < ratio < 3.0 for ratio in content["tables_over_linear"].values())
    assert (tmp_path / "chords.json").is_file()


def test_a_table_of_one_line_is_the_linear_spring():
    scene = load_scene("kodama")
    train, lift, speed = build_train(scene), polydyne(scene), scene.cam_speed(5000)
    tables = chords.by_tables(train)
    ends = [prepare(t, lift, speed).advance(state_at_rest(t)) for t in (train, tables)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-9
