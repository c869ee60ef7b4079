"""How far a program near a cam is short of its margins, as the search for that cam reads it."""

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.optimizer.program import program_cam
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import NoCamHoldsContact, no_jump_program
from camopt.optimizer.program.program_cam import WIDTHS, near, with_radii
from camopt.scene import load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.train import build_train

KODAMA = load_scene("kodama")
ROLLER = Geometry(follower="roller", base_radius_mm=18.0, roller_radius_mm=9.0)
DESIGN = KODAMA.design.model_copy(update={"nose_radius_min_mm": 5.0}).within(ROLLER, KODAMA.operation)


@pytest.mark.parametrize("margin_N", [0.0, 2000.0])
def test_a_program_is_short_by_what_no_cam_near_holds(monkeypatch, margin_N):
    free = free_cam(DESIGN, 8.0)
    cam = near(free, kinematic_optimum(KODAMA.design, free).lift)
    program = no_jump_program(build_train(KODAMA), DESIGN, cam, [KODAMA.cam_speed(5000.0)])
    looked = []

    def narrowed(program_of, cam, lift):
        looked.append(program_of(near(cam, lift, WIDTHS[-1])))
        return near(cam, lift)

    monkeypatch.setattr(program_cam, "_narrowed", narrowed)
    assert with_radii(program, margin_N).cam.about.near.lift(0.0) == pytest.approx(cam.about.near.lift(0.0))
    short = looked[0].solve().z[-1]
    try:
        program.solve(margin_N)
        assert short == pytest.approx(0.0, abs=1e-6)
    except NoCamHoldsContact as refused:
        assert short == pytest.approx(refused.shortfall_N, rel=1e-3)
    assert (short > 1.0) == (margin_N > 0.0) and np.isfinite(short)
