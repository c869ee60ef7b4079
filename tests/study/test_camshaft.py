"""Torque of a camshaft: the work of a turn is none at rest, and lobes add up at their phases."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.scene import InputError, load_scene
from camopt.study.cam_force import camshaft_torque

SCENE = load_scene("kodama")
CAM = polydyne(SCENE)


def test_standing_still_it_takes_no_work():
    """The spring gives back what it took: a turn's work, by the trapezoidal rule, is none of the peak's."""
    one = camshaft_torque(SCENE, CAM)
    assert abs(np.mean(one.torque[:-1])) < 1e-3 * one.torque.max()
    slope = CAM(one.theta, 1)
    assert np.all(one.torque * slope >= 0)
    assert "1 lobe standing still" in str(one)


def test_lobes_add_up_at_their_phases():
    one, two = camshaft_torque(SCENE, CAM), camshaft_torque(SCENE, CAM, (0.0, 90.0))
    later = np.roll(one.torque[:-1], 180)  # 90 deg in steps of 0.5 deg
    assert two.torque[:-1] == pytest.approx(one.torque[:-1] + later, abs=1e-9)


def test_under_way_the_dampings_take_work():
    found = camshaft_torque(SCENE, CAM, (0.0,), speed_rpm=4000)
    assert np.mean(found.torque[:-1]) > 0.05
    assert "at 4000 r/min" in str(found)


def test_no_lobe_is_refused():
    with pytest.raises(InputError, match="0 lobes: from 1 to 100"):
        camshaft_torque(SCENE, CAM, ())
