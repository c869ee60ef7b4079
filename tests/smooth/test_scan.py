"""The scan: its order, its agreement with diffrax and with event-exact, its batches, its refusals."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm

from camopt.exact.engine import prepare as prepare_exact
from camopt.scene import InputError, MotionRefused, Response
from camopt.smooth.laws import Layer
from camopt.smooth.rest import rest_state
from camopt.smooth.scan import DrivenSystem, integrate, lift_at
from camopt.smooth.simulate import (
    LAYER,
    LIFT_SAMPLES,
    compiled_response,
    equal_grid,
    lift_samples,
    prepare,
)
from camopt.smooth.system import build_system
from experiments.support.smooth_batch import tsit5_states
from tests.smooth.trains import ball, kodama


def valve_difference_mm(one, other) -> float:
    """Largest difference of the valve's position between two records of one revolution [mm]."""
    valve, speed = one.train.valve, one.cam_speed
    curve = CubicHermiteSpline(one.angle, one.x[:, valve], one.v[:, valve] / speed)
    return float(np.max(np.abs(curve(other.angle) - other.x[:, valve]))) * 1e3


def test_lift_between_samples_is_the_cubic_and_linear_in_the_samples():
    _, _, lift = kodama()
    samples, theta = lift_samples(lift), np.linspace(-np.pi, np.pi, 977)
    value, slope = lift_at(jnp.asarray(samples), jnp.asarray(theta))
    np.testing.assert_allclose(value, lift(theta), atol=1e-10)  # h^4 |lift''''| / 384 with h = 2.2 mrad: 2e-11 m
    np.testing.assert_allclose(slope, lift(theta, 1), atol=1e-7)
    double, _ = lift_at(jnp.asarray(2 * samples), jnp.asarray(theta))
    np.testing.assert_allclose(double, 2 * value, rtol=1e-14)


def test_the_scan_is_of_order_five_against_the_matrix_exponential():
    train = ball(0.05, 3e4, 6.0)
    start = np.array([-2e-4, 0.05])  # pressed in, and never released: linear
    train = dataclasses.replace(train, mass_force=np.array([-30.0]))
    matrix = np.array([[0.0, 1.0], [-3e4 / 0.05, -6.0 / 0.05]])
    rest = np.array([-1e-3, 0.0])
    exact = rest + expm(matrix * 2e-2) @ (start - rest)
    counts = np.array([80, 160, 320, 640])
    flat = jnp.zeros((3, 2))
    driven, errors = DrivenSystem(build_system(train), flat, np.pi / 1e-2), []
    for count in counts:
        states = integrate(driven, jnp.asarray(start[:, None]), equal_grid(count), Layer(1e-9))
        errors.append(np.linalg.norm((np.asarray(states[-1, :, 0]) - exact) * [np.sqrt(3e4 / 0.05), 1.0]))
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order == pytest.approx(5.0, abs=0.25)


def test_the_scan_and_diffrax_agree_and_both_meet_the_exact_motion():
    scene, train, lift = kodama()
    speed = scene.cam_speed(6000)
    state = np.asarray(rest_state(train)).ravel()
    scan = prepare(train, lift, speed)(state)
    driven, angle = DrivenSystem(build_system(train), jnp.asarray(lift_samples(lift)), speed), equal_grid(LIFT_SAMPLES)
    found = tsit5_states(driven, rest_state(train), angle, LAYER, 1e-11)
    check = Response(train, speed, angle, *map(np.asarray, found[1:5]))
    exact = prepare_exact(train, lift, speed)(state)
    # 2e-9 m of layer at 0.1 to 1 m/s shift the motion by 1e-5 mm or less; diffrax steps over the layers: 8e-5 mm
    assert valve_difference_mm(scan, exact) < 2e-5
    assert valve_difference_mm(scan, check) < 3e-4
    assert np.max(scan.force[:, 1]) == pytest.approx(np.max(exact.force[:, 1]), rel=5e-3)  # sampled peaks


@pytest.mark.long
def test_equal_steps_come_near_the_refined_motion():
    """Steps that run over the layers are of first order only, however high the order between events."""
    scene, train, lift = kodama()
    speed = scene.cam_speed(6000)
    state = np.asarray(rest_state(train)).ravel()
    wide = Layer(1e-6)
    fine = prepare(train, lift, speed, eps=wide.eps)(state)
    driven, errors = DrivenSystem(build_system(train), jnp.asarray(lift_samples(lift)), speed), []
    for steps in (1440, 23040):
        equal = compiled_response(driven, rest_state(train), wide, steps=steps, refine=False)
        errors.append(valve_difference_mm(Response(train, speed, *map(np.asarray, equal[:5])), fine))
    assert errors[0] > 10 * errors[1]
    assert errors[1] < 1e-3


def test_too_few_steps_are_refused_and_bad_arguments_named(monkeypatch):
    monkeypatch.setattr("camopt.smooth.simulate.MOST_GRID_STEPS", 8192)  # each grid is a program of its own
    scene, train, lift = kodama()
    speed = scene.cam_speed(5000)
    state = np.asarray(rest_state(train)).ravel()
    driven = DrivenSystem(build_system(train), jnp.asarray(lift_samples(lift)), speed)
    arrays = compiled_response(driven, rest_state(train), steps=256)
    assert np.all(np.isnan(arrays.x))
    with pytest.raises(MotionRefused, match="no grid"):
        prepare(train, lift, speed)(np.full_like(state, np.nan))
    with pytest.raises(InputError, match="eps"):
        prepare(train, lift, speed, eps=0.0)
