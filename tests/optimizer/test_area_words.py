"""No area ratio beyond what is possible passes without a word."""

from dataclasses import replace

import pytest

from camopt.cam.design_file import write_design
from camopt.cam.families.polydyne import polydyne
from camopt.cli.parser import main
from camopt.optimizer.bound.certificate import area_words
from camopt.scene import load_scene
from camopt.scene.units import DEG, MM

SCENE = load_scene("kodama")


def of_duration(degrees):
    """The Polydyne of another duration."""
    return polydyne(SCENE.model_copy(update={"design": SCENE.design.model_copy(update={"duration_deg": degrees})}))


def test_a_cam_of_the_scene_needs_no_word():
    assert area_words(polydyne(SCENE), SCENE.design) == []


@pytest.mark.parametrize("claim", [144.0, 200.0])
def test_a_longer_cam_exceeds_the_certified_bound_and_it_is_said(claim):
    """An event of 200 deg had 0.739 where the bound is 0.618, and was confirmed."""
    longer = replace(of_duration(200.0), half_duration=claim * DEG / 2)
    first, second = area_words(longer, SCENE.design)
    assert "longer than the 144 deg of the scene" in first
    assert "exceeds the certified bound of 0.61" in second and "breaks duration_deg" in second


def test_a_ratio_above_one_is_said():
    raised = replace(of_duration(200.0), coefficients=2 * of_duration(200.0).coefficients)
    assert any("exceeds one: the lift exceeds max_lift_mm = 9.4" in said for said in area_words(raised, SCENE.design))


def test_the_command_says_it(tmp_path, capsys):
    write_design(tmp_path / "short.json", of_duration(118.0), 9.4 * MM)
    assert main(["cam", "kodama", "--cam", str(tmp_path / "short.json")]) == 0
    out = capsys.readouterr().out
    assert "note: the cam's duration of 118 deg is shorter than the 144 deg of the scene" in out
    assert f"area ratio {of_duration(118.0).area_ratio_in(SCENE.design):.6f}" in out
