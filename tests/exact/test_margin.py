"""The contact force margin: the least contact force where nothing parts, and a gradient where something does."""

import numpy as np
import pytest

from camopt.cam.bumps import moved, with_bumps
from camopt.cam.families.polydyne import polydyne
from camopt.exact.adjoint.gradient import value_and_gradient
from camopt.exact.adjoint.margin import contact_force_margin
from camopt.scene import InputError, build_train, load_scene
from tests.exact.gradient_problems import by_train, kodama

LEAST = ["contact_force_min_N"]


def by_bumps(gradient, directions):
    return np.einsum("lpq,mpq->lm", gradient.by_coefficients, directions)[0]


def test_it_is_the_least_contact_force_where_nothing_parts():
    scene, train = kodama()
    for rpm in (5000, 5500):
        least = value_and_gradient(train, polydyne(scene), scene.cam_speed(rpm), LEAST).values[0]
        margin = contact_force_margin(train, polydyne(scene), scene.cam_speed(rpm)).values[0]
        assert least > 20.0
        assert margin == pytest.approx(least, abs=10.0)  # held contacts do not strike inside the lash


@pytest.mark.parametrize("settled", [False, True])
def test_it_has_a_gradient_where_the_clipped_force_has_none(settled):
    scene, train = kodama()
    lift, directions = with_bumps(polydyne(scene), 4)
    speed = scene.cam_speed(7000)
    assert not np.any(value_and_gradient(train, lift, speed, LEAST).by_coefficients)
    found = contact_force_margin(train, lift, speed, settled=settled)
    assert found.values[0] < -100.0

    def value(heights):
        return contact_force_margin(train, moved(lift, directions, heights), speed, settled=settled).values[0]

    differences = np.array([(value(e) - value(-e)) / 2e-8 for e in 1e-8 * np.eye(4)])
    slope = by_bumps(found, directions)
    assert np.linalg.norm(slope - differences) < 1e-5 * np.linalg.norm(differences)


def test_holding_does_not_change_the_gradients_by_the_train():
    scene, train = kodama()
    lift, speed = polydyne(scene), scene.cam_speed(5000)
    margin = by_train(contact_force_margin(train, lift, speed, mechanical=True))
    least = by_train(value_and_gradient(train, lift, speed, LEAST, mechanical=True))
    assert margin.preload[0] == pytest.approx(least.preload[0], rel=0.05, abs=0.02)  # N per N, but for the lash
    assert np.abs(least.preload[0]).max() > 0.1


def test_nonlinear_contacts_are_not_held():
    scene = load_scene("kodama-hertz")
    with pytest.raises(InputError, match="held closed beyond a law that is not linear"):
        contact_force_margin(build_train(scene), polydyne(scene), scene.cam_speed(5000))
