"""Searches from every start: the small size, starts that are what they say, and what is told of a start that fails."""

import numpy as np
import pytest

from camopt.measure.limits import broken_by_shape
from camopt.optimizer.accuracy import ACCURACIES
from camopt.scene import load_scene
from experiments import starts


def test_every_start_leads_to_the_same_cam_at_small_size(tmp_path):
    content = starts.main("small", tmp_path)
    rows = content["rows"]
    assert {row["start"] for row in rows} == set(starts.STARTS["small"])
    assert {row["verdict"] for row in rows} == {"confirmed"}
    areas = [row["area_ratio"] for row in rows]
    np.testing.assert_allclose(areas, areas[0], rtol=1e-3)  # SETTLED_GAIN, to which a first stage settles
    assert min(areas) > starts.BEFORE["motori-1"]
    for row in rows:
        assert len(row["course"]) == row["rounds"] > row["jacobians"] > 0 and row["search_s"] > 0.0
    found = content["scenes"]["motori-1"]["exact"]
    assert (found["least"], found["largest"], found["confirmed"]) == (min(areas), max(areas), len(rows))
    again = starts.main("small", tmp_path)["rows"]
    assert [row["search_s"] for row in again] == [row["search_s"] for row in rows], "kept rows are not computed again"


def test_random_cams_hold_the_shape_and_differ():
    scene = load_scene("motori-1")
    cams = [starts.start_cam(scene, name, ACCURACIES["draft"]) for name in starts.RANDOM]
    assert not any(broken_by_shape(cam, scene.design) for cam in cams)
    angles = np.linspace(-1.0, 1.0, 101) * cams[0].half_duration
    apart = np.abs(cams[0](angles) - cams[1](angles)).max()
    assert apart > 0.1e-3, "a tenth of a millimetre"
    assert max(cam.area_ratio_in(scene.design) for cam in cams) < 0.5


def test_a_start_without_a_cam_leaves_its_sentence(monkeypatch):
    def refused(scene):
        raise starts.InputError("no such cam")

    monkeypatch.setitem(starts.FAMILIES, "Polydyne", refused)
    row = starts.searched("motori-1", "Polydyne", "exact")
    assert row == {"area_ratio": None, "verdict": None, "why": "no such cam"}
    rows = [row | {"scene": "motori-1", "start": "Polydyne", "gradient": "exact"}]
    found = starts.summary("motori-1", rows)["exact"]
    assert (found["tried"], found["confirmed"], found["least"]) == (1, 0, None)


def test_the_figure_leaves_out_what_has_no_cam():
    row = {"scene": "kodama", "start": "calmest", "gradient": "exact"}
    held = row | {"area_ratio": 0.5, "rounds": 2, "course": [0.4, 0.5]}
    none = row | {"start": "Polydyne", "area_ratio": None}
    (axes,) = starts.figure([held, none]).axes
    assert [line.get_label() for line in axes.lines if line.get_label()[0] != "_"] == ["from calmest, exact"]
    assert axes.lines[0].get_xydata().tolist() == pytest.approx(np.array([[1, 0.4], [2, 0.5]]))
