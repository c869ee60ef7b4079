"""Limits on the cam's shape: each judged on its own, on both sides of the extreme."""

import re
from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.measure.limits import (
    MOTION_LIMITS,
    MotionLimit,
    broken_by_shape,
    drawing_excess,
    duration_words,
    motion_limits,
    reached_by_shape,
    shape_excess,
)
from camopt.scene import load_scene
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3, MM_PER_DEG4

SCENE = load_scene("kodama")
LIFT = polydyne(SCENE)
NONE = dict.fromkeys(
    ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3", "nose_deg"), None
)


def design(**limits):
    return SCENE.design.model_copy(update={**NONE, "max_lift_mm": 20.0, **limits})


EXTREMES = {
    "max_lift_mm": LIFT.max_lift / MM,
    "acceleration_max_mm_per_deg2": LIFT.extremes(2)[1] / MM_PER_DEG2,
    "acceleration_min_mm_per_deg2": LIFT.extremes(2)[0] / MM_PER_DEG2,
    "jerk_max_mm_per_deg3": np.abs(LIFT.extremes(3)).max() / MM_PER_DEG3,
    "snap_max_mm_per_deg4": np.abs(LIFT.extremes(4, -LIFT.half_duration, LIFT.half_duration)).max() / MM_PER_DEG4,
}


@pytest.mark.parametrize("key", EXTREMES)
def test_a_limit_holds_at_its_extreme_and_breaks_beyond(key):
    assert broken_by_shape(LIFT, design(**{key: EXTREMES[key]})) == []
    assert broken_by_shape(LIFT, design(**{key: EXTREMES[key] * (1 - 1e-7)})) == [key]


def test_reaching_the_maximum_lift():
    assert broken_by_shape(LIFT, design(max_lift_mm=9.4, reach_max_lift=True)) == []
    assert broken_by_shape(LIFT, design(max_lift_mm=9.41, reach_max_lift=True)) == ["reach_max_lift"]
    assert broken_by_shape(LIFT, design(max_lift_mm=9.41)) == []


def test_no_positive_acceleration_on_the_nose():
    angle = np.linspace(0, 72, 7201) * DEG
    first = angle[np.argmax(LIFT(angle, 2) > 0)] / DEG
    assert broken_by_shape(LIFT, design(nose_deg=first - 0.02)) == []
    assert broken_by_shape(LIFT, design(nose_deg=first + 0.02)) == ["nose_deg"]
    assert broken_by_shape(raised(-30.0, 0.0, 0.02 * MM_PER_DEG2), design(nose_deg=first - 0.02)) == ["nose_deg"]


GENEROUS = {
    "jerk_max_mm_per_deg3": 1.0,
    "acceleration_max_mm_per_deg2": 1.0,
    "acceleration_min_mm_per_deg2": -1.0,
}


def raised(angle_deg, slope, bend):
    """LIFT plus a bump from `angle_deg` on: velocity `slope` [m/rad] or acceleration `bend` [m/rad^2] up, down, up."""
    w = 2 * DEG
    edges = np.array([-np.pi, *(angle_deg * DEG + w * np.array([0, 1, 3, 4])), np.pi])
    bump = np.zeros((5, 3))
    bump[1:4, 2] = bend / 2 * np.array([1, -1, 1])
    bump[1:4, 1] = bend * w * np.array([0, 1, -1]) + slope * np.array([1, -0.5, 0])
    bump[1:4, 0] = bend * w**2 / 2 * np.array([0, 1, 1]) + slope * w * np.array([0, 1, 0])
    lift = LIFT.shifted(Lift(edges, bump, LIFT.half_duration))
    assert np.allclose(lift(edges[1:-1] - 1e-12), lift(edges[1:-1]), atol=1e-12)  # the bump itself has no step
    return lift


def test_a_step_in_acceleration_breaks_the_jerk_limit_alone():
    lift = raised(-60.0, 0.0, 1e-3 * MM_PER_DEG2)
    assert broken_by_shape(LIFT, design(**GENEROUS)) == []
    assert broken_by_shape(lift, design(**GENEROUS)) == ["jerk_max_mm_per_deg3"]
    on_the_ramp = raised(-90.0, 0.0, -1e-5 * MM_PER_DEG2)  # the ramp lies at -101 to -72 deg
    assert broken_by_shape(on_the_ramp, design(**GENEROUS)) == ["jerk_max_mm_per_deg3"]
    without = design(**{**GENEROUS, "jerk_max_mm_per_deg3": None})
    assert broken_by_shape(lift, without) == broken_by_shape(on_the_ramp, without) == []


@pytest.mark.parametrize("angle_deg", [-60.0, -90.0, 85.0, 150.0])
def test_a_step_in_velocity_breaks_acceleration_and_jerk_wherever_it_is(angle_deg):
    """On the ramps it was confirmed, an infinite acceleration."""
    lift = raised(angle_deg, -1e-4 * MM / DEG, 0.0)
    assert {"continuous_velocity", *GENEROUS} <= set(broken_by_shape(lift, design(**GENEROUS)))
    assert "continuous_velocity" in broken_by_shape(lift, design())  # no limit on acceleration is needed for that


@pytest.mark.parametrize(("limit", "excess"), [(2.0, 1.0), (0.8, 1.0), (0.25, 3.0)])
def test_a_step_counts_as_an_excess_of_one_at_least(limit, excess):
    """The step in velocity adds no acceleration between the borders of the pieces."""
    key = "acceleration_max_mm_per_deg2"
    found = shape_excess(raised(-60.0, -1e-4 * MM / DEG, 0.0), design(**{key: limit * EXTREMES[key]}))
    assert found[key] == pytest.approx(excess, rel=1e-6)


def test_a_step_in_lift_is_no_cam():
    borders = np.array([-np.pi, 0.1, np.pi])
    step = Lift(borders, np.array([[0.0], [-1e-3 * MM]]), LIFT.half_duration)
    assert {"continuous_lift", "continuous_velocity"} <= set(broken_by_shape(LIFT.shifted(step), design()))


def test_a_ramp_without_foot_may_step_by_its_velocity_where_the_scene_says_so():
    footless = SCENE.model_copy(update={"design": design(ramp_foot_deg=0.0)})
    lift = polydyne(footless)
    assert broken_by_shape(lift, design(ramp_foot_deg=0.0, **GENEROUS)) == []
    assert "continuous_velocity" in broken_by_shape(lift, design(**GENEROUS))
    slower = design(ramp_foot_deg=0.0, ramp_velocity_mm_per_deg=0.0105)
    assert broken_by_shape(lift, slower) == ["ramp_velocity_mm_per_deg", "continuous_velocity"]


def of_duration(degrees):
    return polydyne(SCENE.model_copy(update={"design": design(duration_deg=degrees)}))


@pytest.mark.parametrize("degrees", [200.0, 145.0])
def test_a_cam_longer_than_the_scene_asks_is_refused(degrees):
    """A cam of 200 deg was confirmed in a scene of 144 deg, with more area than the certified bound."""
    longer = of_duration(degrees)
    broken = broken_by_shape(longer, design())
    assert "duration_deg" in broken
    for claim in (degrees, 144.0, 60.0):  # whatever the file says of its own duration
        claimed = replace(longer, half_duration=claim * DEG / 2)
        assert "duration_deg" in broken_by_shape(claimed, design())
    words = duration_words(longer, design())
    at_the_top = f"{longer(-72 * DEG) / MM:.4g} mm, and 0.265 mm is the ramp's height"
    assert re.search(rf"the lift beyond -?72 deg reaches {re.escape(at_the_top)}", words)
    assert "may exceed by 0.001 mm" in words


def test_the_tolerance_of_the_duration_is_a_micrometre_of_lift():
    """0.1 deg of the ramp of 0.011 mm/deg is 1.1 um, 0.08 deg is 0.9 um, at each side."""
    for degrees, broken in ((144.2, ["duration_deg"]), (144.16, [])):
        claimed = replace(of_duration(degrees), half_duration=72 * DEG)
        assert [n for n in broken_by_shape(claimed, design()) if n == "duration_deg"] == broken


def test_a_shorter_cam_is_legal_and_said():
    shorter = of_duration(118.0)
    assert broken_by_shape(shorter, design()) == []
    words = duration_words(shorter, design())
    assert words.startswith("the cam's duration of 118 deg is shorter than the 144 deg of the scene")
    theta = np.linspace(-72, 72, 20001) * DEG
    assert shorter.area_ratio_in(design()) == pytest.approx(np.mean(shorter(theta)) / (20 * MM), rel=1e-4)
    assert shorter.area_ratio_in(design()) < shorter.area_ratio(20 * MM)
    assert LIFT.area_ratio_in(design()) == pytest.approx(LIFT.area_ratio(20 * MM), rel=1e-12)
    assert duration_words(LIFT, design()) == ""


def test_a_claim_of_a_shorter_duration_does_not_hide_a_cam():
    """The jump is judged inside the cam's own duration: a design file that claims 60 deg hid most of it."""
    claimed = replace(LIFT, half_duration=30 * DEG)
    assert broken_by_shape(claimed, design()) == ["duration_deg"]
    assert "30 deg reaches" in duration_words(claimed, design())


def test_ramps_may_be_slower_and_lower_but_not_faster_or_higher():
    assert broken_by_shape(polydyne(SCENE, ramp_height_mm=0.25), design()) == []
    for factor, broken in ((1.02, ["ramp_velocity_mm_per_deg"]), (1.005, []), (0.9, [])):
        other = SCENE.model_copy(update={"design": design(ramp_velocity_mm_per_deg=0.011 * factor)})
        assert broken_by_shape(polydyne(other), design()) == broken
    fast = polydyne(SCENE.model_copy(update={"design": design(ramp_velocity_mm_per_deg=0.012)}))
    closing = design(ramp_velocity_mm_per_deg=0.012, closing_ramp_velocity_mm_per_deg=0.011)
    assert broken_by_shape(fast, closing) == ["closing_ramp_velocity_mm_per_deg"]
    high = polydyne(SCENE.model_copy(update={"design": design(ramp_height_mm=0.3)}))
    assert broken_by_shape(high, design()) == ["duration_deg"]


def test_limits_on_the_motion_are_those_the_scene_sets():
    assert motion_limits(None) == {}
    assert motion_limits(SCENE.design) == {
        "bounce_max_mm": ("bounce_mm", 0.05),
        "jump_max_mm": ("jump_mm", 0.05),
        "seating_velocity_max_m_per_s": ("seating_velocity_m_per_s", 0.8),
    }
    assert set(MOTION_LIMITS) - set(motion_limits(SCENE.design)) == {
        "contact_force_max_N",
        "contact_force_min_N",
        "jump_max_deg",
    }


def test_a_limit_knows_its_direction():
    most, least = MotionLimit("jump_mm", 0.05), MotionLimit("contact_force_min_N", 40.0)
    assert (most.least, least.least) == (False, True)
    assert most.keeps(0.05) and not most.keeps(0.05, 1e-3) and most.breaks(0.06) and not most.breaks(0.06, 0.02)
    assert least.keeps(40.0) and not least.keeps(40.0, 1.0) and least.breaks(30.0) and not least.breaks(30.0, 12.0)
    assert not most.keeps(np.nan) and most.breaks(np.nan) and least.breaks(np.nan)
    for limit, good, bad in ((most, 0.0, 1.0), (least, 100.0, 0.0)):
        shares = limit.share(np.array([good, limit.value, bad, np.nan]))
        assert shares[0] == 0.0 and shares[1] == 1.0 and 1.0 < shares[2] < np.inf and shares[3] == np.inf
    for limit, step in ((most, 1e-4), (least, -0.1)):  # towards worse
        rise = limit.share(limit.value + step) - limit.share(limit.value)
        assert rise == pytest.approx(limit.share_slope * step) and rise > 0


@pytest.mark.parametrize("height_mm", [0.5, 1.0, 6.0])
def test_a_duration_at_a_lift_is_the_angle_for_which_the_cam_is_higher(height_mm):
    grid = np.linspace(-180.0, 180.0, 360_001)
    long = np.ptp(grid[LIFT(grid * DEG) >= height_mm * MM])
    over = drawing_excess(LIFT, design(duration_at=((height_mm, long + 1.0, 360.0),)))["duration_at"]
    assert over == pytest.approx(1.0 / SCENE.design.duration_deg, abs=3e-5)
    over = drawing_excess(LIFT, design(duration_at=((height_mm, 0.0, long - 2.0),)))["duration_at"]
    assert over == pytest.approx(2.0 / SCENE.design.duration_deg, abs=3e-5)


def test_a_cam_has_no_duration_above_its_lift():
    over = drawing_excess(LIFT, design(duration_at=((LIFT.max_lift / MM + 0.1, 10.0, 360.0),)))["duration_at"]
    assert over == pytest.approx(10.0 / SCENE.design.duration_deg)


def test_a_lift_at_an_angle_is_reached_there():
    rows = reached_by_shape(LIFT, design(lift_at=((-30.0, 2.0, 9.0),)))
    assert [row.where for row in rows if row.key == "lift_at"] == 2 * ["at -30 deg"]
