"""JAX through a train of every element: the rule against the adjoint it calls, and by the speed against differences."""

import jax
import numpy as np

from camopt.autodiff.exact_rule import exact_metrics
from camopt.exact.adjoint.gradient import value_and_gradient
from camopt.exact.adjoint.motion import TracedMotion
from camopt.scene.rest import state_at_rest
from tests.exact.gradient_problems import by_train, differences, least_error
from tests.exact.test_real_trains import FAST, METRICS, SCENE, STEPS, real


def test_gradients_by_laws_and_speed_are_those_of_the_adjoint():
    train, lift = real()
    speed = SCENE.cam_speed(FAST)
    found = value_and_gradient(train, lift, speed, METRICS, mechanical=True)
    numbers = {"stiffness": train.laws.coefficient, "damping": train.damping, "lift": lift.coefficients}

    def metrics(numbers, speed):
        return exact_metrics(train, lift, speed, numbers, METRICS)

    slopes, by_speed = jax.jacrev(metrics, argnums=(0, 1))(numbers, speed)
    np.testing.assert_array_equal(metrics(numbers, speed), found.values)
    np.testing.assert_allclose(slopes["lift"], found.by_coefficients, rtol=1e-9)
    for name in ("stiffness", "damping"):
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
