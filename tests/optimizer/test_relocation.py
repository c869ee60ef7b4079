"""Switching angles from crossings between samples, and the tangents of real trains against the event-exact motion of
the cam that the no-jump program finds."""

from pathlib import Path

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.optimizer.program.periodic import periodic_response, sample_cam
from camopt.optimizer.program.phases import tangents_along
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.program.relocation import (
    NoLoadTransfer,
    _crossing,
    converge_tangents,
    located_angles,
    settled_revolution,
)
from camopt.scene import build_train, load_scene
from camopt.scene.rest import is_linear, linearised_at_rest
from camopt.scene.units import MM

MARGIN_N = 20.0
SETTLED = 80
NEAR = 2e-3 * MM
"""The program holds the gas force over a quarter of a degree and rounds tangents of curved laws to 5 %: it is 0.0007 to
0.0015 mm from the valve's motion on these scenes."""
ANGLE = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
VALUE = np.array([-1.0, 0.0, 1.0, -1.0, 3.0])
"""Rises through zero at 1, and at 3 1/4."""


@pytest.mark.parametrize(
    ("low", "high", "last", "expected"),
    [
        (0.0, 4.0, False, 1.0),
        (0.0, 4.0, True, 3.25),
        (1.0, 2.0, False, 1.0),
        (0.5, 1.0, True, 1.0),
        (2.0, 4.0, 0, 3.25),
    ],
)
def test_a_rise_through_zero_is_found_in_its_range_with_both_ends(low, high, last, expected):
    assert _crossing(ANGLE, VALUE, low, high, last=last, what="it rises") == pytest.approx(expected)


def test_where_nothing_rises_through_zero_it_is_said():
    with pytest.raises(NoLoadTransfer, match="no angle at which it rises"):
        _crossing(ANGLE, VALUE, 1.5, 1.9, last=False, what="it rises")


BUCKET = Path(__file__).resolve().parents[3] / "shared" / "data" / "scenes" / "bucket-tappet.toml"


@pytest.mark.skipif(not BUCKET.is_file(), reason="the scene does not lie beside this checkout")
def test_the_program_of_a_bucket_tappet_is_decided_and_keeps_its_limits():
    """HiGHS left its working set of 196 rows undecided ("Not Set"), which has no largest area without a box."""
    scene = load_scene(str(BUCKET))
    speeds = [scene.cam_speed(speed) for speed in scene.operation.speeds_rpm]
    program = no_jump_program(build_train(scene), scene.design, program_cam(scene.design, 3.0), speeds)
    found = converge_tangents(program).solve_below(20.0)
    assert 0.55 < found.area_ratio < 0.63
    assert broken_by_shape(found.lift, scene.design) == []


@pytest.mark.parametrize("name", ["exhaust-gas", "finger-hydraulic", "pushrod-hydraulic", "race-nested"])
def test_the_linear_motion_is_the_settled_one_of_its_cam(name):
    """With the tangents along the settled motion of a cam, the periodic response is that motion."""
    scene = load_scene(name)
    train, cam = build_train(scene), free_cam(scene.design, 4.0)
    speed = scene.cam_speed(scene.operation.speeds_rpm[-1])
    program = converge_tangents(no_jump_program(train, scene.design, cam, [speed]), MARGIN_N)
    found = program.solve((60.0, 60.0, MARGIN_N))
    real = settled_revolution(train, found.lift, speed, SETTLED)
    angles = located_angles(real)
    response = periodic_response(train, sample_cam(cam, angles), speed, angles)
    x = response.state[:, train.valve] @ np.append(1.0, found.z)
    at = np.interp(response.samples.edges, real.angle, real.x[:, train.valve])
    lifted = np.abs(response.samples.edges) < scene.design.duration_deg / 2 * np.pi / 180
    assert np.abs(x - at)[lifted].max() < NEAR


def test_a_program_of_a_real_train_says_what_its_cam_does():
    scene = load_scene("exhaust-gas")
    train, cam = build_train(scene), free_cam(scene.design, 4.0)
    speeds = [scene.cam_speed(s) for s in scene.operation.speeds_rpm]
    program = converge_tangents(no_jump_program(train, scene.design, cam, speeds), MARGIN_N)
    found = program.solve(MARGIN_N)
    least = []
    for speed in speeds:
        real = settled_revolution(train, found.lift, speed, 20)
        window = np.abs(real.angle) < (scene.design.duration_deg / 2 - 4) * np.pi / 180
        least.append(real.force[window, train.cam_side[0]].min())
    assert min(least) == pytest.approx(MARGIN_N, abs=0.1)


def test_a_linear_train_has_no_tangents():
    scene = load_scene("motori-1")
    train, cam = build_train(scene), free_cam(scene.design, 6.0)
    assert is_linear(train) and linearised_at_rest(train) is train
    program = no_jump_program(train, scene.design, cam, [scene.cam_speed(5000)])
    assert converge_tangents(program) is program
    motion = settled_revolution(train, cam.lift(np.zeros(cam.Z.shape[1])), scene.cam_speed(5000), 1)
    assert tangents_along(motion) is None
