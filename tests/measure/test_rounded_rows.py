"""Rows of known laws, almost without an error: which limits they surely break, against the laws' own derivatives."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.measure.rounded import RAMP_VELOCITY, RoundedRows, violated_beyond_rounding
from camopt.scene import load_scene
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG3

SCENE = load_scene("kodama")
DESIGN = SCENE.design


class Law:
    """A lift as a function, with its largest value [m]."""

    def __init__(self, lift, max_lift=1.0):
        self.lift, self.max_lift = lift, max_lift

    def __call__(self, theta):
        return self.lift(theta)


def rows(lift, max_lift=1.0, error=1e-9, step=0.1 * DEG):
    return RoundedRows(Law(lift, max_lift), error, step)


def changed(**limits):
    return DESIGN.model_copy(update=limits)


@pytest.mark.parametrize(("half_deg", "changes"), [(89.0, 0), (89.9, 0), (95.0, 2)])
def test_only_changes_of_sign_between_the_ends_count_as_waves(half_deg, changes):
    """The jerk of the sine changes its sign at -90 and at 90 degrees."""
    assert rows(np.sin).waves(half_deg * DEG) == changes


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_jerk_is_limited_to_both_sides(sign):
    """cos x + cos 2x has a largest value of 2 and a least of -9/8."""
    found = rows(lambda x: sign * (np.sin(x) + np.sin(2 * x) / 8))
    for limit, broken in ((1.5, ["jerk_max_mm_per_deg3"]), (2.01, [])):
        design = changed(jerk_max_mm_per_deg3=limit / MM_PER_DEG3)
        assert violated_beyond_rounding(["jerk_max_mm_per_deg3"], found, design) == broken


@pytest.mark.parametrize(("part", "broken"), [(0.5, False), (1.5, True)])
def test_a_ramp_may_be_faster_by_the_stated_share(part, broken):
    velocity = DESIGN.ramp_velocity_mm_per_deg * MM_PER_DEG * (1 + part * RAMP_VELOCITY)
    found = rows(lambda x: velocity * (np.pi - np.abs(x)))
    key = "ramp_velocity_mm_per_deg"
    assert violated_beyond_rounding([key], found, DESIGN) == [key] * broken


@pytest.mark.parametrize(("roundings", "broken"), [(1.0, False), (3.0, True)])
def test_the_maximum_lift_is_missed_where_twice_the_rounding_does_not_reach_it(roundings, broken):
    error, design = 1e-3 * MM, changed(reach_max_lift=True)
    top = design.max_lift_mm * MM - roundings * error
    found = rows(lambda x: top * np.cos(x / 2) ** 2, top, error)
    assert violated_beyond_rounding(["reach_max_lift"], found, design) == ["reach_max_lift"] * broken


@pytest.mark.parametrize(("roundings", "broken"), [(0.5, False), (1.5, True)])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_lift_at_an_angle_is_missed_where_the_rounding_does_not_reach_it(side, roundings, broken):
    error, lift = 1e-3 * MM, polydyne(SCENE)
    level = float(lift(30.0 * DEG) - side * roundings * error) / MM
    design = changed(lift_at=((30.0, 0.0, level) if side > 0 else (30.0, level, DESIGN.max_lift_mm),))
    found = RoundedRows(lift, error, 0.1 * DEG)
    assert violated_beyond_rounding(["lift_at"], found, design) == ["lift_at"] * broken
