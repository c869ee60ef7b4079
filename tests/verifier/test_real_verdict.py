"""Verdicts on trains with tables, adjusters, friction and gas force: which methods judge, and that they agree."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.exponent import exponent
from camopt.measure.settling import decay_per_revolution, settle_and_measure
from camopt.scene import build_train, load_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.train import Forcing
from camopt.verifier import verdict
from camopt.verifier.at_speed import Case, neighbours
from camopt.verifier.convergence import StepRefinement, Tolerances
from tests.verifier.test_real_scene import SCENE


@pytest.fixture(scope="module")
def scene():
    return load_scene(SCENE)


def test_the_methods_that_carry_a_train_judge_it(scene):
    assert {"rkg", "tmm", "houbolt"} <= set(verdict.methods_for(build_train(scene)))


def test_a_linear_train_with_a_given_force_is_judged_by_methods_that_know_of_it():
    train = build_train(load_scene("motori-1"))
    gas = Forcing(train.valve, np.array([-np.pi, 0.0, np.pi]), np.array([0.0, -50.0, 0.0]))
    assert {"rkg", "tmm", "houbolt"} <= set(verdict.methods_for(replace(train, forcing=(gas,))))


def test_independent_methods_agree_on_a_train_with_memories(scene):
    judged = verdict.verdict_on(scene, exponent(scene), (3000.0,), ("rkg", "tmm", "houbolt"), band_step_rpm=None)
    (found,) = judged.speeds
    assert found.verdict == "confirmed"
    for answer in found.methods.values():
        assert answer.converged and answer.periodic and answer.state.shape == (6,)
        assert answer.worst["seating_velocity_m_per_s"] == pytest.approx(0.0952, abs=0.005)


def test_neighbouring_memories_lead_to_the_same_motion(scene):
    train, lift, cam_speed = build_train(scene), exponent(scene), scene.cam_speed(2000)
    prepare = verdict.method_named("rkg")
    answer = StepRefinement(prepare, train, lift, cam_speed, state_at_rest(train), Tolerances()).answer(2)
    near = neighbours(Case(scene, lift, {"rkg": prepare}, Tolerances()), 2000, answer)
    seating = [figures.worst("seating_velocity_m_per_s") for figures in near]
    assert np.ptp(seating) < 0.02 * answer.worst["seating_velocity_m_per_s"]


def test_a_pumped_up_adjuster_sinks_back_and_the_valve_seats_again(scene):
    """It begins 0.1 mm too long, as if it had filled in flight: only after some revolutions does the valve seat."""
    train, lift, cam_speed = build_train(scene), exponent(scene), scene.cam_speed(2000)
    revolve = verdict.method_named("rkg")(train, lift, cam_speed, 7200)
    start = state_at_rest(train)
    start[[1, 5]] += np.array([1.0, -1.0]) * 1e-4  # the valve is held off its seat by the oil
    first = revolve(start)
    assert first.seat_separation().min() > 0.0
    settled = settle_and_measure(revolve, start, lift, decay=decay_per_revolution(train, cam_speed))
    plain = settle_and_measure(revolve, state_at_rest(train), lift, decay=decay_per_revolution(train, cam_speed))
    assert settled.periodic and settled.revolutions > 10 > plain.revolutions
    for name in ("seating_velocity_m_per_s", "dynamic_area_mm_deg"):
        assert settled.figures.worst(name) == pytest.approx(plain.figures.worst(name), rel=1e-3)
