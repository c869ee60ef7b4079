"""The smoothed contact law: C2, exact outside its layer, finite derivatives everywhere."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import camopt.smooth  # noqa: F401  (64-bit floats)
from camopt.smooth.laws import Layer, raw_force

K, C = 7.23e7, 857.0


LAYER = Layer(1e-6)


def contact_force(*numbers):
    """As `System.force` clips it."""
    force = raw_force(*numbers)
    return jnp.where(force > 0.0, force, 0.0)


def test_the_slope_is_the_derivative_of_the_ramp():
    r = jnp.linspace(-3.0, 3.0, 121)
    np.testing.assert_allclose(LAYER.slope(r), jax.vmap(jax.grad(LAYER.ramp))(r), atol=1e-14)


def test_the_ramp_is_twice_continuously_differentiable():
    curvature = jax.vmap(jax.grad(jax.grad(LAYER.ramp)))
    r = jnp.linspace(-0.7, 0.7, 14001)
    step = np.abs(np.diff(curvature(r)))
    assert np.max(step) < 7e-4  # S'' has slope 6 at most, so 6e-4 over a step of 1e-4; a jump would show
    assert curvature(jnp.zeros(1))[0] == pytest.approx(1.5)


def test_outside_its_layer_the_law_is_the_non_smooth_one():
    rng = np.random.default_rng(3)
    u, u_dot = rng.uniform(-1e-5, 1e-5, 2000), rng.uniform(-2.0, 2.0, 2000)
    expected = np.where(u > 0, np.maximum(0.0, K * u + C * u_dot), 0.0)
    for eps in (1e-6, 1e-8):
        outside = np.abs(u) > eps / 2
        force = np.asarray(contact_force(u, u_dot, K, C, Layer(eps)))
        np.testing.assert_allclose(force[outside], expected[outside], rtol=1e-12, atol=1e-9)


def test_an_elastic_contact_pushes_at_the_touch_by_the_known_bias():
    zero = jnp.zeros(1)
    assert contact_force(zero, zero, K, C, LAYER)[0] == pytest.approx(K * 1e-6 * 3 / 32)  # S(0) = 3/32


@pytest.mark.parametrize("dtype", [jnp.float32, pytest.param(jnp.float64, marks=pytest.mark.long)])
def test_forces_never_pull_and_have_finite_derivatives(dtype):
    eps = 1e-7
    u = jnp.asarray([-1.0, -1e-3, -eps, -eps / 2, -1e-12, 0.0, 1e-12, eps / 2, eps, 1e-3, 1.0], dtype)
    u_dot = jnp.asarray([-5.0, -1e-9, 0.0, 1e-9, 5.0], dtype)
    u, u_dot = (q.ravel() for q in jnp.meshgrid(u, u_dot))
    one = jnp.ones_like(u)
    force, pull = jax.vjp(
        lambda *a: contact_force(*a[:-1], Layer(a[-1])), u, u_dot, K * one, C * one, jnp.asarray(eps, dtype)
    )
    assert force.dtype == dtype
    assert np.all(force >= 0)
    assert all(np.all(np.isfinite(g)) for g in pull(one))
