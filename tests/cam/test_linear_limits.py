"""The limits of an engineer's drawing: a cam that would break one without it holds it with it, at every angle."""

import re
from pathlib import Path
from time import process_time

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.cam.linear_limits import largest_fourth_derivative, linear_limits, piston_drop, piston_room
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.bound.fine_program import left_out
from camopt.optimizer.bound.summary import no_jump_bound
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.optimizer.program.program_cam import centres, program_cam
from camopt.scene import InputError, load_scene
from camopt.scene.design import Piston
from camopt.scene.geometry import Geometry
from camopt.scene.train import build_train
from camopt.scene.units import DEG, MM
from tests.cam.cams import KODAMA, with_design

FLAT = Geometry(follower="flat", base_radius_mm=18.0)
PISTON = Piston(
    stroke_mm=86.0, rod_mm=143.0, gap_at_top_mm=2.5, clearance_mm=1.0, lobe_centre_deg=108.0, pin_offset_mm=0.8,
    valve_angle_deg=14.0,
)  # fmt: skip
GRID = np.arange(-72.0, 72.0005, 0.001)


def scene_with(geometry=FLAT, **limits):
    return with_design(geometry, **limits)


def mm(lift, order):
    """The lift's derivative by degrees at GRID [mm/deg^order]."""
    return lift(GRID * DEG, order) / MM * DEG**order


def radius_mm(lift):
    """Radius of curvature from the contour's own tangent, by differences: R + s along the axis, s' across it."""
    theta, s, v = GRID * DEG, mm(lift, 0) + 18.0, mm(lift, 1) / DEG
    point = (s + 1j * v) * np.exp(1j * theta)
    chord = np.diff(point)
    turning = np.angle(chord[1:] / chord[:-1])
    return 0.5 * (np.abs(chord[1:]) + np.abs(chord[:-1])) / turning


def entrainment_m_per_s(lift):
    """Mean velocity of both surfaces past the contact: the cam's turns with it, the contact wanders on the face."""
    slowest = KODAMA.cam_speed(5000.0)
    wander = np.gradient(mm(lift, 1) / DEG, GRID * DEG)  # of the contact on the face
    cam, follower = 18.0 + mm(lift, 0) + wander, wander
    return slowest * (cam + follower) / 2 * MM


def piston_gap_mm(lift):
    """Distance of valve and piston along the valve's axis, the piston from the triangle of crank and rod."""
    r, rod, e = 43.0, 143.0, 0.8
    phi = (108.0 + 2.0 * GRID) * DEG + np.arcsin(e / (rod + r))
    pin = r * np.cos(phi) + np.sqrt(rod**2 - (r * np.sin(phi) - e) ** 2)
    top = np.sqrt((r + rod) ** 2 - e**2)
    return 2.5 + (top - pin) * np.cos(14.0 * DEG) - mm(lift, 0)


def duration_deg(lift, height_mm):
    above = GRID[mm(lift, 0) >= height_mm]
    return above[-1] - above[0]


WIDE = FLAT.model_copy(update={"face_width_mm": 25.0})
LIMITS = {
    "nose_radius_min_mm": (scene_with(nose_radius_min_mm=6.0), lambda s: radius_mm(s).min(), 6.0, 1e-2),
    "face_width_mm": (scene_with(WIDE), lambda s: -2 * np.abs(mm(s, 1) / DEG).max(), -25.0, 1e-4),
    "entrainment_min_m_per_s": (
        scene_with(entrainment_min_m_per_s=0.3), lambda s: np.abs(entrainment_m_per_s(s)).min(), 0.3, 1e-3,
    ),
    "lift_at": (scene_with(lift_at=((-54.0, 0.0, 1.5),)), lambda s: -mm(s, 0)[18000], -1.5, 1e-6),
    "piston": (scene_with(piston=PISTON), lambda s: piston_gap_mm(s).min(), 1.0, 1e-3),
    "duration_at": (
        scene_with(duration_at=((5.0, 0.0, 80.0),)), lambda s: -duration_deg(s, 5.0), -80.0, 2.1e-3,
    ),
}  # fmt: skip


@pytest.mark.parametrize("key", LIMITS)
def test_a_limit_holds_at_every_angle_and_would_be_broken_without(key):
    scene, measured, least, error = LIMITS[key]
    free = kinematic_optimum(KODAMA.design, free_cam(KODAMA.design, 2.0))
    held = kinematic_optimum(scene.design, program_cam(scene.design, 2.0))
    assert measured(free.lift) < least - 10 * error
    assert broken_by_shape(free.lift, scene.design) == [key]
    assert measured(held.lift) == pytest.approx(least, abs=error)
    assert broken_by_shape(held.lift, scene.design) == []
    bound = area_ratio_bound(scene.design).bound
    assert held.area_ratio < bound
    if key != "duration_at":
        assert held.area_ratio < free.area_ratio < area_ratio_bound(KODAMA.design).bound
        assert bound - held.area_ratio < 0.01
        assert bound < free.area_ratio  # so that the bound counts on the limit


ROLLER = Geometry(follower="roller", base_radius_mm=18.0, roller_radius_mm=9.0)


def cam_radii_mm(lift):
    """Signed radii of the cam under a roller of 9 mm, by differences of the path of its centre."""
    path = (27.0 + mm(lift, 0)) * np.exp(1j * GRID * DEG)
    chord = np.diff(path)
    turning = np.angle(chord[1:] / chord[:-1])
    return 0.5 * (np.abs(chord[1:]) + np.abs(chord[:-1])) / turning - 9.0


@pytest.mark.parametrize(
    ("key", "least", "side"), [("nose_radius_min_mm", 11.2, 1), ("concave_radius_min_mm", 80.0, -1)]
)
def test_linear_limits_hold_radii_under_a_roller_to_the_safe_side(key, least, side):
    """The linear limits are stricter than the radii: at most by a tenth of the radius here."""

    def smallest(lift):
        radii = side * cam_radii_mm(lift)
        return radii[radii > 0].min(initial=1e9)

    free = kinematic_optimum(KODAMA.design, free_cam(KODAMA.design, 2.0))
    scene = scene_with(ROLLER, **{key: least})
    held = kinematic_optimum(scene.design, free_cam(scene.design, 2.0))  # not near a cam
    assert smallest(free.lift) < 0.95 * least
    assert broken_by_shape(free.lift, scene.design) == [key]
    assert least < smallest(held.lift) < 1.1 * least
    assert broken_by_shape(held.lift, scene.design) == []
    near = kinematic_optimum(scene.design, program_cam(scene.design, 2.0))
    assert held.area_ratio + 0.003 < near.area_ratio < free.area_ratio < area_ratio_bound(scene.design).bound
    assert left_out(scene.design) == [key]


@pytest.mark.parametrize(
    ("geometry", "limits", "says"),
    [
        (ROLLER, {"concave_radius_min_mm": 9.0}, "must exceed roller_radius_mm = 9"),
        (ROLLER, {"nose_radius_min_mm": 18.1}, "must be at most base_radius_mm = 18"),
        (FLAT, {"concave_radius_min_mm": 50.0}, "is for roller, finger and rocker followers, and that of"),
        (None, {"concave_radius_min_mm": 50.0}, "needs .geometry."),
    ],
)
def test_radii_that_a_follower_cannot_be_held_to(geometry, limits, says):
    (fault,) = scene_with(geometry, **limits).design.missing()
    assert re.search(says, fault)


def test_a_least_duration_and_a_least_lift_are_held():
    """A cam that is to be short at 5 mm and still long at 2 mm, and high away from the middle."""
    short = (5.0, 0.0, 80.0)
    narrow = scene_with(duration_at=(short,)).design
    free = kinematic_optimum(narrow, free_cam(narrow, 3.0)).lift
    asked, high = duration_deg(free, 2.0) + 0.5, mm(free, 0)[102_000]
    longer = scene_with(duration_at=(short, (2.0, asked, 143.0))).design
    held = kinematic_optimum(longer, free_cam(longer, 3.0)).lift
    assert broken_by_shape(free, longer) == ["duration_at"]
    assert broken_by_shape(held, longer) == []
    assert duration_deg(held, 2.0) == pytest.approx(asked, abs=2.1e-3)
    higher = scene_with(duration_at=(short,), lift_at=((30.0, high + 0.02, 9.4),)).design
    assert broken_by_shape(free, higher) == ["lift_at"]
    assert broken_by_shape(kinematic_optimum(higher, free_cam(higher, 3.0)).lift, higher) == []


def test_a_duration_of_unequal_flanks_is_held_about_its_own_centre():
    skew = scene_with(duration_at=((5.0, 0.0, 80.0),), lift_at=((-40.0, 0.0, 4.0),))
    (centre,) = centres(skew.design)
    assert centre > 1.0 * DEG
    held = kinematic_optimum(skew.design, program_cam(skew.design, 2.0))
    middle = kinematic_optimum(skew.design, free_cam(skew.design, 2.0))
    assert held.area_ratio > middle.area_ratio + 1e-3
    assert broken_by_shape(held.lift, skew.design) == []
    assert duration_deg(held.lift, 5.0) < 80.002


def nearer(gap_mm, lobe_deg):
    return PISTON.model_copy(update={"gap_at_top_mm": gap_mm, "lobe_centre_deg": lobe_deg})


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        ({"lift_at": ((-55.0, 4.0, 5.5),)}, "lift_at's least lift at -55 deg would have to fall from 4 to "),
        ({"nose_radius_min_mm": 26.0}, "nose_radius_min_mm would have to fall from 26 to "),
        ({"duration_at": ((5.0, 100.0, 130.0),)}, "50 deg can reach only 3.25 mm, not 5 mm"),
        ({"piston": nearer(1.3, 100.0)}, "piston.clearance_mm would have to fall from 1 "),
        ({"piston": nearer(1.1, 150.0), "reach_max_lift": False}, "piston.clearance_mm would have to fall from 1"),
    ],
)
def test_contradictions_say_by_how_much(limits, says):
    """The last piston meets the ramp, which is refused before any search."""
    design = scene_with(**{"reach_max_lift": True} | limits).design
    with pytest.raises(InputError, match=says.replace(".", r"\.")):
        kinematic_optimum(design, program_cam(design, 3.0))


def test_the_piston_is_lowest_half_a_turn_on_and_its_pieces_lie_within_their_error():
    assert piston_drop(PISTON, np.array([0.0])) == pytest.approx(0.0, abs=1e-15)
    centric = PISTON.model_copy(update={"pin_offset_mm": 0.0})
    assert piston_drop(centric, np.array([np.pi])) == pytest.approx(86.0 * MM)
    room, theta = piston_room(PISTON, 0.5, np.pi), np.linspace(-np.pi, np.pi, 100_001)[1:-1]
    pieces = room.taylor(theta, theta)[:, 0]
    true = 1.5 * MM + np.cos(14 * DEG) * piston_drop(PISTON, 108 * DEG + 2 * theta)
    assert 0 < np.abs(pieces - true).max() < room.error < 1e-8
    crank = np.linspace(0, 2 * np.pi, 20_001)
    h = crank[1]
    fourth = np.diff(piston_drop(PISTON, crank, 1)[::100], 3) / (100 * h) ** 3
    assert 0.3 * largest_fourth_derivative(PISTON) < np.abs(fourth).max() < largest_fourth_derivative(PISTON)


def test_rocker_ratio_turns_valve_lift_into_follower_lift():
    (limit,) = linear_limits(scene_with(FLAT.model_copy(update={"rocker_ratio": 1.5}), nose_radius_min_mm=6.0).design)
    lift = free_cam(KODAMA.design, 3.0).lift(np.zeros(47))
    smallest = (18.0 + (mm(lift, 0) + mm(lift, 2) / DEG**2) / 1.5).min()
    assert limit.excess(lift) / MM == pytest.approx(6.0 - smallest, abs=1e-5)


@pytest.mark.long
def test_the_no_jump_program_and_its_bound_hold_the_limits_too():
    scene = scene_with(nose_radius_min_mm=6.0, piston=PISTON)
    train, speeds = build_train(scene), [scene.cam_speed(6000.0)]
    program = no_jump_program(train, scene.design, program_cam(scene.design, 3.0), speeds)
    held = program.solve(20.0)
    free = no_jump_program(train, KODAMA.design, free_cam(KODAMA.design, 3.0), speeds).solve(20.0)
    assert broken_by_shape(free.lift, scene.design) == ["piston", "nose_radius_min_mm"]
    assert broken_by_shape(held.lift, scene.design) == []
    bound = float(no_jump_bound(program, 20.0).bound)
    assert held.area_ratio < bound < area_ratio_bound(scene.design).bound
    assert bound < free.area_ratio


def test_a_contradiction_with_a_lift_that_must_be_reached_is_named_within_seconds():
    """Proving that a program has no solution took the solver a minute; how far it is from one takes it none."""
    scene = load_scene(Path(__file__).parents[2] / "docs" / "tutorials" / "tappet.toml")
    design = scene.design.model_copy(update={"lift_at": ((-42.0, 0.0, 1.6),), "reach_max_lift": True})
    cam, begun = free_cam(design, 3.0), process_time()
    with pytest.raises(
        InputError, match=r"max_lift_mm would have to fall.*lift_at's largest lift at -42 deg would have"
    ):
        kinematic_optimum(design, cam)
    assert process_time() - begun < 5.0
