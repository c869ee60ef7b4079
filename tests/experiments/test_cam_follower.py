"""The cam and follower of arXiv 0711.1008 compared with formulas: arcs, restitution, and the limits of the best cam."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.exact import prepare
from camopt.scene import build_train, load_scene
from experiments import cam_follower
from experiments.cam_follower import TIP, arcs, bound_on_decline, cam_of, damping_of, highest_rise, profile

MASS, STIFFNESS, PRELOAD = 1.221, 1430.8, 143.08


def test_the_cam_is_the_sources_arcs():
    angle = np.linspace(-np.pi, np.pi, 20_011)
    np.testing.assert_allclose(profile()(angle), arcs(np.pi - np.abs(angle)), atol=1e-14)
    assert profile().max_lift == pytest.approx(0.153933, abs=5e-7)


@pytest.mark.parametrize("restitution", [0.5, 0.8, 0.95])
def test_a_contact_returns_what_its_damping_was_made_for(restitution):
    """A mass that hits the contact at 1 m/s without any other force leaves it at `restitution` m/s."""
    given, stiffness = build_train(load_scene(cam_follower.SCENE)), 1e9
    train = cam_follower.with_contact(given, stiffness, damping_of(restitution, stiffness, MASS))
    train = replace(train, stiffness=np.array([stiffness, 1e-12]), preload=np.array([0.0, 0.0]))
    motion = prepare(train, replace(profile(), coefficients=0 * profile().coefficients), 2 * np.pi)
    state = motion(np.array([0.1, -1.0])).v[:, 0]
    assert state[0] == -1.0 and state[-1] == pytest.approx(restitution, rel=1e-9)


def test_the_found_cam_keeps_its_limits_at_every_angle():
    shift, most, decline = PRELOAD / STIFFNESS, 1.0, 1.02 * bound_on_decline(0.15, 1.0, 0.1, TIP)
    cam = cam_of(highest_rise(decline, most, shift, TIP, 101))
    angle = np.linspace(-np.pi, np.pi, 360_001)
    assert cam(angle, 2).max() <= most + 1e-9
    assert np.min(cam(angle, 2) + decline * (shift + cam(angle))) > -1e-9
