"""The campaign on scenes in which a plain cam holds: what is drawn, what counts as a loss, and one scene of it."""

import numpy as np
import pytest
import tomli_w

from camopt.cam.read import read_cam
from camopt.exact import prepare
from camopt.measure.sweep import at_speeds
from camopt.scene import load_scene, parse_scene
from experiments import never_nothing
from experiments.never_nothing import SCENES, counted, is_loss
from experiments.support.drawn_designs import drawn_design, scaled


def test_the_small_size_ends_confirmed_with_what_a_family_holds_and_goes_on_where_it_was(tmp_path, monkeypatch):
    content = never_nothing.main("small", tmp_path)
    assert content["scenes"] == len(SCENES["small"]) and content["exit_codes"] == {"0": 1}
    assert content["losses"] == [] and content["a_family_holds"] == content["confirmed"] == 1
    (row,) = content["rows"]
    assert row["best_family"] == "kurz" and row["bound"] > row["area_ratio"] >= row["family_area_ratio"] - 1e-9
    monkeypatch.setattr(never_nothing, "optimised", None)  # the row is in the store
    assert never_nothing.main("small", tmp_path)["rows"] == content["rows"]


@pytest.mark.parametrize("name", ["finger-hydraulic", "race-nested", "exhaust-gas"])
def test_a_scaled_train_moves_as_before_in_its_own_scale(name):
    """Masses, lengths and speeds that grow together change no motion but its scale."""
    before, data = load_scene(name), load_scene(name).model_dump(exclude_none=True, mode="json")
    for key in ("tolerance", "grinding", "geometry"):
        data.pop(key, None)
    after = scaled(data, np.random.default_rng(3))
    length = after["design"]["max_lift_mm"] / before.design.max_lift_mm
    grown = parse_scene(tomli_w.dumps(after), name, ("design",))
    assert abs(np.log(length)) > 0.5 and grown.operation.speeds_rpm != before.operation.speeds_rpm
    figures = []
    for scene in (before, grown):
        cam = read_cam("multi-pol", scene)
        assert cam.area_ratio_in(scene.design) == pytest.approx(0.6, abs=0.1)
        figures.append(at_speeds(prepare, scene, read_cam("polydyne", scene), scene.operation.speeds_rpm[:1])[0])
    speed = grown.operation.speeds_rpm[0] / before.operation.speeds_rpm[0]
    for key, factor in (("jump_mm", length), ("bounce_mm", length), ("seating_velocity_m_per_s", length * speed)):
        assert figures[1][key] == pytest.approx(factor * figures[0][key], rel=1e-3, abs=1e-4 * factor)


def test_the_drawn_scenes_are_of_every_kind_and_repeat():
    scenes = [drawn_design(number) for number in range(40)]
    assert drawn_design(7) == scenes[7]
    lifts = [scene.design.max_lift_mm for scene in scenes]
    assert min(lifts) < 2 and max(lifts) > 40 and max(max(s.operation.band_rpm) for s in scenes) > 10_000
    assert any(s.design.closing_ramp_height_mm for s in scenes) and any(s.operation.cam_per_crank == 1 for s in scenes)
    forms = {e.form for scene in scenes for e in scene.element}
    assert forms == {"linear", "hertz", "progressive", "table", "adjuster", "friction"}
    assert any(scene.force for scene in scenes)


def row(**told):
    usual = {"best_family": "kurz", "family_area_ratio": 0.5, "verdict": "confirmed", "area_ratio": 0.5,
             "delivered_family": "kurz", "exit_code": 0}  # fmt: skip
    return usual | told


def test_a_loss_is_what_a_family_holds_and_the_command_does_not():
    lost = [row(verdict="rejected", exit_code=3), row(area_ratio=0.49), row(verdict=None, area_ratio=None, exit_code=3)]
    none = [row(), row(area_ratio=0.6, delivered_family="free"), row(best_family=None, verdict=None, exit_code=3)]
    assert all(map(is_loss, lost)) and not any(map(is_loss, none))
    found = counted(lost + none)
    assert found["losses"] == lost and found["exit_codes"] == {"0": 3, "3": 3}
    assert (found["a_family_holds"], found["confirmed"], found["neither"]) == (5, 3, 1)
    assert (found["by_the_search"], found["by_a_family"]) == (1, 2)
