"""Nonlinear elastic laws on the smooth path: the law itself, a collision, rest, kodama-hertz and its gradient."""

from dataclasses import replace
from functools import cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.scene import build_train, load_scene, rest_position
from camopt.scene.laws import HERTZ, LINEAR, PROGRESSIVE
from camopt.scene.rest import state_at_rest
from camopt.smooth.laws import Layer, elastic_laws
from camopt.smooth.rest import rest_of, rest_state
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import lift_samples, prepare, response_arrays
from camopt.smooth.system import build_system
from camopt.verifier.methods import dop853, rkg
from tests.smooth.trains import ball
from tests.verifier.trains import laws

ROWS = np.array([[-1e-4, 1e6], [2e-5, 2e6], [1e-4, 2e7]])
KINDS = np.array([LINEAR, HERTZ, PROGRESSIVE])
MIXED = laws(KINDS, [3e6, 3e10, 1.8e6], [1.0, 1.4, 1.0], ROWS)
PRELOAD = np.array([40.0, 25.0, -30.0])


def test_force_and_touch_are_those_of_the_scene():
    ours = elastic_laws(MIXED, jnp.float64)
    touch = ours.touch(jnp.asarray(MIXED.coefficient), jnp.asarray(PRELOAD))
    np.testing.assert_allclose(touch, MIXED.touch(PRELOAD), rtol=1e-12)
    for d in (-5e-4, -1e-4, -3e-6, 0.0, 1e-5, 2e-5, 7e-5, 4e-4):
        force = ours.force(d - touch, jnp.asarray(MIXED.coefficient), jnp.asarray(PRELOAD))
        np.testing.assert_allclose(force, MIXED.force(np.full(3, d), PRELOAD), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(ours.stand_in(jnp.asarray(MIXED.coefficient))[1], MIXED.stand_in()[1])


@pytest.mark.long
def test_derivatives_of_force_and_touch_are_central_differences():
    def both(u, stiffness, preload, table):
        ours = eqx.tree_at(lambda q: q.table, elastic_laws(MIXED, jnp.float64), table)
        return ours.force(u, stiffness, preload) + 1e6 * ours.touch(stiffness, preload)

    at = (jnp.array([1e-5, 2e-5, 7e-5]), jnp.asarray(MIXED.coefficient), jnp.asarray(PRELOAD), jnp.asarray(MIXED.table))
    rng = np.random.default_rng(1)
    away = tuple(1e-5 * q * jnp.asarray(rng.uniform(-1, 1, q.shape)) for q in at)
    _, slope = jax.jvp(both, at, away)
    high, low = (both(*(q + s * a for q, a in zip(at, away, strict=True))) for s in (1.0, -1.0))
    np.testing.assert_allclose(slope, (high - low) / 2, rtol=1e-6)


@pytest.mark.long
def test_an_unloaded_hertz_contact_has_finite_derivatives():
    hertz = replace(ball(0.05, 1e8, 0.0), laws=laws([HERTZ], 3e10, 1.5, ROWS))
    system = build_system(hertz)

    def force(system, x):
        return system.force(jnp.stack([x, jnp.zeros(1)]), 0.0, 0.0, Layer(1e-8))[0]

    for x in (-1e-6, -4e-9, 0.0, 4e-9, 1e-3):
        gradient = jax.grad(force, argnums=(0, 1))(system, jnp.array([x]))
        assert all(np.all(np.isfinite(q)) for q in jax.tree.leaves(gradient))
    assert gradient[1][0] == 0.0


@pytest.mark.long
def test_rates_of_a_hertz_force_have_derivatives_apart_and_pressed():
    coefficient, exponent = 3e10, 1.5
    law = elastic_laws(laws([HERTZ], coefficient, exponent, ROWS), float)
    force = lambda u: law.force(jnp.array([u]), jnp.array([coefficient]), jnp.zeros(1))[0]  # noqa: E731
    rate_slope = jax.grad(lambda u: jax.jvp(force, (u,), (2.0,))[1])
    assert [float(rate_slope(u)) for u in (-1e-6, 0.0)] == [0.0, 0.0]
    assert float(rate_slope(1e-6)) == pytest.approx(2.0 * coefficient * exponent * (exponent - 1.0) * 1e-6**-0.5)


def test_hertz_collision_presses_and_lasts_as_known():
    """Hertz: m v^2 / 2 = k d^2.5 / 2.5, contact time 2.9432 d / v."""
    mass, speed, coefficient = 0.05, 1.2, 3e10
    hertz = laws([HERTZ], coefficient, 1.5, ROWS)
    system = build_system(replace(ball(mass, 1e8, 0.0), laws=hertz))
    y0 = jnp.array([[1e-4], [-speed]])
    driven = DrivenSystem(system, jnp.zeros((3, 2)), 2 * np.pi / 4e-4)
    motion = response_arrays(driven, y0, Layer(1e-9), 1e-12, steps=1024)
    deepest = (2.5 * mass * speed**2 / (2 * coefficient)) ** 0.4
    assert -motion.x.min() == pytest.approx(deepest, rel=1e-4)
    assert motion.v[-1, 0] == pytest.approx(speed, rel=1e-7)
    flight = 4e-4 - 2.94320 * deepest / speed
    assert motion.x[-1, 0] == pytest.approx(speed * flight - 1e-4, rel=1e-4)


def test_rest_and_its_derivative():
    train = build_train(load_scene("kodama-hertz"))
    system = build_system(train)
    np.testing.assert_allclose(rest_state(train)[0], rest_position(train), rtol=1e-9, atol=1e-15)
    press = train.element_names.index("cam_follower")
    by_stiffness = jax.jacfwd(lambda s: rest_of(s)[0])(system).stiffness[:, press]
    u = (19.1 / 2.3138e10) ** (2 / 3)  # the follower sinks by u, held by 19.1 N: du/dk = -2 u / (3 k)
    assert by_stiffness[1] == pytest.approx(2 * u / (3 * 2.3138e10), rel=1e-6)


@cache
def hertz(speed_rpm: float):
    scene = load_scene("kodama-hertz")
    train, lift = build_train(scene), polydyne(scene)
    state = state_at_rest(train)
    located = dop853.prepare(train, lift, scene.cam_speed(speed_rpm), 2880)(state)
    return train, lift, scene.cam_speed(speed_rpm), state, located


def apart(one, other) -> float:
    """Largest difference of the valve's position [m] between records, at every half degree."""
    grid = np.radians(np.linspace(-180, 180, 721))
    valve = one.train.valve
    return float(
        np.abs(np.interp(grid, one.angle, one.x[:, valve]) - np.interp(grid, other.angle, other.x[:, valve])).max()
    )


@pytest.mark.long
def test_three_paths_agree_on_kodama_hertz():
    train, lift, cam_speed, state, located = hertz(5000)
    gill = rkg.prepare(train, lift, cam_speed, 115_200)(state)
    smooth = prepare(train, lift, cam_speed)(state)
    # the valve moves 9 mm; the records are read linearly between samples 0.05 to 0.125 deg apart: 2e-8 m
    assert apart(gill, located) < 5e-8
    assert apart(smooth, located) < 2e-7
    force = [float(q.force[:, train.cam_side[0]].max()) for q in (located, gill, smooth)]
    assert force[1:] == pytest.approx([force[0]] * 2, rel=1e-3)


def test_gradient_by_the_hertz_stiffness_is_that_of_located_dop853():
    """Highest valve position: central differences of the located motion by the tip's coefficient, 1 % either way."""
    train, lift, cam_speed, state, _ = hertz(5000)
    tip, valve = train.element_names.index("follower_valve"), train.valve
    samples, y0 = jnp.asarray(lift_samples(lift)), jnp.asarray(state).reshape(2, -1)

    def height(system):
        motion = response_arrays(DrivenSystem(system, samples, cam_speed), y0)
        at = jnp.argmax(motion.x[:, valve])
        return motion.x[at, valve]

    slope = jax.jit(jax.grad(height))(build_system(train)).stiffness[tip]

    def located(factor):
        coefficient = train.laws.coefficient.copy()
        coefficient[tip] *= factor
        changed = replace(train, laws=replace(train.laws, coefficient=coefficient))
        return dop853.prepare(changed, lift, cam_speed, 1440)(state).x[:, valve].max()

    expected = (located(1.01) - located(0.99)) / (0.02 * train.laws.coefficient[tip])
    assert slope == pytest.approx(expected, rel=0.02) and slope > 0
