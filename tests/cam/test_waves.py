"""Ripples of the acceleration: counted from the pieces, held by the programs at every angle, and what that costs."""

import numpy as np
import pytest
from pydantic import ValidationError

from camopt import multi_pol, polydyne
from camopt.cam.families.free import free_cam
from camopt.cam.geometry import sign_changes
from camopt.cam.lift import Lift
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.bound.fine_program import left_out
from camopt.optimizer.program.kinematic import conflict, kinematic_optimum
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.optimizer.program.program_cam import program_cam, with_switches
from camopt.scene.design import Design
from camopt.scene.train import build_train
from camopt.scene.units import DEG
from tests.cam.cams import KODAMA


def counted(lift):
    """Sign changes of the jerk by differences of the acceleration on a grid of 0.001 deg, below rounding none."""
    half = lift.half_duration - 0.0005 * DEG
    jerk = np.diff(lift(np.arange(-half, half, 0.001 * DEG), 2))
    sign = np.sign(jerk[np.abs(jerk) > 1e-5 * np.abs(jerk).max()])
    return int(np.count_nonzero(np.diff(sign)))


def limited(most):
    return KODAMA.design.model_copy(update={"waves_max": most})


def test_a_cam_with_few_waves_keeps_the_limit_and_one_without_the_limit_breaks_it():
    plain = kinematic_optimum(limited(3), program_cam(limited(3), 3.0))
    rippled = kinematic_optimum(KODAMA.design, free_cam(KODAMA.design, 3.0))
    assert counted(plain.lift) == len(sign_changes(plain.lift)) == 3
    assert broken_by_shape(plain.lift, limited(3)) == []
    assert broken_by_shape(rippled.lift, limited(3)) == ["waves_max"]
    assert counted(rippled.lift) == len(sign_changes(rippled.lift)) == 5
    assert 0.94 * rippled.area_ratio < plain.area_ratio < rippled.area_ratio
    assert left_out(limited(3)) == ["waves_max"]
    assert plain.area_ratio < area_ratio_bound(limited(3), 360).bound


@pytest.mark.parametrize("knot_deg", [6.0, pytest.param(3.0, marks=pytest.mark.long)])
def test_the_no_jump_program_keeps_it_too_and_loses_little(knot_deg):
    train, speeds = build_train(KODAMA), [KODAMA.cam_speed(6000.0)]
    free = no_jump_program(train, KODAMA.design, free_cam(KODAMA.design, knot_deg), speeds).solve(0.0)
    few = no_jump_program(train, limited(5), program_cam(limited(5), knot_deg), speeds)
    held = with_switches(few, 0.0).solve(0.0)
    assert len(sign_changes(free.lift)) >= 9
    assert counted(held.lift) == len(sign_changes(held.lift)) == 5
    assert broken_by_shape(held.lift, limited(5)) == []
    assert 0.98 * free.area_ratio < held.area_ratio <= free.area_ratio


@pytest.mark.parametrize(
    "lift",
    [polydyne(KODAMA, exponents=(2, 10, 18, 26, 34), design_speed_rpm=6000.0), multi_pol(KODAMA)],
    ids=["polydyne", "multi-pol"],
)
def test_the_count_of_a_familys_member_is_that_of_a_fine_grid(lift):
    assert len(sign_changes(lift)) == counted(lift)


def test_a_step_of_the_acceleration_is_a_jerk_beyond_all_others():
    """A constant positive acceleration, then a constant negative one, and the way back: jerk only at the steps."""
    edges = np.array([-np.pi, -0.4, -0.2, 0.2, 0.4, np.pi])
    pieces = np.array([[0, 0, 0], [0, 0, 1.0], [0.04, 0.4, -1.0], [0.04, -0.4, 1.0], [0, 0, 0]], dtype=float)
    assert sign_changes(Lift(edges, pieces, 0.5)) == pytest.approx([-0.3, 0.0, 0.3], abs=0.11)


def test_a_count_that_no_cam_keeps_is_refused_and_a_contradiction_names_it():
    with pytest.raises(ValidationError, match="greater than or equal to 3"):
        Design.model_validate(KODAMA.design.model_dump() | {"waves_max": 2})
    design = limited(3).model_copy(update={"reach_max_lift": True})
    assert "waves_max would have to be larger than 3 or be left out" in conflict(design, program_cam(limited(3), 4.0))
