"""JAX through a train of every element: gradients by the numbers that scatter, and what no law can have."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import camopt
from camopt.exact.adjoint.motion import TracedMotion
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.parameters import matching, with_numbers
from camopt.scene.rest import state_at_rest
from camopt.smooth.exact_rule import exact_metrics
from camopt.study.simulate.motion import motion_parameters
from tests.exact.gradient_problems import assert_slopes, differences, least_error
from tests.exact.test_real_trains import FAST, METRICS, SCENE, STEPS, real


@cache
def slopes_by_train():
    """Slopes of the metrics by every number of the train."""
    train, lift = real()
    return jax.jacrev(lambda p: exact_metrics(train, lift, SCENE.cam_speed(FAST), p, METRICS))(train.parameters)


def scaled(key, h):
    """The scene with one of its numbers, NAME.KEY, times 1 + h."""
    (number,) = matching(SCENE, key)
    return with_numbers(SCENE, {number: number.of(SCENE) * (1.0 + h)})


KEYS = [
    *("lifter.leak_N_s_per_m", "guide.slip_N", "guide.stiffness_N_per_m"),
    *("lifter.stiffness_N_per_m", "lifter.spring_N_per_m", "lifter.preload_N"),
]


@pytest.mark.parametrize("key", KEYS)
def test_gradients_by_all_numbers_of_adjuster_and_friction_that_scatter(key):
    """Along what the number moves in the train, a plunger's table included, against the exact motion's differences."""
    lift, speed = real()[1], SCENE.cam_speed(FAST)
    up, down = (build_train(scaled(key, h)).parameters for h in (1e-6, -1e-6))
    exact = np.zeros(len(METRICS))
    for name, slope in slopes_by_train().items():
        way = (up[name] - down[name]) / 2e-6
        exact += np.tensordot(slope, way, way.ndim)

    def values(h):
        train = build_train(scaled(key, h))
        return TracedMotion(train, lift, speed, state_at_rest(train)).values(METRICS)

    assert np.count_nonzero(exact) >= 3
    assert_slopes(exact, differences(values, STEPS), METRICS, 1e-5)


@pytest.mark.parametrize(("name", "key"), [("leak", "lifter.leak_N_s_per_m"), ("slip", "guide.slip_N")])
@pytest.mark.parametrize(
    ("method", "tolerance"), [("event", 1e-5), pytest.param("smooth", 2e-2, marks=pytest.mark.long)]
)
def test_a_simulated_motion_by_leak_and_slip(name, key, method, tolerance):
    """Against differences of the exact motion, from which the smooth path differs by the width of its layers."""
    lift = real()[1]
    number = motion_parameters(SCENE, lift)[name]

    def positions(share):
        found = camopt.simulate(SCENE, lift, FAST, method, step_deg=10.0, parameters={name: number * share})
        return jnp.sum(found["position_mm"].data[:, 1] ** 2)

    def truth(h):
        moved = camopt.simulate(scaled(key, h), lift, FAST, step_deg=10.0)
        return np.array([np.sum(moved["position_mm"].values[:, 1] ** 2)])

    found = np.asarray(jax.grad(positions)(1.0))[None]
    assert least_error(found, differences(truth, STEPS)) < tolerance


@pytest.mark.parametrize("name", ["leak", "slip", "table"])
def test_a_number_that_no_law_can_have_is_a_motion_that_cannot_be_followed(name):
    train, lift = real()
    values = exact_metrics(train, lift, SCENE.cam_speed(FAST), {name: -train.parameters[name]}, METRICS)
    assert np.isnan(values).all()


def test_a_linear_train_has_no_leak():
    scene = load_scene("motori-1")
    with pytest.raises(InputError, match="parameter leak: expected one of mass"):
        exact_metrics(build_train(scene), real()[1], 100.0, {"leak": np.ones(4)}, METRICS)
