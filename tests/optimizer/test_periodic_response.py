"""The linear motion of a train whose contacts switch at given angles."""

import numpy as np
import pytest
from scipy.linalg import expm

from camopt.cam.families.free import free_cam
from camopt.optimizer.program.periodic import periodic_response, sample_cam, velocity_scale
from camopt.optimizer.program.phases import phase_contacts, static_angles
from camopt.scene import build_train, load_scene
from camopt.scene.vibration import assembled


@pytest.mark.parametrize("scene_name", ["motori-1", "kodama"])
def test_a_disturbance_of_positions_and_velocities_is_advanced_by_the_exponentials_of_the_phases(scene_name):
    """Velocities are compared in units in which they are as large as positions."""
    scene = load_scene(scene_name)
    train, cam = build_train(scene), free_cam(scene.design)
    n, angles, speed = len(train.mass), static_angles(train, cam), scene.cam_speed(6000.0)
    ends = [-np.pi, angles.lash_closes, angles.seat_opens, angles.seat_closes, angles.lash_opens, np.pi]
    expected = np.eye(2 * n)
    for turn, closed in zip(np.diff(ends), phase_contacts(train)[[0, 1, 2, 1, 0]], strict=True):
        damping, stiffness = assembled(train, closed)
        accelerations = -np.hstack([stiffness, damping]) / train.mass[:, None]
        expected = expm(np.vstack([np.eye(n, 2 * n, n), accelerations]) * turn / speed) @ expected
    response = periodic_response(train, sample_cam(cam, angles), speed, angles)
    unit = np.repeat([1.0, velocity_scale(train)], n)
    found, expected = (m * unit / unit[:, None] for m in (response.map, expected))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * np.abs(expected).max())
