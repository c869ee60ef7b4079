"""Radii under a roller or pad: a cam that would break one holds it, at every angle and by a contour of its own."""

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.cam.families.radius_planes import Neighbourhood
from camopt.cam.families.shape_rows import near_rows
from camopt.measure.limits import broken_by_shape, drawing_excess
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.bound.fine_program import left_out
from camopt.optimizer.bound.summary import no_jump_bound
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.optimizer.program.program_cam import linearised_at_best, near, program_cam
from camopt.optimizer.program.relocation import converge_tangents, relocate
from camopt.scene import InputError, load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.train import build_train
from camopt.scene.units import DEG, MM

KODAMA = load_scene("kodama")
GRID = np.arange(-110.0, 110.0005, 0.001)
SWINGING = {"pivot_mm": (-26.0, 32.0), "arm_mm": 24.0, "valve_arm_mm": 36.0, "valve_arm_deg": -8.0}
PAD = Geometry(follower="finger", base_radius_mm=18.0, pad_radius_mm=15.0, **SWINGING)
SMALL = Geometry(follower="finger", base_radius_mm=13.0, roller_radius_mm=7.0, **SWINGING | {"pivot_mm": (-26.0, 22.0)})
ROCKER = Geometry(follower="rocker", base_radius_mm=18.0, roller_radius_mm=9.0, **SWINGING)
ROLLER = Geometry(follower="roller", base_radius_mm=18.0, roller_radius_mm=9.0)
ASKED = {
    "finger with a pad": (PAD, "nose_radius_min_mm", 12.5),
    "finger with a roller": (SMALL, "concave_radius_min_mm", 60.0),
    "rocker with a roller": (ROCKER, "nose_radius_min_mm", 14.0),
    "roller, convex": (ROLLER, "nose_radius_min_mm", 11.2),
    "roller, concave": (ROLLER, "concave_radius_min_mm", 80.0),
}


def centres_mm(lift, geometry):
    """The circle's centre in the cam, from lines in the plane of complex numbers: the valve opens along the reals."""
    s = lift(GRID * DEG) / MM
    circle = geometry.roller_radius_mm or geometry.pad_radius_mm
    reach = geometry.base_radius_mm + circle
    if geometry.follower == "roller":
        return (reach + s) * np.exp(1j * GRID * DEG), circle
    pivot = geometry.pivot_mm[1] + 1j * geometry.pivot_mm[0]
    side = 1 if geometry.follower == "finger" else -1  # all pivots lie on one side of the cam
    cosine = (reach**2 + abs(pivot) ** 2 - geometry.arm_mm**2) / (2 * reach * abs(pivot))
    shut = reach * pivot / abs(pivot) * np.exp(1j * side * np.arccos(cosine))
    arm = geometry.valve_arm_deg * DEG
    swing = np.arcsin(np.sin(arm) + s / geometry.valve_arm_mm) - arm
    return (pivot + (shut - pivot) * np.exp(-1j * side * swing)) * np.exp(1j * GRID * DEG), circle


def smallest_mm(lift, geometry, key):
    """Smallest radius of the contour that the circle envelops, by differences of its centre's path."""
    centre, circle = centres_mm(lift, geometry)
    chord = np.diff(centre)
    turning = np.angle(chord[1:] / chord[:-1])
    radius = 0.5 * (np.abs(chord[1:]) + np.abs(chord[:-1])) / turning - circle
    return radius[radius > 0].min() if key.startswith("nose") else -radius[radius < 0].max(initial=-1e9)


def penetration_mm(lift, geometry):
    """By how much the circle, wherever it is, enters the contour: every place against every point of it."""
    centre, circle = centres_mm(lift, geometry)
    along = np.gradient(centre)
    contour = centre + 1j * circle * along / np.abs(along)  # the cam lies to the left
    some = slice(None, -1, 500)
    return circle - np.abs(centre[some, None] - contour[some]).min()


@pytest.fixture(scope="module")
def free():
    return kinematic_optimum(KODAMA.design, free_cam(KODAMA.design, 3.0))


@pytest.mark.parametrize("what", ASKED)
def test_a_radius_holds_at_every_angle_and_would_be_broken_without(free, what):
    geometry, key, least = ASKED[what]
    design = KODAMA.design.model_copy(update={key: least}).within(geometry, KODAMA.operation)
    held = kinematic_optimum(design, program_cam(design, 3.0))
    assert smallest_mm(free.lift, geometry, key) < 0.95 * least
    assert broken_by_shape(free.lift, design) == [key]
    assert smallest_mm(held.lift, geometry, key) == pytest.approx(least, rel=2e-3)
    assert smallest_mm(held.lift, geometry, key) > least * (1 - 1e-5)  # round-off of the differences
    assert broken_by_shape(held.lift, design) == []
    assert abs(penetration_mm(held.lift, geometry)) < 1e-3
    assert held.area_ratio < free.area_ratio < area_ratio_bound(design).bound
    assert left_out(design) == [key]
    assert held.sensitivities[key] < 0


def test_a_cam_is_not_held_back_by_its_neighbourhood(free):
    """Solved again near its own cam, however wide, the program gains nothing."""
    geometry, key, least = ASKED["finger with a pad"]
    design = KODAMA.design.model_copy(update={key: least}).within(geometry, KODAMA.operation)
    cam = program_cam(design, 3.0)
    held = kinematic_optimum(design, cam)
    for share in (1 / 8, 1 / 16, 1 / 64):
        again = kinematic_optimum(design, near(cam, held.lift, share))
        assert again.area_ratio == pytest.approx(held.area_ratio, abs=3e-4)
        assert drawing_excess(again.lift, design)[key] <= 0


def test_whatever_is_within_the_rows_holds_the_radius(free):
    """Cams drawn on the border of the rows, where these are much stricter than the radius too."""
    geometry, key, least = ASKED["finger with a pad"]
    design = KODAMA.design.model_copy(update={key: least}).within(geometry, KODAMA.operation)
    cam, generator = program_cam(design, 4.0), np.random.default_rng(3)
    rows = list(near_rows(cam, design, Neighbourhood(cam.about.near.lift, 1 / 8)))
    matrix, bound = np.concatenate([r.matrix for r in rows]), np.concatenate([r.bound for r in rows])
    inner = kinematic_optimum(design, near(cam, cam.about.near.lift, 1 / 8)).z
    for way in generator.normal(size=(30, len(inner))):
        room, rate = bound - matrix @ inner, matrix @ way
        farthest = (np.maximum(room, 0.0)[rate > 1e-9] / rate[rate > 1e-9]).min()
        assert drawing_excess(cam.lift(inner + farthest * way), design)[key] <= 0


def test_the_no_jump_program_holds_it_near_its_own_cam():
    geometry, key, least = ASKED["finger with a pad"]
    design = KODAMA.design.model_copy(update={key: least}).within(geometry, KODAMA.operation)
    train, speeds = build_train(KODAMA), [KODAMA.cam_speed(6000.0)]
    program = converge_tangents(no_jump_program(train, design, program_cam(design, 4.0), speeds))
    held = program.solve(20.0)
    without = no_jump_program(train, KODAMA.design, free_cam(KODAMA.design, 4.0), speeds).solve(20.0)
    assert broken_by_shape(without.lift, design) == [key] and broken_by_shape(held.lift, design) == []
    moved = relocate(program, held.lift)
    assert moved.cam.about.near.lift(GRID * DEG) == pytest.approx(held.lift(GRID * DEG))
    assert 0 < without.area_ratio - held.area_ratio < 0.02
    assert held.area_ratio < no_jump_bound(program, 20.0).bound


def test_radii_that_no_cam_has_contradict_and_say_by_how_much():
    design = KODAMA.design.model_copy(update={"nose_radius_min_mm": 17.5, "reach_max_lift": True})
    with pytest.raises(InputError, match=r"nose_radius_min_mm would have to fall from 17\.5 to 1[0-6]"):
        kinematic_optimum(design, program_cam(design, 8.0))


def test_a_cam_that_the_finger_cannot_follow_breaks_the_radius(free):
    short = PAD.model_copy(update={"valve_arm_mm": 8.0})
    design = KODAMA.design.model_copy(update={"nose_radius_min_mm": 5.0}).within(short, KODAMA.operation)
    assert broken_by_shape(free.lift, design) == ["nose_radius_min_mm"]


def test_limits_that_contradict_each_other_leave_the_cam_as_it_is():
    geometry, key, least = ASKED["roller, concave"]
    short = KODAMA.design.model_copy(update={key: least, "max_lift_mm": 60.0, "reach_max_lift": True})
    design = short.within(geometry, KODAMA.operation)
    cam = free_cam(design, 8.0)
    assert linearised_at_best(design, cam) is cam
