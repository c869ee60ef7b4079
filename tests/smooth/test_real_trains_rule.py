"""JAX through a train of every element: the rule against the adjoint it calls, and by the speed against differences."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import camopt
from camopt.exact.adjoint.motion import TracedMotion, value_and_gradient
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.parameters import matching, with_numbers
from camopt.scene.rest import state_at_rest
from camopt.scene.train import LAW_PARAMETERS
from camopt.smooth.exact_rule import exact_metrics
from camopt.study.simulate.motion import motion_parameters
from tests.exact.gradient_problems import by_train, differences, least_error
from tests.exact.test_real_trains import FAST, METRICS, SCENE, STEPS, real


def test_gradients_by_laws_and_speed_are_those_of_the_adjoint():
    train, lift = real()
    speed = SCENE.cam_speed(FAST)
    found = value_and_gradient(train, lift, speed, METRICS, mechanical=True)
    names = "stiffness", "damping", *LAW_PARAMETERS
    numbers = {name: train.parameters[name] for name in names} | {"lift": lift.coefficients}

    def metrics(numbers, speed):
        return exact_metrics(train, lift, speed, numbers, METRICS)

    slopes, by_speed = jax.jacrev(metrics, argnums=(0, 1))(numbers, speed)
    np.testing.assert_array_equal(metrics(numbers, speed), found.values)
    np.testing.assert_allclose(slopes["lift"], found.by_coefficients, rtol=1e-9)
    for name in names:
        np.testing.assert_allclose(slopes[name], getattr(by_train(found), name), rtol=1e-9, err_msg=name)

    def at_speed(h):
        return TracedMotion(train, lift, speed * (1 + h), state_at_rest(train)).values(METRICS)

    reference = differences(at_speed, STEPS)
    for i, metric in enumerate(METRICS):
        exact = np.asarray(by_speed)[i : i + 1] * speed
        if np.any(exact):
            assert least_error(exact, reference[:, i : i + 1]) < 1e-5, metric
        else:
            assert np.abs(reference[:, i]).max() < 1e-6, metric


@cache
def slopes_by_laws():
    """Slopes of the metrics by every number of the elements."""
    train, lift = real()
    names = "stiffness", "damping", "preload", "gap", *LAW_PARAMETERS
    numbers = {name: train.parameters[name] for name in names}
    return jax.jacrev(lambda p: exact_metrics(train, lift, SCENE.cam_speed(FAST), p, METRICS))(numbers)


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
    for name, slope in slopes_by_laws().items():
        way = (up[name] - down[name]) / 2e-6
        exact += np.tensordot(slope, way, way.ndim)

    def values(h):
        train = build_train(scaled(key, h))
        return TracedMotion(train, lift, speed, state_at_rest(train)).values(METRICS)

    reference = differences(values, STEPS)
    assert np.count_nonzero(exact) >= 3
    for i, metric in enumerate(METRICS):
        if exact[i]:
            assert least_error(exact[i : i + 1], reference[:, i : i + 1]) < 1e-5, metric
        else:
            assert np.abs(reference[:, i]).max() < 1e-6, metric


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
