"""Motions known in closed form: two masses that collide, a ball on damped ground, and their exact derivatives."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from camopt.smooth.laws import Layer
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import response_arrays
from camopt.smooth.system import build_system
from tests.exact.small_trains import collision
from tests.smooth.trains import ball

FLAT = np.zeros((3, 2))
SPEED = 2 * np.pi / 4e-3  # one revolution is 4 ms
EPS = 1e-9


def final_state(system, x, v):
    y0 = jnp.stack([jnp.asarray(x), jnp.asarray(v)])
    motion = response_arrays(DrivenSystem(system, jnp.asarray(FLAT), SPEED), y0, Layer(EPS), 1e-11, steps=1024)
    return motion.x[-1], motion.v[-1]


@pytest.mark.long
def test_an_elastic_collision_conserves_energy_and_knows_its_derivative_by_mass():
    m1, m2, v1, v2 = 0.05, 0.03, 1.2, 0.2
    system = build_system(collision(m1, m2, 8e7))

    def leaving(mass):
        return final_state(eqx.tree_at(lambda s: s.mass, system, mass), [-1e-3, 0.0], [v1, v2])[1]

    velocity = leaving(system.mass)
    total = m1 + m2
    expected = [((m1 - m2) * v1 + 2 * m2 * v2) / total, ((m2 - m1) * v2 + 2 * m1 * v1) / total]
    np.testing.assert_allclose(velocity, expected, rtol=1e-6)  # an undamped layer is conservative whatever its width
    by_m1 = jax.jit(jax.jacfwd(leaving))(system.mass)[:, 0]
    np.testing.assert_allclose(by_m1, 2 * m2 * (v1 - v2) / total**2, rtol=1e-3)


def restitution(mass, stiffness, damping) -> tuple[float, float, float]:
    """Time in contact, height over speed at release and rebound over impact speed, of the damped contact."""
    decay = damping / (2 * mass)
    frequency = np.sqrt(stiffness / mass - decay**2)

    def depth(t):
        return np.exp(-decay * t) * np.sin(frequency * t) / frequency

    def rate(t):
        return np.exp(-decay * t) * (np.cos(frequency * t) - decay / frequency * np.sin(frequency * t))

    release = brentq(lambda t: stiffness * depth(t) + damping * rate(t), 0.5 / frequency, 1.01 * np.pi / frequency)
    return release, -depth(release), -rate(release)


@pytest.mark.parametrize("damping", [300.0, *(pytest.param(d, marks=pytest.mark.long) for d in (0.0, 857.0))])
def test_a_damped_bounce_and_its_derivatives_by_height_and_speed(damping):
    """The jump of the force at closing makes the derivative jump (saltation): dropping it misses by the damping."""
    mass, stiffness, height, speed, duration = 0.05, 7e7, 1e-3, 1.0, 4e-3
    release, lift_off, ratio = restitution(mass, stiffness, damping)
    system = build_system(ball(mass, stiffness, damping))

    def landing(height, speed):
        x, v = final_state(system, height[None], -speed[None])
        return jnp.stack([x[0], v[0]])

    arguments = jnp.asarray(height), jnp.asarray(speed)
    flight = duration - height / speed - release
    x, v = jax.jit(landing)(*arguments)
    by_height, by_speed = jax.jit(jax.jacrev(landing, argnums=(0, 1)))(*arguments)
    # the layer takes damping * eps / mass = 2e-5 m/s at most; the derivative sees its square root: 1e-3
    assert v == pytest.approx(ratio * speed, rel=1e-4)
    assert x == pytest.approx(speed * (lift_off + ratio * flight), rel=1e-4)
    assert by_height[0] == pytest.approx(-ratio, rel=1e-3)
    assert by_speed[0] == pytest.approx(lift_off + ratio * flight + ratio * height / speed, rel=1e-3)
    assert by_speed[1] == pytest.approx(ratio, rel=1e-3)
    assert abs(by_height[1]) < 1e-3 * ratio / duration  # the rebound speed does not depend on the height


@pytest.mark.long
def test_no_nan_over_initial_gaps_and_speeds():
    system = build_system(ball(0.05, 7e7, 857.0))
    gaps = jnp.asarray([-1e-6, -EPS, -EPS / 2, 0.0, EPS / 2, EPS, 1e-6, 1e-4])
    speeds = jnp.asarray([-0.5, 0.0, 1e-9, 0.5])
    gap, speed = (q.ravel() for q in jnp.meshgrid(gaps, speeds))

    def end(gap, speed):
        x, v = final_state(system, gap[None], -speed[None])
        return x[0] + 1e-4 * v[0]

    value, (by_gap, by_speed) = jax.jit(jax.vmap(jax.value_and_grad(end, argnums=(0, 1))))(gap, speed)
    assert np.all(np.isfinite(value)) and np.all(np.isfinite(by_gap)) and np.all(np.isfinite(by_speed))


def test_the_derivative_of_a_damped_bounce_meets_its_limit_as_the_square_root_of_eps():
    """The layer lasts eps / speed and the damper's force rises within it: what is left of it falls with eps."""
    mass, stiffness, damping, height, speed = 0.05, 7e7, 857.0, 1e-3, 1.0
    _, _, ratio = restitution(mass, stiffness, damping)
    system = build_system(ball(mass, stiffness, damping))

    @jax.jit
    def by_height(height, eps):
        def end(height):
            y0 = jnp.stack([height[None], jnp.asarray([-speed])])
            driven = DrivenSystem(system, jnp.asarray(FLAT), SPEED)
            return response_arrays(driven, y0, Layer(eps), 1e-11, steps=1024).x[-1, 0]

        return jax.grad(end)(height)

    errors = [abs(float(by_height(jnp.asarray(height), eps)) / -ratio - 1.0) for eps in (1e-6, 1e-7, 1e-8, 1e-9)]
    assert errors[-1] < 1e-3
    assert errors[0] > 10 * errors[-1]
