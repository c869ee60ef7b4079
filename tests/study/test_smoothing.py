"""Width, tie, steps and source: one name each, checked alike, and what they do to a motion."""

import re

import numpy as np
import pytest

import camopt
from camopt.scene import InputError
from camopt.scene.smoothing import Smoothing, smoothing, smoothing_in

SCENE = camopt.load_scene("motori-1")
CAM = camopt.polydyne(SCENE)
SPEED = 6000
"""At this speed the cam jumps."""


def least_force(**how) -> float:
    """Least force at the cam in the event of the first revolution [N]."""
    motion = camopt.simulate(SCENE, CAM, SPEED, revolutions=1, **how)
    contact = next(one.name for one in SCENE.element if one.cam_driven)
    return float(motion.force_N.sel(element=contact)[abs(motion.cam_angle_deg) < 60].min())


def test_a_tied_contact_pulls_and_one_without_a_tie_opens():
    assert least_force() == 0.0
    assert least_force(method="smooth", tie=1.0) < -10.0
    assert least_force(method="smooth", tie=0.0) == 0.0


def test_without_a_tie_and_with_a_narrow_layer_the_motion_is_the_exact_one():
    exact = camopt.simulate(SCENE, CAM, SPEED, revolutions=1).position_mm.values
    apart = [
        np.abs(camopt.simulate(SCENE, CAM, SPEED, "smooth", revolutions=1, **how).position_mm.values - exact).max()
        for how in ({"width_um": 0.1}, {"tie": 0.0, "width_um": 0.2, "steps_per_revolution": 5760}, {"width_um": 40.0})
    ]
    assert apart[0] < 2e-4 and apart[1] < 5e-3  # mm, after a hop of some tenths, which carries the steps' error on
    assert apart[2] > 0.05  # a wide layer is another law


def test_the_tied_motion_is_that_of_linearised():
    free = camopt.nearest_free_cam(SCENE, CAM, knot_deg=6)
    paths = camopt.linearised(SCENE, free, (SPEED,), steps_per_revolution=720)
    assert paths.sizes["cam_angle_deg"] == 720
    motion = camopt.simulate(
        SCENE, free, SPEED, "smooth", revolutions=12, tie=1.0, steps_per_revolution=720, step_deg=0.5
    )
    contact = str(paths.contact.values[0])
    last = motion.force_N.sel(element=contact)[motion.revolution == 12].values[-720:]
    assert last == pytest.approx(paths.contact_force_N.values[0, :, 0], abs=0.5)  # the motion has settled to this


SMOOTH = {"cam": CAM, "speed_rpm": SPEED, "method": "smooth"}


@pytest.mark.parametrize(
    ("verb", "arguments", "says"),
    [
        (camopt.simulate, SMOOTH | {"method": "event", "width_um": 1.0}, "width_um with method 'event': take method="),
        (camopt.simulate, SMOOTH | {"tie": 2.0}, "tie 2.0: expected a share from 0 to 1"),
        (
            camopt.simulate,
            SMOOTH | {"tie": 1.0, "parameters": {"gap": np.zeros(3)}},
            "tie with parameters: take camopt.",
        ),
        (camopt.objective, {"steps_per_revolution": 10}, "steps_per_revolution 10: expected an integer from"),
        (camopt.optimize, {"source": "exact", "width_um": 2.0}, "with source 'exact' or a wanted yield"),
        (camopt.optimize, {"width_um": 0.0}, "optimize: width_um 0.0: expected a width"),
        (camopt.optimize, {"source": "nothing"}, "'nothing': expected one of auto, smooth, exact, none"),
    ],
)
def test_what_does_not_go_is_a_sentence(verb, arguments, says):
    with pytest.raises(InputError, match=re.escape(says)):
        verb(SCENE, **arguments)


def test_only_what_differs_from_the_defaults_stands_in_a_runs_settings():
    assert smoothing("x", None, None, None) == Smoothing() and Smoothing().as_asked == {}
    asked = smoothing("x", 2.0, None, 720)
    assert asked.as_asked == {"width_um": pytest.approx(2.0), "steps_per_revolution": 720}
    assert smoothing_in(asked.as_asked | {"gradient": "smooth"}) == pytest.approx(asked)


def test_path_is_an_older_name_of_source():
    assert camopt.objective(SCENE, path="smooth").source == camopt.objective(SCENE, source="smooth").source == "smooth"
