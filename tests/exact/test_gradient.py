"""The exact gradient against central differences of event-exact values, and its pieces against one another."""

from dataclasses import fields, replace

import numpy as np
import pytest

from camopt.exact import prepare
from camopt.exact.adjoint.metrics import METRICS
from camopt.exact.adjoint.motion import Samples, TracedMotion, value_and_gradient
from camopt.measure.metrics import measure
from camopt.scene import InputError
from camopt.scene.response import end_state, joined
from camopt.scene.rest import state_at_rest
from camopt.scene.units import DEG
from tests.exact.gradient_problems import (
    assert_slopes,
    by_train,
    cam_with_bumps,
    differences,
    from_rest,
    kodama,
    least_error,
    moved,
)

SHORT = [("polydyne", 6500), ("design", 6000)]
EVERY = [(cam, rpm) for cam in ("polydyne", "design") for rpm in (5000, 6000, 6500)]
CASES = [case if case in SHORT else pytest.param(*case, marks=pytest.mark.long) for case in EVERY]
COEFFICIENT_STEPS = 1e-5, 1e-6, 1e-7, 1e-8  # mm/deg^2, beside 0.015
FLOORS = 1e-5, 1e-2, 1e-5, 1e-2, 10.0, 1e-5
"""Smallest size of positions [m], velocities [m/s], lift, its velocity and forces [N] that samples are weighed by."""
PARAMETER_STEPS = 10.0 ** np.arange(-2.5, -7.0, -0.5)  # relative


@pytest.mark.parametrize(("cam", "rpm"), CASES)
def test_by_cam_coefficients(cam, rpm):
    scene, train = kodama()
    lift, bumps = cam_with_bumps(cam, 20)
    speed = scene.cam_speed(rpm)
    found = value_and_gradient(train, lift, speed, METRICS)
    exact = np.einsum("lpq,zpq->lz", found.by_coefficients, bumps)
    reference = np.stack(
        [
            differences(lambda h, b=b: from_rest(train, moved(lift, h * b), speed, METRICS), COEFFICIENT_STEPS)
            for b in bumps
        ],
        axis=-1,
    )
    assert_slopes(exact, reference, METRICS, 1e-6)
    moving = np.count_nonzero(np.any(found.by_coefficients, axis=(1, 2)))
    assert (cam, rpm) not in SHORT or moving >= (7 if cam == "polydyne" else 4)


NAMES = "mass", "mass_damping", "mass_force", "stiffness", "damping", "preload", "gap"


@pytest.mark.parametrize(
    ("cam", "rpm", "every"),
    [("polydyne", 6500, False), *(pytest.param(*case, True, marks=pytest.mark.long) for case in EVERY)],
)
def test_by_the_train(cam, rpm, every):
    """Along one direction, or every number for itself, in units of its value, the state at rest moving along."""
    scene, train = kodama()
    lift, _ = cam_with_bumps(cam, 20)
    speed = scene.cam_speed(rpm)
    found = value_and_gradient(train, lift, speed, METRICS, mechanical=True)
    for name in NAMES:
        value = getattr(train, name)
        directions = np.eye(len(value)) if every else np.cos(np.arange(len(value)))[None]
        moves = directions * np.where(value != 0, np.abs(value), {"gap": 1e-4}.get(name, 10.0))
        exact = getattr(by_train(found), name) @ moves.T

        def values(h, move, name=name, value=value):
            return from_rest(replace(train, **{name: value + h * move}), lift, speed, METRICS)

        reference = np.stack(
            [differences(lambda h, m=m: values(h, m), PARAMETER_STEPS) for m in moves],
            axis=-1,
        )
        assert_slopes(exact, reference, [f"{metric} by {name}" for metric in METRICS], 1e-5)


@pytest.mark.parametrize("metric", [m for m in METRICS if m != "contact_force_min_N"])
def test_taylor_remainder_is_of_second_order(metric):
    scene, train = kodama()
    lift, bumps = cam_with_bumps("polydyne", 20)
    speed, direction = scene.cam_speed(6000), np.tensordot(np.cos(np.arange(20.0)), bumps, 1)
    start = state_at_rest(train)
    found = value_and_gradient(train, lift, speed, [metric], start)
    slope, steps = np.sum(found.by_coefficients * direction), np.array([2e-7, 1e-7, 5e-8, 2.5e-8])
    rests = [
        abs(from_rest(train, moved(lift, h * direction), speed, [metric], start) - found.values - h * slope)[0]
        for h in steps
    ]
    slopes = np.diff(np.log(rests)) / np.diff(np.log(steps))
    assert np.median(slopes) == pytest.approx(2.0, abs=0.1)


def test_values_are_those_of_the_verifier():
    scene, train = kodama()
    lift, _ = cam_with_bumps("polydyne", 20)
    speed = scene.cam_speed(6500)
    first = prepare(train, lift, speed, 14400)(state_at_rest(train))
    record = joined([first, prepare(train, lift, speed, 14400)(end_state(first))])
    theirs = measure(record, lift)
    names = [m for m in METRICS if m in theirs]
    ours = TracedMotion(train, lift, speed, state_at_rest(train), 2).values(names)
    for name, value in zip(names, ours, strict=True):
        assert value == pytest.approx(theirs[name][0], rel=1e-5), name  # the verifier's parabola: 2e-6 of the force


def test_one_sweep_of_a_cotangent_is_the_sum_of_the_single_ones():
    scene, train = kodama()
    lift, _ = cam_with_bumps("polydyne", 20)
    motion = TracedMotion(train, lift, scene.cam_speed(6500), state_at_rest(train), mechanical=True)
    weights = np.cos(np.arange(len(METRICS)))
    single, together = motion.gradient(METRICS), motion.gradient(METRICS, cotangent=weights)
    assert together.by_start[0] == pytest.approx(weights @ single.by_start, rel=1e-9)
    for field in fields(by_train(single)):
        expected = weights @ getattr(single.by_train, field.name)
        assert getattr(together.by_train, field.name)[0] == pytest.approx(expected, rel=1e-8), field.name
    expected = np.tensordot(weights, single.by_coefficients, 1)
    assert np.abs(together.by_coefficients[0] - expected).max() < 1e-9 * np.abs(expected).max()


def test_any_function_of_samples_and_of_the_end():
    scene, train = kodama()
    lift, bumps = cam_with_bumps("polydyne", 20)
    speed, angles, random = scene.cam_speed(5000), np.linspace(-1.2, 3.0, 40), np.random.default_rng(2)
    start, change = state_at_rest(train), np.tensordot(np.cos(np.arange(20.0)), bumps, 1)
    motion = TracedMotion(train, lift, speed, start, mechanical=True)
    scale = Samples(
        *(
            1.0 / np.maximum(np.abs(part).max(axis=0), floor)
            for part, floor in zip(vars(motion.at(angles)).values(), FLOORS, strict=True)
        )
    )
    bars = Samples(*(random.normal(size=(1, 40, *np.shape(s))) * s for s in vars(scale).values()))
    ends = random.normal(size=(1, 20)) / np.repeat([1e-4, 1.0], 10)

    def number(change, train=train):
        moving = TracedMotion(train, moved(lift, change), speed, start)
        parts = zip(vars(moving.at(angles)).values(), vars(bars).values(), strict=True)
        return np.array([sum(np.sum(a * b[0]) for a, b in parts) + ends[0] @ moving.end])

    slopes = motion.pull_back(angles, bars, ends)
    exact = np.sum(slopes.by_coefficients[0] * change)
    assert least_error(np.array([exact]), differences(lambda h: number(h * change), COEFFICIENT_STEPS)) < 1e-6
    stiffer = differences(lambda h: number(0.0, replace(train, stiffness=train.stiffness * (1 + h))), PARAMETER_STEPS)
    assert least_error(by_train(slopes).stiffness @ train.stiffness, stiffer) < 1e-5


@pytest.mark.parametrize("cotangent", [None, np.array([2.0, -3.0])])
def test_motions_with_spans_on_the_borders_move_as_others(cotangent):
    scene, train = kodama()
    lift, speeds = cam_with_bumps("design", 20)[0], [scene.cam_speed(rpm) for rpm in (6500, 5000)]
    starts = np.array([value_and_gradient(train, lift, speed, []).end for speed in speeds])
    options = {"revolutions": 2, "revolution": 0, "cotangent": cotangent, "mechanical": True}
    names = ["seating_velocity_m_per_s", "jump_mm"]
    for speed, start in zip(speeds, starts, strict=True):
        found = value_and_gradient(train, lift, speed, names, start, spacing=2 * DEG, **options)
        single = value_and_gradient(train, lift, speed, names, start, **options)
        assert found.by_train is not None and single.by_train is not None
        assert found.values == pytest.approx(single.values, rel=1e-7)
        for part in ("by_coefficients", "by_start"):
            a, b = getattr(found, part), getattr(single, part)
            assert a.shape == b.shape and np.abs(a - b).max() < 1e-6 * np.abs(b).max()
        for a, b in zip(vars(found.by_train).values(), vars(single.by_train).values(), strict=True):
            assert np.abs(a - b).max() <= 1e-6 * np.abs(b).max()


def test_an_unknown_metric_is_refused():
    scene, train = kodama()
    with pytest.raises(InputError, match="no exact gradient of noise"):
        value_and_gradient(train, cam_with_bumps("design", 20)[0], scene.cam_speed(5000), ["noise"])
