"""JAX through the exact path: the rule against the adjoint it calls, and chains of it against central differences."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import camopt
from camopt.cam.families.free import free_cam
from camopt.cam.lift import Lift
from camopt.exact.adjoint.metrics import METRICS
from camopt.exact.adjoint.motion import value_and_gradient
from camopt.scene import InputError
from camopt.scene.rest import state_at_rest
from camopt.smooth import exact_rule
from camopt.smooth.exact_rule import exact_metrics
from camopt.smooth.families import differentiable
from camopt.smooth.varying_motion import Varying
from camopt.study.simulate.motion import motion_parameters
from tests.exact.gradient_problems import assert_slopes, by_train, differences, from_rest, kodama, least_error
from tests.exact.test_real_trains import FAST, real
from tests.exact.test_real_trains import METRICS as REAL_METRICS
from tests.exact.test_real_trains import SCENE as REAL

SCENE, TRAIN = kodama()
SPEED = SCENE.cam_speed(6500)
NAMES = ["seating_velocity_m_per_s", "bounce_mm", "contact_force_max_N"]


@cache
def polydyne():
    return camopt.polydyne(SCENE)


def by_cam(coefficients, speed=SPEED):
    return exact_metrics(TRAIN, polydyne(), speed, {"lift": coefficients}, NAMES)


@cache
def adjoint():
    return value_and_gradient(TRAIN, polydyne(), SPEED, NAMES, mechanical=True)


CASES = {
    "linear": (lambda: (TRAIN, polydyne(), SPEED, NAMES), 1e-6),
    "every element": (lambda: (*real(), REAL.cam_speed(FAST), REAL_METRICS), 1e-5),
}


@pytest.mark.parametrize("case", CASES)
def test_gradients_by_cam_train_and_speed_are_those_of_the_adjoint(case):
    """By the speed, that is through masses and dampings, those of central differences."""
    (moving, allowed), steps = CASES[case], 10.0 ** np.arange(-3.0, -6.5, -0.5)
    train, lift, cam_speed, names = moving()
    found = value_and_gradient(train, lift, cam_speed, names, mechanical=True)

    def metrics(numbers, speed):
        return exact_metrics(train, lift, speed, numbers, names)

    at = train.parameters | {"lift": lift.coefficients}
    slopes, by_speed = jax.jacrev(metrics, argnums=(0, 1))(at, cam_speed)
    np.testing.assert_array_equal(metrics(at, cam_speed), found.values)
    np.testing.assert_allclose(slopes.pop("lift"), found.by_coefficients, rtol=1e-9)
    for name, slope in slopes.items():
        np.testing.assert_allclose(slope, getattr(by_train(found), name), rtol=1e-9, err_msg=name)
    reference = differences(lambda h: from_rest(train, lift, cam_speed * (1 + h), names), steps)
    assert_slopes(np.asarray(by_speed) * cam_speed, reference, names, allowed)


def test_compiled_and_batched_in_one_call(monkeypatch):
    pools = []

    class Counted(exact_rule.ThreadPoolExecutor):
        def __init__(self, *args):
            pools.append(self)
            super().__init__(*args)

    monkeypatch.setattr(exact_rule, "ThreadPoolExecutor", Counted)
    speeds = jnp.array([SCENE.cam_speed(rpm) for rpm in (6500.0, 5500.0)])
    cams = jnp.asarray(polydyne().coefficients) * jnp.array([1.0, 1.0 - 1e-5, 1.0 + 1e-5])[:, None, None]
    gradient = jax.vmap(jax.vmap(jax.grad(lambda c, s: by_cam(c, s)[0]), (None, 0)), (0, None))
    found = jax.jit(gradient)(cams, speeds)
    assert found.shape == (3, 2, *polydyne().coefficients.shape) and len(pools) == 1
    np.testing.assert_allclose(found[0, 0], adjoint().by_coefficients[0], rtol=1e-9)
    other = replace(polydyne(), coefficients=np.array(cams[2]))
    single = value_and_gradient(TRAIN, other, float(speeds[1]), NAMES[:1])
    np.testing.assert_allclose(found[2, 1], single.by_coefficients[0], rtol=1e-9)


def test_by_speed_from_a_start_whose_velocities_are_held():
    start = state_at_rest(TRAIN) + np.repeat([0.0, 1e-2], 10)
    held = jax.grad(lambda s: exact_metrics(TRAIN, polydyne(), s, {"start": start}, NAMES)[0])(SPEED)
    pair = [from_rest(TRAIN, polydyne(), SPEED + h, NAMES, start)[0] for h in (1e-3, -1e-3)]
    assert held == pytest.approx((pair[0] - pair[1]) / 2e-3, rel=1e-5)


def test_chain_from_the_free_coefficients_of_a_cam():
    """Along cos(i) of each, against central differences, through pieces and motion: one compilation."""
    free = free_cam(SCENE.design, 6.0)
    z = free.Z.T @ (-0.004 * np.cos(np.linspace(-3.2, 2.9, len(free.x_p))) - free.x_p)
    cam = differentiable(SCENE, free.lift(z))
    lift = Lift(*(np.array(part) for part in cam.pieces({"z": z})), free.lift(z).half_duration)

    def value(z):
        borders, coefficients = cam.pieces({"z": z})
        values = exact_metrics(TRAIN, lift, SPEED, {"borders": borders, "lift": coefficients}, NAMES)
        return values, values

    compiled, direction = jax.jit(jax.jacrev(value, has_aux=True)), np.cos(np.arange(len(z)))
    reference = differences(lambda h: np.asarray(compiled(z + h * direction)[1]), (1e-5, 1e-6, 1e-7))
    assert least_error(compiled(z)[0] @ direction, reference) < 1e-6


def simulated(parameters, name, sample):
    motion = camopt.simulate(SCENE, polydyne(), 6500, method="event", step_deg=1.0, parameters=parameters)
    return motion[name].data[0] if name.endswith("_s") else motion["position_mm"].data[sample, 9]


def test_simulate_is_differentiable_as_it_stands():
    parameters = motion_parameters(SCENE, polydyne())
    plain = camopt.simulate(SCENE, polydyne(), 6500, method="event", step_deg=1.0)
    traced = camopt.simulate(SCENE, polydyne(), 6500, method="event", step_deg=1.0, parameters=parameters)
    np.testing.assert_allclose(
        traced["position_mm"].data, plain["position_mm"], atol=1e-6
    )  # its samples are cubic between
    assert set(METRICS) <= set(traced.data_vars)
    gaps = {"gap": parameters["gap"]}
    for name in ("seating_velocity_m_per_s", "position"):
        slope = np.asarray(jax.grad(simulated)(gaps, name, 250)["gap"])
        move = np.where(parameters["gap"] > 0, 1e-8, 0.0)
        pair = [simulated({"gap": parameters["gap"] + sign * move}, name, 250) for sign in (1, -1)]
        assert slope @ move == pytest.approx(float(pair[0] - pair[1]) / 2, rel=1e-5)
    whole = value_and_gradient(TRAIN, polydyne(), SPEED, NAMES[:1], revolutions=2, mechanical=True)
    slope = jax.grad(simulated)(gaps, "seating_velocity_m_per_s", 0)["gap"]
    np.testing.assert_allclose(slope, by_train(whole).gap[0], rtol=1e-9)


def test_a_motion_that_cannot_be_followed_is_nan_and_so_is_its_gradient():
    for mass in (np.nan, -1.0):
        masses = np.where(np.arange(10) == 3, mass, TRAIN.mass)
        value, slope = jax.value_and_grad(
            lambda m: exact_metrics(TRAIN, polydyne(), SPEED, {"mass": m}, NAMES)[0]
        )(masses)  # fmt: skip
        assert np.isnan(value) and np.all(np.isnan(slope))
        motion = jax.grad(lambda m: simulated({"mass": m}, "position", 100))(masses)
        assert np.all(np.isnan(motion))
    floating = {"mass_force": np.zeros(10)}
    assert np.all(np.isnan(exact_metrics(TRAIN, polydyne(), SPEED, floating, NAMES)))  # nothing holds the follower


def test_weights_of_zero_pass_over_what_is_not_a_number():
    slopes = jnp.array([[jnp.nan, jnp.nan], [1.0, 2.0]])
    np.testing.assert_array_equal(exact_rule.weighted(jnp.array([0.0, 3.0]), slopes), [3.0, 6.0])
    assert np.all(np.isnan(exact_rule.weighted(jnp.array([1.0, 3.0]), slopes)))


def test_asking_twice_gives_the_same():
    """Gradients by names of one motion: the terms of the rest are not left behind in what they are taken from."""
    varying = Varying(TRAIN, polydyne(), 1, None, 0.0)
    given = {"cam_speed": np.array(SPEED), "preload": TRAIN.preload}
    motion = varying.trace(given, ("preload",))
    assert motion is not None
    values, slopes = motion.swept(NAMES)
    assert slopes.by_train is not None
    before = slopes.by_train.preload.copy()
    once, twice = (varying.by_names(("preload",), given, motion, slopes, values[:, 0], None) for _ in range(2))
    np.testing.assert_array_equal(once["preload"], twice["preload"])
    np.testing.assert_array_equal(slopes.by_train.preload, before)
    assert np.abs(once["preload"] - before).max() > 1e-3 * np.abs(before).max()  # what the rest owes to it


def test_unknown_names_are_refused():
    with pytest.raises(InputError, match="parameter lash"):
        exact_metrics(TRAIN, polydyne(), SPEED, {"lash": 0.0}, NAMES)
