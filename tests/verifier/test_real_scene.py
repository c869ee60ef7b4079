"""A scene with every element of real trains: DOP853 against itself, the other methods against it, and verdicts."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from camopt.cam.families.exponent import exponent
from camopt.measure.settling import decay_per_revolution, settle_and_measure
from camopt.scene import build_train, load_scene
from camopt.scene.train import Forcing
from camopt.scene.units import DEG, MM
from camopt.study.extremes.extremes import STEP_METHODS
from camopt.verifier import verdict
from camopt.verifier.at_speed import Case, neighbours
from camopt.verifier.convergence import StepRefinement, Tolerances
from camopt.verifier.methods import dop853
from tests.verifier.scenes import REAL, from_rest
from tests.verifier.test_dop853 import GRID

STEPS = 3600 * 4 ** np.arange(3)
SHIFTS = np.arange(1, 8)
"""Steps that are added, so that no contact closes as late after a sample at one step as at another."""


@cache
def case(speed_rpm=3000.0):
    """(train, cam, cam speed [rad/s]) and the state at rest."""
    return from_rest(REAL, speed_rpm, exponent)


def at(response) -> np.ndarray:
    """Positions and memories [m] at every half degree; Houbolt's and the others' steps need not meet them."""
    values = np.concatenate([response.x, response.memory], axis=1)
    return np.stack([np.interp(GRID, response.angle, column) for column in values.T])


@cache
def located(steps: int) -> np.ndarray:
    parts, rest = case()
    return at(dop853.prepare(*parts, steps)(rest))


def test_dop853_stands_to_a_picometre():
    apart = np.abs(located(28_800) - located(100_800)).max()
    assert apart < 1e-9 * MM
    assert np.ptp(located(28_800), axis=1).min() > 1e-3 * MM  # every mass moves, every memory changes


@pytest.mark.parametrize("name", STEP_METHODS)
def test_the_other_methods_come_to_it(name):
    (parts, rest), wanted, found = case(), located(100_800), []
    for steps in STEPS:
        runs = [STEP_METHODS[name](*parts, int(steps + shift)) for shift in SHIFTS]
        found.append(np.mean([np.abs(at(run(rest)) - wanted).max() for run in runs]))
    order = -np.polyfit(np.log(STEPS), np.log(found), 1)[0]
    assert found[-1] < 2e-4 * MM
    assert 0.75 < order


def test_the_record_holds_forces_within_their_laws():
    parts, rest = case()
    train = parts[0]
    guide, oil = (train.element_names.index(name) for name in ("guide", "lifter-oil"))
    slip, stiffness = train.laws.slip[guide], train.laws.coefficient[guide]
    for prepare in (dop853.prepare, *STEP_METHODS.values()):
        motion = prepare(*parts, 7200)(rest)
        z = dict(zip(train.memory, motion.memory.T, strict=True))
        d = train.compression(motion.x, motion.lift)
        rubs, carries = motion.force[:, guide], motion.force[:, oil]
        assert np.abs(rubs).max() == pytest.approx(slip, rel=1e-6)  # DOP853: within the permitted error
        assert np.abs(rubs - stiffness * (d[:, guide] - z[guide])).max() < 1e-3 * slip
        pressed = np.maximum(0.0, d[:, oil] - z[oil] - train.laws.travel[oil])
        assert np.abs(carries - train.laws.coefficient[oil] * pressed).max() < 1e-3 * carries.max()
        assert carries.max() > 100.0 and np.all(z[oil] <= d[:, oil] + 1e-9 * MM)


def test_the_gas_force_decelerates_the_opening_valve():
    (train, lift, cam_speed), rest = case()
    free = dop853.prepare(replace(train, forcing=()), lift, cam_speed, 7200)(rest)
    pressed = dop853.prepare(train, lift, cam_speed, 7200)(rest)
    inside = np.abs(pressed.angle + 50 * DEG) < 8 * DEG
    cam = train.element_names.index("cam")
    without = np.interp(pressed.angle[inside], free.angle, free.force[:, cam])
    assert pressed.force[inside, cam].min() > without.min() + 30.0


@pytest.mark.parametrize("name", STEP_METHODS)
def test_a_revolution_is_the_same_when_its_matrices_are_there(name):
    """A set of pieces is found from the state alone: sliding friction, whose memory follows, would else stick by
    rounding wherever the set was new."""
    parts, rest = case(6000.0)
    revolve = STEP_METHODS[name](*parts, 720)
    first, second = revolve(rest), revolve(rest)
    for part in ("x", "v", "memory", "force"):
        assert np.array_equal(getattr(first, part), getattr(second, part)), part


def test_the_methods_that_carry_a_train_judge_it():
    linear = build_train(load_scene("motori-1"))
    gas = Forcing(linear.valve, np.array([-np.pi, 0.0, np.pi]), np.array([0.0, -50.0, 0.0]))
    for train in (build_train(REAL), replace(linear, forcing=(gas,))):
        assert {"rkg", "tmm", "houbolt"} <= set(verdict.methods_for(train))


def test_independent_methods_agree_on_a_train_with_memories():
    judged = verdict.verdict_on(REAL, exponent(REAL), (3000.0,), ("rkg", "tmm", "houbolt"), band_step_rpm=None)
    (found,) = judged.speeds
    assert found.verdict == "confirmed"
    for answer in found.methods.values():
        assert answer.converged and answer.periodic and answer.state.shape == (6,)
        assert answer.worst["seating_velocity_m_per_s"] == pytest.approx(0.0952, abs=0.005)


def test_neighbouring_memories_lead_to_the_same_motion():
    parts, rest = case(2000)
    prepare = verdict.method_named("rkg")
    answer = StepRefinement(prepare, *parts, rest, Tolerances()).answer(2)
    near = neighbours(Case(REAL, parts[1], {"rkg": prepare}, Tolerances()), 2000, answer)
    seating = [figures.worst("seating_velocity_m_per_s") for figures in near]
    assert np.ptp(seating) < 0.02 * answer.worst["seating_velocity_m_per_s"]


def test_a_pumped_up_adjuster_sinks_back_and_the_valve_seats_again():
    """It begins 0.1 mm too long, as if it had filled in flight: only after some revolutions does the valve seat."""
    (train, lift, cam_speed), rest = case(2000)
    start = rest.copy()
    revolve = verdict.method_named("rkg")(train, lift, cam_speed, 7200)
    start[[1, 5]] += np.array([1.0, -1.0]) * 1e-4  # the valve is held off its seat by the oil
    first = revolve(start)
    assert first.seat_separation().min() > 0.0
    settled = settle_and_measure(revolve, start, lift, decay=decay_per_revolution(train, cam_speed))
    plain = settle_and_measure(revolve, rest, lift, decay=decay_per_revolution(train, cam_speed))
    assert settled.periodic and settled.revolutions > 10 > plain.revolutions
    for name in ("seating_velocity_m_per_s", "dynamic_area_mm_deg"):
        assert settled.figures.worst(name) == pytest.approx(plain.figures.worst(name), rel=1e-3)
