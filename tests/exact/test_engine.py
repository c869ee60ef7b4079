"""Event-exact against references that share no code with it."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.exact import prepare
from camopt.scene import MotionRefused, build_train, load_scene, parse_scene, rest_position
from camopt.scene.response import end_state
from camopt.scene.rest import state_at_rest
from camopt.scene.units import DEG, MM
from tests.exact.located_dop853 import located_dop853

GRID = np.linspace(-180.0, 180.0, 721) * DEG


def at(response, angles):
    """Positions of a response at sampled angles; the grid must be among the samples."""
    i = np.clip(np.searchsorted(response.angle, angles - 1e-9), 0, len(response.angle) - 1)
    assert np.abs(response.angle[i] - angles).max() < 1e-9
    return response.x[i]


def from_rest(scene, lift, rpm, steps):
    train = build_train(scene)
    start = state_at_rest(train)
    return prepare(train, lift, scene.cam_speed(rpm), steps)(start)


@pytest.mark.parametrize(
    "name", ["kodama", "motori-1", *(pytest.param(n, marks=pytest.mark.long) for n in ("motori-2", "pushrod-5mass"))]
)
def test_first_revolution_agrees_with_located_dop853(name):
    scene = load_scene(name)
    lift = polydyne(scene)
    ours = at(from_rest(scene, lift, 7000, 7200), GRID)
    theirs = located_dop853(scene, lift, 7000, GRID, rest_position(build_train(scene)))
    assert np.abs(ours - theirs).max() < 1e-6 * MM
    assert np.ptp(ours[:, -1]) > 0.1 * MM  # it did move


@pytest.mark.parametrize("steps", [1800, 14400])
def test_the_step_is_no_accuracy_dial(steps):
    scene = load_scene("kodama")
    lift = polydyne(scene)
    fine, other = (at(from_rest(scene, lift, 6000, s), GRID[::2]) for s in (7200, steps))
    assert np.abs(fine - other).max() < 1e-6 * MM


SEAT_ONLY = """
format = 1
name = "drop"
valve = "ball"
seat = "floor"
[operation]
speeds_rpm = [60]
band_rpm = [50, 60]
cam_per_crank = 1.0
[[mass]]
name = "ball"
mass_kg = 1.0
force_N = -10.0
[[element]]
name = "cam"
kind = "contact"
between = ["ground", "ball"]
stiffness_N_per_m = 1.0e6
gap_mm = 5.0
cam_driven = true
[[element]]
name = "floor"
kind = "contact"
between = ["ground", "ball"]
stiffness_N_per_m = {stiffness}
damping_N_s_per_m = {damping}
"""


def drop(stiffness, damping, height, steps=2000):
    train = build_train(parse_scene(SEAT_ONLY.format(stiffness=stiffness, damping=damping), "drop"))
    flat = Lift(np.array([-np.pi, np.pi]), np.zeros((1, 2)), 1.0)
    return prepare(train, flat, 2 * np.pi, steps)(np.array([height, 0.0]))


def test_falling_mass_touches_and_leaves_at_the_analytic_times():
    k, height, g = 1e5, 0.1, 10.0
    response = drop(k, 0.0, height)
    switch = response.time[:-1][np.diff(response.angle) == 0]
    touch = np.sqrt(2 * height / g)
    speed, omega = g * touch, np.sqrt(k)
    # In contact x = -g/k + (g/k) cos(wt) - (v/w) sin(wt); it leaves when x is zero again.
    contact = 2 * (np.pi - np.arctan2(speed / omega, g / k)) / omega
    assert switch[0] == pytest.approx(touch, abs=1e-12)
    assert switch[1] == pytest.approx(touch + contact, abs=1e-12)
    assert switch[2] == pytest.approx(3 * touch + contact, abs=1e-12)  # no damping: the same height again


def test_damped_contact_lets_go_where_its_force_is_zero_not_where_it_is_unpressed():
    k, c, height, g = 1e5, 100.0, 0.1, 10.0
    response = drop(k, c, height)
    switch = np.flatnonzero(np.diff(response.angle) == 0)
    speed = np.sqrt(2 * g * height)
    assert response.force[switch[0] + 1, 1] == pytest.approx(c * speed, rel=1e-9)  # the force jumps to c d'
    opening = switch[1]
    assert response.force[opening, 1] == pytest.approx(0.0, abs=1e-7)
    assert response.x[opening, 0] < 0.0  # still compressed
    assert k * -response.x[opening, 0] == pytest.approx(c * response.v[opening, 0], rel=1e-9)


def test_touch_and_return_within_one_coarse_step_is_caught():
    coarse = drop(1e10, 0.0, 0.1, steps=360)  # contact lasts 3e-5 s, a step 2.8e-3 s
    assert np.count_nonzero(np.diff(coarse.angle) == 0) >= 6
    assert coarse.x[:, 0].max() == pytest.approx(0.1, rel=1e-6)


def test_endless_switching_is_refused():
    with pytest.raises(MotionRefused, match="switch more than"):
        drop(1e12, 0.0, 1e-9)


def test_settled_motion_repeats():
    scene = load_scene("kodama")
    train = build_train(scene)
    revolve = prepare(train, polydyne(scene), scene.cam_speed(5000))
    state = state_at_rest(train)
    for _ in range(40):
        before, state = state, end_state(revolve(state))
    assert np.abs(state - before)[:10].max() < 1e-6
