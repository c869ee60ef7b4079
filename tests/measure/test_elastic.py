"""Elastic forces for the energy balance: the scene's law, and the slope of the energy they store."""

import numpy as np
import pytest

from camopt.measure.energy import Elastic
from camopt.scene import build_train, load_scene

COMPRESSION = np.linspace(-2e-4, 2e-4, 401)


def test_a_hertz_contact_pushes_with_the_power_of_its_compression_from_the_touch():
    scene = load_scene("kodama-hertz")
    train = build_train(scene)
    e = next(i for i, element in enumerate(scene.element) if element.law == "hertz")
    element = scene.element[e]
    force = Elastic(train).force(np.repeat(COMPRESSION[:, None], len(train.a), axis=1))[:, e]
    k, p = element.stiffness_N_per_m, element.exponent or 1.5
    expected = k * np.maximum(0.0, COMPRESSION + (element.preload_N / k) ** (1.0 / p)) ** p
    np.testing.assert_allclose(force, expected, rtol=1e-12, atol=1e-12)
    assert force.max() > 1.0


@pytest.mark.parametrize("name", ["kodama-hertz", "kodama"])
def test_the_energy_is_the_integral_of_the_force(name):
    train = build_train(load_scene(name))
    elastic, d = Elastic(train), np.repeat(COMPRESSION[:, None], len(train.a), axis=1)
    memory = np.zeros((len(d), len(train.memory)))
    change = np.diff(elastic.stored(d, memory), axis=0)
    pushed = np.where(train.contact, np.maximum(elastic.force(d), 0.0), elastic.force(d))
    middle = 0.5 * (pushed[1:] + pushed[:-1]) * np.diff(d, axis=0)
    scale = np.abs(change).max(axis=0)
    np.testing.assert_allclose(change, middle, atol=1e-3 * scale.max())  # trapezoids of 1 um
