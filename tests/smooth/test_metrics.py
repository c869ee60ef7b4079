"""The metrics in JAX: the same values as the verifier's side from one response, and their special cases."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from camopt.exact.engine import prepare as prepare_exact
from camopt.measure.metrics import measure
from camopt.scene import QUANTITIES
from camopt.scene.response import end_state, joined
from camopt.scene.units import MM
from camopt.smooth.maxima import soft_least, soft_worst, soft_worst_bias
from camopt.smooth.metrics import closing, greatest, least, revolution_metrics, soft_metrics
from camopt.smooth.rest import rest_state
from camopt.smooth.system import SystemState, build_system
from tests.smooth.trains import kodama

measured = partial(jax.jit, static_argnames=("revolution",))(revolution_metrics)


def exact_record(rpm: float, revolutions: int):
    scene, train, lift = kodama()
    revolve = prepare_exact(train, lift, scene.cam_speed(rpm))
    state, records = np.asarray(rest_state(train)).ravel(), []
    for _ in range(revolutions):
        records.append(revolve(state))
        state = end_state(records[-1])
    return joined(records), lift


def motion_of(response, size: int = 8192) -> SystemState:
    """The record padded to one size, so that one program serves all: repeated samples carry no weight."""
    fields = (response.angle, response.lift, response.x, response.v, response.force)
    return SystemState(*(jnp.asarray(np.concatenate([q, np.repeat(q[-1:], size - len(q), axis=0)])) for q in fields))


@pytest.mark.parametrize("rpm", [5000, 6000, 7000])
def test_both_sides_measure_the_same(rpm):
    response, lift = exact_record(rpm, 3)
    system, expected = build_system(response.train), measure(response, lift)
    arguments = motion_of(response), response.cam_speed, lift.half_duration, lift.opening_foot
    for r in (0, 1):
        found = measured(system, *arguments, revolution=r)
        for name in QUANTITIES:
            # a crest between samples: the largest of cubics there, of samples and parabolas here
            assert float(found[name]) == pytest.approx(expected[name][r], rel=2e-4, abs=2e-5), (name, r)


def test_a_valve_that_stays_shut_is_quiet_and_one_that_never_seats_has_no_value():
    response, lift = exact_record(5000, 1)
    system, motion = build_system(response.train), motion_of(response)
    shut = motion._replace(x=jnp.zeros_like(motion.x), v=jnp.zeros_like(motion.v), force=jnp.ones_like(motion.force))
    lost = motion._replace(x=jnp.full_like(motion.x, jnp.nan), force=jnp.full_like(motion.force, jnp.nan))
    hanging = motion._replace(force=jnp.zeros_like(motion.force))
    arguments = response.cam_speed, lift.half_duration, lift.opening_foot
    assert float(measured(system, shut, *arguments)["bounce_mm"]) == 0.0
    assert float(measured(system, shut, *arguments)["seating_velocity_m_per_s"]) == 0.0
    assert np.isnan(measured(system, lost, *arguments)["seating_velocity_m_per_s"])  # not zero
    slope = jax.grad(lambda x: measured(system, hanging._replace(x=x), *arguments)["seating_velocity_m_per_s"])
    assert np.isnan(measured(system, hanging, *arguments)["seating_velocity_m_per_s"])
    assert not np.any(slope(motion.x))


def test_the_touch_shifts_with_the_valve():
    """Raising the valve delays the touch by height over speed, and changes its speed by acceleration times delay."""
    response, _ = exact_record(5000, 1)
    system, motion = build_system(response.train), motion_of(response)
    valve, seat, speed = response.train.valve, response.train.seat, response.cam_speed
    touch_sample = int(np.argmax((response.angle > 0) & (response.force[:, seat] > 0)))
    early = motion.angle < response.angle[touch_sample]  # without the sample on the touch: it falls inside a step
    last = int(np.flatnonzero(np.asarray(early))[-1])
    keep = np.r_[: last + 1, touch_sample + 2 : len(motion.angle)]
    coarse = SystemState(*(q[keep] for q in motion[:5]))

    def touch(height):
        raised = coarse._replace(x=coarse.x.at[last, valve].add(height))
        found = closing(system, raised, speed, 0)
        return jnp.stack([found.angle / speed, found.velocity])

    (angle, velocity), slope = np.asarray(touch(0.0)), np.asarray(jax.jacfwd(touch)(0.0))
    assert angle * speed == pytest.approx(response.angle[touch_sample], abs=1e-6)
    assert velocity == pytest.approx(response.v[touch_sample, valve], rel=1e-3)
    assert slope[0] == pytest.approx(-1 / velocity, rel=1e-9)
    step = 1e-10
    difference = (touch(step) - touch(-step)) / (2 * step)
    np.testing.assert_allclose(np.asarray(slope), np.asarray(difference), rtol=1e-3)


def test_an_extreme_counts_up_to_the_window_s_edge_and_not_beyond():
    angle = jnp.linspace(-1.0, 1.0, 21)
    dip, slope = (angle - 0.23) ** 2, 2 * (angle - 0.23)
    for edge, lowest in ((0.21, 0.02**2), (0.24, 0.0)):  # both between the samples at 0.2 and 0.3
        assert float(least(angle, dip, (-0.9, edge))) == pytest.approx(lowest, abs=1e-12)
    assert float(-greatest(angle, -dip, -slope, (-0.9, 0.24))) == pytest.approx(0.0, abs=1e-12)
    assert float(-greatest(angle, -dip, -slope, (-0.9, 0.21))) == pytest.approx(0.03**2)  # the sample; edges are apart


def test_the_soft_least_lies_within_its_stated_bound():
    angle = jnp.linspace(-1.0, 1.0, 2001)
    force = 100.0 + 400.0 * angle**2
    keep = jnp.abs(angle) <= 0.8
    for width in (1.0, 10.0):
        soft = float(soft_least(angle, force, keep, width))
        stay = 2 * np.sqrt(width / 400.0)
        assert 100.0 < soft < 100.0 + width * np.log(1.6 / stay) + width
    assert float(soft_least(angle, force, keep, 0.1)) == pytest.approx(100.0, abs=0.5)


def test_the_soft_worst_has_its_stated_bias_and_shares_a_tie():
    values = jnp.asarray([1.0, 3.0, 3.0, -2.0])
    for width in (0.1, 1.0):
        bias = float(soft_worst(values, width)) - 3.0
        assert width * np.log(2) - 1e-12 <= bias <= soft_worst_bias(4, width)
    assert soft_worst_bias(4, 0.5) == pytest.approx(0.5 * np.log(4))
    assert float(soft_worst(jnp.full(4, 2.0), 0.5)) == pytest.approx(2.0 + 0.5 * np.log(4))  # the upper end
    np.testing.assert_allclose(jax.grad(soft_worst)(values, 0.05), [0.0, 0.5, 0.5, 0.0], atol=1e-9)


def stated_bias(motion, values, width, half):
    """Bias that `camopt.smooth.maxima` states for the soft greatest of `values` (k, contacts), from the record: what
    the middles between samples miss of a peak, and the angle that they stay within a width of it."""
    inside = np.abs(motion.angle) <= half
    weight = np.where(inside[1:] & inside[:-1], np.diff(motion.angle), 0.0)
    middle = np.where(weight[:, None] > 0, 0.5 * (values[1:] + values[:-1]), -np.inf)
    stay = weight[np.any(middle > middle.max() - width, axis=1)].sum()
    missed = values[inside].max() - middle.max()
    return missed + width * (np.log(weight.sum() / stay) + 1 + np.log(values.shape[1]))


def test_soft_metrics_approach_the_hard_ones_within_their_bias():
    response, lift = exact_record(6500, 1)  # the contacts part
    system, motion = build_system(response.train), motion_of(response)
    hard = measured(system, motion, response.cam_speed, lift.half_duration, lift.opening_foot)
    pick = list(response.train.cam_side)
    gap = -(response.train.compression(response.x, response.lift) - response.train.touch_compression)[:, pick] / MM
    force = response.force[:, pick]
    errors = []
    for share in (1.0, 0.1):
        mm, newton = 1e-2 * share, 50.0 * share
        soft = jax.jit(soft_metrics)(system, motion, lift.half_duration, mm, newton)
        errors.append({name: abs(float(soft[name] - hard[name])) for name in soft})
        known = {"jump_mm": (gap, mm), "contact_force_min_N": (-force, newton), "contact_force_max_N": (force, newton)}
        for name, (values, width) in known.items():
            bias = stated_bias(response, values, width, lift.half_duration)
            assert errors[-1][name] < bias, name
            assert bias < 30 * width or name == "contact_force_max_N"  # a blow's peak lasts no sample
    assert all(errors[1][name] < 0.5 * errors[0][name] for name in ("jump_mm", "contact_force_min_N"))
    closed = motion._replace(lift=motion.lift + 1e-2)  # pressed by a centimetre: the hard jump is flat there
    first = dataclasses.replace(system, topology=system.topology._replace(cam_side=system.topology.cam_side[:1]))
    assert float(measured(first, closed, response.cam_speed, lift.half_duration, lift.opening_foot)["jump_mm"]) == 0.0
    assert float(soft_metrics(first, closed, lift.half_duration, 1e-3, 1.0)["jump_mm"]) < -1.0
