"""A train of every element against located DOP853, and its gradients against central differences of the motion."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from camopt.cam.families.exponent import exponent
from camopt.exact import prepare, settled_metrics
from camopt.exact.adjoint.metrics import evaluate
from camopt.exact.adjoint.motion import OBSERVATIONS, Samples, TracedMotion, metric_numbers, value_and_gradient
from camopt.measure.metrics import measure
from camopt.scene import build_train, parse_scene
from camopt.scene.response import end_state, joined
from camopt.scene.rest import state_at_rest
from camopt.scene.units import MM
from tests.exact.gradient_problems import assert_slopes, by_train, differences, least_error
from tests.measure.raw_motion import Equations, raw_motion, samples

SCENE = parse_scene((Path(__file__).parents[1] / "scene" / "real.toml").read_text(), "real.toml")
METRICS = ["bounce_mm", "jump_mm", "contact_force_max_N", "seating_velocity_m_per_s", "dynamic_area_mm_deg"]
STEPS = 10.0 ** np.arange(-3.0, -6.5, -0.5)
SLOW, FAST = 2000, 4000
"""Crank speeds [r/min]; at the slow one no contact parts inside the event."""


@cache
def real():
    return build_train(SCENE), exponent(SCENE)


def loaded(train):
    """The state at rest but for oil under 60 N: no column on the base circle is on the edge between full and empty."""
    state = state_at_rest(train)
    state[-1] -= train.laws.travel[-1] + 60.0 / train.laws.coefficient[-1]
    return state


def with_numbers(train, name, value):
    """The train with other numbers under a name of `ByTrain`."""
    if name != "forcing":
        return train.with_parameters({name: value})
    cut = np.cumsum([len(force.angle) for force in train.forcing])[:-1]
    parts = zip(train.forcing, np.split(value, cut), strict=True)
    return replace(train, forcing=tuple(replace(force, force=part) for force, part in parts))


def number(train, name):
    return np.concatenate([f.force for f in train.forcing]) if name == "forcing" else train.parameters[name]


def direction(train, name):
    """Changes of the numbers under a name, in proportion to their values; those that no law reads do not matter.

    They are so large that rounding, which depends on the processor, leaves less than 1e-5 of a difference.
    """
    value = number(train, name)
    size = {"mass_damping": 50.0, "mass_force": 10.0, "gap": 1e-5, "forcing": 50.0, "travel": 1e-6, "dissipation": 1.0}
    move = np.cos(np.arange(value.size)).reshape(value.shape) * size.get(name, np.abs(value))
    if name == "forcing":
        move[[0, 1, -1]] = 0.0  # at rest, oil neither full nor empty, there is a gradient to either side only
    if name == "table":
        move = 1e-2 * move * (np.arange(value.shape[1]) < 4)[:, None]
    return 0.1 * move if name == "preload" else move


def middle(series):
    return 0.5 * (series[1:] + series[:-1])


def test_first_revolution_agrees_with_located_dop853():
    train, lift = real()
    angles, equations = np.linspace(-np.pi, np.pi, 721), Equations(SCENE, lift, FAST)
    stretches = raw_motion(equations, loaded(train), np.pi)
    theirs = samples(equations, stretches, angles)[1]
    ours = TracedMotion(train, lift, SCENE.cam_speed(FAST), loaded(train)).at(angles)
    assert theirs[:, 1].max() > 5 * MM, "the valve passes the corner of the spring's table"
    assert np.abs(ours.x - theirs[:, :2]).max() < 1e-6 * MM
    assert np.abs(ours.memory - theirs[:, 4:]).max() < 1e-6 * MM
    assert np.abs(ours.v - theirs[:, 2:4]).max() < 1e-6
    switched = [SCENE.element[e].name for a, b in pairwise(stretches) for e in a.phase if a.phase[e] != b.phase[e]]
    assert min(switched.count(name) for name in ("lifter", "guide", "seat")) >= 2


def test_energy_balances():
    """What the cam and the gas put in goes into motion and into the elements, by trapezia between samples."""
    train, lift = real()
    r = prepare(train, lift, SCENE.cam_speed(SLOW), 14_400)(state_at_rest(train))
    gas, d = train.forcing[0].at(r.angle), train.compression(r.x, r.lift)
    into_elements = np.sum(middle(r.force) * np.diff(d, axis=0), axis=1)
    put_in = middle(r.force[:, 0]) * np.diff(r.lift) + middle(gas) * np.diff(r.x[:, 1])
    kinetic = 0.5 * r.v**2 @ train.mass
    balance = np.cumsum(into_elements - put_in) + kinetic[1:] - kinetic[0]
    assert np.abs(balance).max() < 1e-4 * np.sum(np.abs(put_in))


@pytest.mark.parametrize("rpm", [SLOW, FAST])
def test_the_end_of_a_revolution_by_every_number(rpm):
    train, lift = real()
    speed, start = SCENE.cam_speed(rpm), loaded(train)
    weight = np.array([1.0, 1.0, 1e-3, 1e-3, 1.0, 1.0])
    slopes = TracedMotion(train, lift, speed, start, mechanical=True).pull_back(ends=np.diag(weight))
    for name in vars(by_train(slopes)):
        value, move = number(train, name), direction(train, name)
        exact = np.sum((getattr(by_train(slopes), name) * move).reshape(len(weight), -1), axis=1)

        def ends(h, name=name, value=value, move=move):
            return TracedMotion(with_numbers(train, name, value + h * move), lift, speed, start).end * weight

        assert least_error(exact, differences(ends, STEPS)) < 1e-5, name
    for i in range(len(start)):
        move = np.eye(len(start))[i] * (1e-1 if 2 <= i < 4 else 1e-4)
        reference = differences(lambda h, m=move: TracedMotion(train, lift, speed, start + h * m).end * weight, STEPS)
        assert least_error(slopes.by_start @ move, reference) < 1e-5, i


@pytest.mark.parametrize("rpm", [SLOW, FAST])
def test_metrics_by_every_number_from_rest(rpm):
    train, lift = real()
    speed = SCENE.cam_speed(rpm)
    found = value_and_gradient(train, lift, speed, METRICS, mechanical=True)
    for name in vars(by_train(found)):
        value, move = number(train, name), direction(train, name)
        exact = np.sum((getattr(by_train(found), name) * move).reshape(len(METRICS), -1), axis=1)

        def values(h, name=name, value=value, move=move):
            moved = with_numbers(train, name, value + h * move)
            return TracedMotion(moved, lift, speed, state_at_rest(moved)).values(METRICS)

        reference = differences(values, STEPS)
        assert_slopes(exact, reference, [f"{metric} by {name}" for metric in METRICS], 1e-5)


def test_any_function_of_samples_and_of_the_end():
    train, lift = real()
    speed, start = SCENE.cam_speed(FAST), loaded(train)
    motion, angles = TracedMotion(train, lift, speed, start, mechanical=True), np.array([-1.0, -0.5, 0.3, 1.0, 2.5])
    random, scale = np.random.default_rng(1), {"v": 1e-3, "lift_rate": 1e-3, "force": 1e-6}
    shapes = {name: (1, *np.shape(part)) for name, part in vars(motion.at(angles)).items()}
    bars = Samples(**{name: random.normal(size=shape) * scale.get(name, 1.0) for name, shape in shapes.items()})
    ends = random.normal(size=(1, len(start))) * np.array([1.0, 1.0, 1e-3, 1e-3, 1.0, 1.0])
    slopes = motion.pull_back(angles, bars, ends)
    change = random.normal(size=lift.coefficients.shape) * np.abs(lift.coefficients)

    def total(h, by_cam):
        moved = replace(lift, coefficients=lift.coefficients + h * by_cam * change)
        stiffer = with_numbers(train, "stiffness", number(train, "stiffness") * (1 + h * (1 - by_cam)))
        moving = TracedMotion(stiffer, moved, speed, start)
        parts = vars(moving.at(angles)).items()
        return np.array([sum(np.sum(getattr(bars, name)[0] * part) for name, part in parts) + ends[0] @ moving.end])

    exact = np.sum(slopes.by_coefficients * change, axis=(1, 2))
    assert least_error(exact, differences(lambda h: total(h, 1.0), STEPS * 1e-2)) < 1e-5
    stiffer = by_train(slopes).stiffness @ number(train, "stiffness")
    assert least_error(stiffer, differences(lambda h: total(h, 0.0), STEPS)) < 1e-5


def test_a_periodic_motion_carries_its_memories():
    """The settled state with slow leakage, found by Newton's method on the cycle map's Jacobian."""
    train, lift = real()
    speed, state = SCENE.cam_speed(SLOW), state_at_rest(train)
    for _ in range(8):
        jacobian = TracedMotion(train, lift, speed, state).pull_back(ends=np.eye(len(state))).by_start
        after = prepare(train, lift, speed).advance(state)
        state = state + np.linalg.lstsq(np.eye(len(state)) - jacobian, after - state, rcond=1e-9)[0]
    assert np.abs(prepare(train, lift, speed).advance(state) - state).max() < 1e-9


def sinks():
    """The train with an adjuster that leaks fast and whose plunger spring hardly pushes, and a valve that comes down
    late at 5000 r/min: at the touch the adjuster is still shorter than at the opening foot."""
    weak = {"preload_N": 0.5, "spring_N_per_m": 10.0, "leak_N_s_per_m": 1.0e5}
    elements = tuple(e.model_copy(update=weak) if e.kind == "adjuster" else e for e in SCENE.element)
    train = build_train(SCENE.model_copy(update={"element": elements}))
    return replace(train, mass_damping=train.mass_damping + np.array([0.0, 100.0])), SCENE.cam_speed(5000)


def test_the_nominal_closing_counts_what_has_leaked():
    """The valve is where the compiled metric has it at the nominal closing, and so is that of the sampled record."""
    (train, speed), lift = sinks(), real()[1]
    found = value_and_gradient(train, lift, speed, ["bounce_mm"])
    revolve = prepare(train, lift, speed, 7200)
    first = revolve(state_at_rest(train))
    record = joined([first, revolve(end_state(first))])
    s, z = first.seat_separation(), first.memory[:, train.memory.index(train.adjusters[0])]
    touch = first.angle[np.argmax((s <= 0.0) & (first.angle > first.angle[np.argmax(s)]))]
    leaked = np.interp(touch, first.angle, z) - np.interp(lift.opening_foot, first.angle, z)
    assert leaked > 5e-6 and touch > lift.closing_angle(leaked) + 0.03
    assert found.values[0] * MM == pytest.approx(np.interp(lift.closing_angle(leaked), first.angle, s), rel=1e-3)
    assert measure(record, lift)["bounce_mm"][0] == pytest.approx(found.values[0], rel=1e-5)
    motion, numbers = TracedMotion(train, lift, speed, state_at_rest(train)), metric_numbers(train, ["bounce_mm"])
    seeds = motion._seeds(OBSERVATIONS)
    evaluate(motion.setting, motion.trace, seeds, numbers, np.ones(1), 0, np.empty((1, 2)))
    assert seeds.used[0] == OBSERVATIONS - 1, "there is room for these instants and that of a kink"


@pytest.mark.parametrize("name", ["mass", "stiffness", "leak", "gap", "forcing"])
def test_a_bounce_at_the_nominal_closing_by_the_numbers(name):
    (train, speed), lift = sinks(), real()[1]
    found = value_and_gradient(train, lift, speed, ["bounce_mm"], mechanical=True)
    value, move = number(train, name), direction(train, name)
    exact = np.array([np.sum(getattr(by_train(found), name) * move)])

    def values(h):
        moved = with_numbers(train, name, value + h * move)
        return TracedMotion(moved, lift, speed, state_at_rest(moved), 2).values(["bounce_mm"])

    assert least_error(exact, differences(values, STEPS)) < 1e-5


def test_the_settled_path_measures_what_a_traced_motion_does():
    train, lift = real()
    speeds = [SCENE.cam_speed(rpm) for rpm in (SLOW, FAST)]
    found = settled_metrics([train], [lift], speeds)
    assert not found.refused.any() and found.states.shape == (1, 1, 2, train.state_size)
    for i in np.flatnonzero(found.periodic[0, 0]):
        again = TracedMotion(train, lift, speeds[i], found.states[0, 0, i], 2).values(METRICS)
        for metric, value in zip(METRICS, again, strict=True):
            assert value == pytest.approx(found.highest[metric][0, 0, i], abs=found.errors[metric]), metric
