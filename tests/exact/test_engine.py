"""Event-exact against references that share no code with it."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare
from camopt.scene import build_train, load_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.units import DEG, MM
from tests.exact.small_trains import GRAVITY, ONCE_A_SECOND, STILL, ball
from tests.measure.raw_motion import Equations, raw_motion, samples

GRID = np.linspace(-180.0, 180.0, 721) * DEG


def at(response, angles):
    """Positions of a response at sampled angles; the grid must be among the samples."""
    i = np.clip(np.searchsorted(response.angle, angles - 1e-9), 0, len(response.angle) - 1)
    assert np.abs(response.angle[i] - angles).max() < 1e-9
    return response.x[i]


@pytest.mark.parametrize(
    "name", ["kodama", "motori-1", *(pytest.param(n, marks=pytest.mark.long) for n in ("motori-2", "pushrod-5mass"))]
)
def test_first_revolution_agrees_with_located_dop853(name):
    scene = load_scene(name)
    train, lift, equations = build_train(scene), polydyne(scene), Equations(scene, polydyne(scene), 7000)
    start = state_at_rest(train)
    ours = at(prepare(train, lift, scene.cam_speed(7000), 7200)(start), GRID)
    theirs = samples(equations, raw_motion(equations, start, np.pi), GRID)[1]
    assert np.abs(ours - theirs[:, : len(train.mass)]).max() < 1e-6 * MM
    assert np.ptp(ours[:, -1]) > 0.1 * MM  # it did move


def drop(stiffness, damping, height, steps=2000):
    return prepare(ball(stiffness, damping), STILL, ONCE_A_SECOND, steps)(np.array([height, 0.0]))


def test_falling_mass_touches_and_leaves_at_the_analytic_times():
    k, height, g = 1e5, 0.1, GRAVITY
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
    k, c, height, g = 1e5, 100.0, 0.1, GRAVITY
    response = drop(k, c, height)
    switch = np.flatnonzero(np.diff(response.angle) == 0)
    speed = np.sqrt(2 * g * height)
    assert response.force[switch[0] + 1, 1] == pytest.approx(c * speed, rel=1e-9)  # the force jumps to c d'
    opening = switch[1]
    assert response.force[opening, 1] == pytest.approx(0.0, abs=1e-7)
    assert response.x[opening, 0] < 0.0  # still compressed
    assert k * -response.x[opening, 0] == pytest.approx(c * response.v[opening, 0], rel=1e-9)
