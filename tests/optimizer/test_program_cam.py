"""Where limits that are not linear are taken: centres of durations, sign changes of the jerk, radii near a cam."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.cam.families.shape_rows import cells
from camopt.cam.geometry import sign_changes
from camopt.highs import Infeasible
from camopt.optimizer.program import program_cam as module
from camopt.optimizer.program.kinematic import first_working, kinematic_optimum, spline_rows
from camopt.optimizer.program.linear_program import least_relaxation
from camopt.optimizer.program.no_jump import NoCamHoldsContact, no_jump_program
from camopt.optimizer.program.program_cam import (
    WIDTHS,
    _converged_radii,
    _pattern_search,
    _without_ripples,
    centres,
    kinematic_switches,
    near,
    with_radii,
)
from camopt.scene import build_train, load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.train import TRAIN_PARAMETERS
from camopt.scene.units import MM_PER_DEG3

KODAMA = load_scene("kodama")
DESIGN = KODAMA.design
TWO = DESIGN.model_copy(update={"duration_at": ((1.0, 90.0, 140.0), (4.0, 60.0, 100.0))})


@pytest.mark.parametrize("top", [(3.0, -4.0), (-5.2, 7.7)])
def test_two_rounds_leave_a_sixteenth_of_what_pulls_the_centres_together(monkeypatch, top):
    """The area falls by p^2 + q^2 + p q with the distances p and q from its top: each round moves p to -q / 2, and then
    q to -p / 2."""

    def known(design, cam, explain):
        p, q = np.degrees(cam.about.centres) - top
        return SimpleNamespace(optimum=SimpleNamespace(value=-(p**2 + q**2 + p * q)))

    monkeypatch.setattr(module, "kinematic_optimum", known)
    q = -top[1]
    expected = top[0] - q / 8, top[1] + q / 16
    assert np.degrees(centres(TWO)) == pytest.approx(expected, abs=2 * module.RESOLUTION_DEG)


FEW = DESIGN.model_copy(update={"waves_max": 3})
CAM = free_cam(DESIGN, 8.0)
MARKS = np.linspace(0.0, 10.0, 101)


@pytest.mark.parametrize("away", [-17, -5, -2, -1, 0, 1, 2, 5, 17])
def test_angles_climb_to_the_top_of_a_hill_from_either_side(away):
    top = MARKS[[30, 60]]
    found = _pattern_search(
        lambda at: -float(np.sum((np.array(at) - top) ** 2)), tuple(MARKS[[30 + away, 60 - away]]), MARKS
    )
    assert found == pytest.approx(tuple(top))


def test_angles_that_would_meet_stay_a_cell_apart_and_within_the_marks():
    found = _pattern_search(lambda at: -float(np.sum((np.array(at) - 5.0) ** 2)), (2.0, 8.0), MARKS)
    assert np.diff(found) == pytest.approx(0.1)
    assert _pattern_search(lambda at: at[0], (8.0,), MARKS) == pytest.approx((9.9,))


def test_the_smallest_ripple_goes_first():
    lift = kinematic_optimum(DESIGN, CAM).lift
    angles = sign_changes(lift)
    assert len(angles) == 5
    ripples = {pair: abs(float(lift(pair[1], 2) - lift(pair[0], 2))) for pair in pairwise(angles)}
    gone = min(ripples, key=lambda pair: ripples[pair])
    nearest = cells(CAM)[[np.argmin(np.abs(cells(CAM) - angle)) for angle in angles if angle not in gone]]
    assert _without_ripples(lift, CAM, 3) == pytest.approx(tuple(nearest))
    assert len(_without_ripples(lift, CAM, 5)) == 5


def test_changes_at_the_ends_move_a_cell_inwards(monkeypatch):
    monkeypatch.setattr(module, "sign_changes", lambda lift: cells(CAM)[[0, 5, -1]])
    assert _without_ripples(None, CAM, 3) == pytest.approx(tuple(cells(CAM)[[1, 5, -2]]))


def test_no_angle_of_the_search_is_better_a_cell_away():
    def area(switches):
        try:
            cam = replace(CAM, about=replace(CAM.about, switches=switches))
            return kinematic_optimum(FEW, cam, explain=False).area_ratio
        except Infeasible:
            return -np.inf

    found, cell = kinematic_switches(FEW, CAM), np.diff(cells(CAM))[0]
    reached = area(found)
    assert 0.9 < reached / kinematic_optimum(DESIGN, CAM).area_ratio < 1.0
    for i in range(len(found)):
        for way in (-cell, cell):
            assert area((*found[:i], found[i] + way, *found[i + 1 :])) < reached + 1e-5


def test_where_no_cam_has_so_few_changes_the_jerk_is_least_wrong():
    """A rise and a return ask for three changes; with one, the angle is where the least jerk has the wrong sign."""
    one = DESIGN.model_copy(update={"waves_max": 1})

    def wrong(angle):
        limits = replace(CAM, about=replace(CAM.about, switches=(angle,))).limits(one)
        give = np.zeros(len(limits.bound))
        give[limits.rows("waves_max")] = 1.0
        return least_relaxation(
            spline_rows(limits.matrix), limits.bound, give, 1e-3 * MM_PER_DEG3, first_working(limits)
        )

    (found,), marks = kinematic_switches(one, CAM), cells(CAM)
    at = int(np.argmin(np.abs(marks - found)))
    assert wrong(found) > 0.0
    for other in (at - 12, at - 1, at + 1, at + 12):
        if 0 < other < len(marks) - 1:
            assert wrong(found) <= wrong(marks[other])


def test_limits_that_contradict_each_other_have_no_switches():
    short = FEW.model_copy(update={"max_lift_mm": 60.0, "reach_max_lift": True})
    assert kinematic_switches(short, CAM) == ()


ROLLER = Geometry(follower="roller", base_radius_mm=18.0, roller_radius_mm=9.0)
ROLLED = DESIGN.model_copy(update={"nose_radius_min_mm": 5.0}).within(ROLLER, KODAMA.operation)


@pytest.mark.parametrize("values", [[-3.0, -2.0, -1.0, -0.5, -0.4, -0.4], [0.3, 0.4, 0.5, 0.45]])
def test_a_cam_stands_where_the_narrowest_program_gains_no_more(values):
    """A value is below zero where limits are missed by much."""
    left, z = iter(values), np.append(np.zeros(CAM.Z.shape[1]), 3.0)
    program = SimpleNamespace(solve=lambda: SimpleNamespace(z=z, value=next(left)))
    _converged_radii(lambda cam: program, CAM, CAM.lift(z[:-1]))
    assert list(left) == []


def test_a_neighbourhood_begins_at_the_widest_and_narrows_where_limits_hold():
    shares, z = [], np.zeros(CAM.Z.shape[1] + 1)
    program = SimpleNamespace(solve=lambda: SimpleNamespace(z=z, value=1.0))
    _converged_radii(lambda cam: shares.append(cam.about.near.share) or program, CAM, CAM.lift(z[:-1]))
    assert shares == sorted(WIDTHS, reverse=True)


@pytest.mark.parametrize(("margin_N", "factor"), [(0.0, 1.0), (2000.0, 1.0), (2000.0, 100.0)])
def test_a_program_is_short_by_what_no_cam_near_holds(monkeypatch, margin_N, factor):
    """A train with all its forces, masses and margins times a factor is short by as many times more."""
    train = build_train(KODAMA)
    heavy = replace(train, **{name: factor * getattr(train, name) for name in TRAIN_PARAMETERS if name != "gap"})
    free = free_cam(ROLLED, 8.0)
    cam = near(free, kinematic_optimum(DESIGN, free).lift)
    program = no_jump_program(heavy, ROLLED, cam, [KODAMA.cam_speed(5000.0)])
    looked, margin_N = [], factor * margin_N

    def narrowed(program_of, cam, lift):
        looked.append(program_of(near(cam, lift, WIDTHS[-1])))
        return near(cam, lift)

    monkeypatch.setattr(module, "_converged_radii", narrowed)
    assert with_radii(program, margin_N).cam.about.near.lift(0.0) == pytest.approx(cam.about.near.lift(0.0))
    short = looked[0].solve().z[-1]
    try:
        program.solve(margin_N)
        assert short == pytest.approx(0.0, abs=1e-6)
    except NoCamHoldsContact as refused:
        assert short == pytest.approx(refused.shortfall_N, rel=1e-3)
    assert (short > 1.0) == (margin_N > 0.0) and np.isfinite(short)
