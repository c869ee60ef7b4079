"""Limits on the cam's shape: each judged on its own, on both sides of the extreme."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.scene import load_scene
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3
from camopt.verify.limits import MOTION_LIMITS, MotionLimit, broken_by_shape, motion_limits

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
    on_the_ramp = raised(-80.0, 0.0, 1e-3 * MM_PER_DEG2)
    assert broken_by_shape(on_the_ramp, design(**GENEROUS)) == ["jerk_max_mm_per_deg3"]  # its end lies at -72 deg
    outside = raised(-90.0, 0.0, 1e-3 * MM_PER_DEG2)
    assert broken_by_shape(outside, design(**GENEROUS)) == []


def test_a_step_in_velocity_breaks_acceleration_and_jerk():
    assert set(broken_by_shape(raised(-60.0, 1e-3 * MM / DEG, 0.0), design(**GENEROUS))) == set(GENEROUS)


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
