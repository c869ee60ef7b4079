"""The metrics in JAX: the same values as the verifier's side from one response, and their special cases."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from camopt.exact.engine import prepare as prepare_exact
from camopt.measure.metrics import measure
from camopt.scene import QUANTITIES
from camopt.scene.response import end_state, joined
from camopt.smooth.metrics import closing, greatest, revolution_metrics
from camopt.smooth.rest import rest_state
from camopt.smooth.system import SystemState, build_system
from tests.smooth.trains import kodama

measured = partial(jax.jit, static_argnames=("revolution",))(revolution_metrics)


def exact_record(rpm: float, revolutions: int, *samples: int):
    scene, train, lift = kodama()
    revolve = prepare_exact(train, lift, scene.cam_speed(rpm), *samples)
    state, records = np.asarray(rest_state(train)).ravel(), []
    for _ in range(revolutions):
        records.append(revolve(state))
        state = end_state(records[-1])
    return joined(records), lift


def motion_of(response, lift, size: int = 8192) -> SystemState:
    """The record padded to one size, so that one program serves all: repeated samples carry no weight."""
    t, speed, angle = response.train, response.cam_speed, response.angle
    acceleration = (t.mass_force - t.mass_damping * response.v - response.force @ t.incidence) / t.mass
    cam = [t.cam_driven * (speed**order * lift(angle, order))[:, None] for order in (1, 2)]
    rate = t.stiffness * (response.v @ t.incidence.T + cam[0]) + t.damping * (acceleration @ t.incidence.T + cam[1])
    slope = np.where(response.force != 0.0, rate, 0.0) / speed
    fields = (angle, response.lift, response.x, response.v, response.force, slope, lift(angle, 1))
    return SystemState(*(jnp.asarray(np.concatenate([q, np.repeat(q[-1:], size - len(q), axis=0)])) for q in fields))


@pytest.mark.parametrize("rpm", [5000, 6000, 7000])
def test_both_sides_measure_the_same(rpm):
    response, lift = exact_record(rpm, 3, 5760)
    system, expected = build_system(response.train), measure(response, lift)
    arguments = motion_of(response, lift, 2**15), response.cam_speed, lift.half_duration, lift.opening_foot
    for r in (0, 1):
        found = measured(system, *arguments, revolution=r)
        for name in QUANTITIES:
            assert float(found[name]) == pytest.approx(expected[name][r], rel=2e-4, abs=2e-5), (name, r)


def test_a_valve_that_stays_shut_is_quiet_and_one_that_never_seats_has_no_value():
    response, lift = exact_record(5000, 1)
    system, motion = build_system(response.train), motion_of(response, lift)
    shut = motion._replace(x=jnp.zeros_like(motion.x), v=jnp.zeros_like(motion.v), force=jnp.ones_like(motion.force))
    lost = motion._replace(x=jnp.full_like(motion.x, jnp.nan), force=jnp.full_like(motion.force, jnp.nan))
    hanging = motion._replace(force=jnp.zeros_like(motion.force))
    arguments = response.cam_speed, lift.half_duration, lift.opening_foot
    quiet = measured(system, shut, *arguments)
    assert float(quiet["bounce_mm"]) == float(quiet["seating_velocity_m_per_s"]) == 0.0
    assert np.isnan(measured(system, lost, *arguments)["seating_velocity_m_per_s"])  # not zero
    slope = jax.grad(lambda x: measured(system, hanging._replace(x=x), *arguments)["seating_velocity_m_per_s"])
    assert np.isnan(measured(system, hanging, *arguments)["seating_velocity_m_per_s"])
    assert not np.any(slope(motion.x))


def test_the_touch_shifts_with_the_valve():
    """Raising the valve delays the touch by height over speed, and changes its speed by acceleration times delay."""
    response, lift = exact_record(5000, 1)
    system, motion = build_system(response.train), motion_of(response, lift)
    valve, seat, speed = response.train.valve, response.train.seat, response.cam_speed
    touch_sample = int(np.argmax((response.angle > 0) & (response.force[:, seat] > 0)))
    early = motion.angle < response.angle[touch_sample]  # without the sample on the touch: it falls inside a step
    last = int(np.flatnonzero(np.asarray(early))[-1])
    keep = np.r_[: last + 1, touch_sample + 2 : len(motion.angle)]
    coarse = SystemState(*(q[keep] for q in motion[:7]))

    def touch(height):
        raised = coarse._replace(x=coarse.x.at[last, valve].add(height))
        _, _, angle, velocity = closing(system, raised, speed, 0)
        return jnp.stack([angle / speed, velocity])

    (angle, velocity), slope = np.asarray(touch(0.0)), np.asarray(jax.jacfwd(touch)(0.0))
    assert angle * speed == pytest.approx(response.angle[touch_sample], abs=1e-6)
    assert velocity == pytest.approx(response.v[touch_sample, valve], rel=1e-3)
    assert slope[0] == pytest.approx(-1 / velocity, rel=1e-9)
    np.testing.assert_allclose(slope, (touch(1e-10) - touch(-1e-10)) / 2e-10, rtol=1e-3)


def test_an_extreme_counts_up_to_the_window_s_edge_and_not_beyond():
    angle = jnp.linspace(-1.0, 1.0, 21)
    dip, slope = (angle - 0.23) ** 2, 2 * (angle - 0.23)
    assert float(-greatest(angle, -dip, -slope, (-0.9, 0.24))) == pytest.approx(0.0, abs=1e-12)
    assert float(-greatest(angle, -dip, -slope, (-0.9, 0.21))) == pytest.approx(0.03**2)  # the sample; edges are apart
