"""Perturbed scenes, grinding errors, and a judge that fails a cam for the worst of them."""

from pathlib import Path

import numpy as np
import pytest

from camopt.cam.design_file import read_design
from camopt.cam.grinding import HARMONICS, PEAK, grinding_error, ground
from camopt.cam.lift import Lift
from camopt.optimizer.search.judge import Judge
from camopt.optimizer.search.robust import (
    Perturbation,
    RobustJudge,
    perturbations,
    valve_spring,
    with_contacts,
    with_lash,
    with_spring,
)
from camopt.scene import InputError, load_scene

KODAMA, MOTORI = load_scene("kodama"), load_scene("motori-1")
CAM = read_design(Path(__file__).parents[1] / "data" / "kodama-design.json", KODAMA)


def element(scene, name):
    return next(e for e in scene.element if e.name == name)


def test_the_spring_changes_as_a_whole_and_the_seat_with_its_preload():
    names = valve_spring(KODAMA)
    assert len(names) == 6 and all(n.startswith("coil") for n in names)
    softer = with_spring(KODAMA, rate=0.9, preload=1.2)
    for name in names:
        assert element(softer, name).stiffness_N_per_m == pytest.approx(0.9 * element(KODAMA, name).stiffness_N_per_m)
        assert element(softer, name).preload_N == pytest.approx(1.2 * element(KODAMA, name).preload_N)
    seat = element(softer, KODAMA.seat)
    assert seat.preload_N == pytest.approx(1.2 * element(KODAMA, KODAMA.seat).preload_N)
    assert seat.stiffness_N_per_m == element(KODAMA, KODAMA.seat).stiffness_N_per_m


def test_contacts_change_but_no_spring_that_is_a_contact():
    stiffer, spring = with_contacts(MOTORI, 1.1), valve_spring(MOTORI)
    assert all(element(MOTORI, n).kind == "contact" for n in spring)
    for e in MOTORI.element:
        factor = 1.1 if e.kind == "contact" and e.name not in spring else 1.0
        assert element(stiffer, e.name).stiffness_N_per_m == pytest.approx(factor * e.stiffness_N_per_m)


def test_lash_never_becomes_negative():
    lash = max(e.gap_mm for e in KODAMA.element)
    assert max(e.gap_mm for e in with_lash(KODAMA, 0.05).element) == pytest.approx(lash + 0.05)
    assert max(e.gap_mm for e in with_lash(KODAMA, -1.0).element) == 0.0


def test_a_scene_without_preload_has_no_known_spring():
    slack = KODAMA.model_copy(
        update={"element": tuple(e.model_copy(update={"preload_N": 0.0}) for e in KODAMA.element)}
    )
    with pytest.raises(InputError, match="no valve spring is known"):
        valve_spring(slack)


def test_a_grinding_error_has_its_peak_and_harmonics_and_leaves_the_base_circle():
    error, angle = grinding_error(CAM, 3), np.linspace(-np.pi, np.pi, 14_401)
    assert np.abs(error(angle)).max() == pytest.approx(PEAK, rel=2e-3)  # peak at the knots, nearly
    outside = (angle < CAM.opening_foot) | (angle > CAM.closing_angle(0.0))
    assert np.all(error(angle[outside]) == 0.0)
    spectrum = np.abs(np.fft.rfft(error(angle[:-1]))) ** 2
    assert spectrum[HARMONICS[1] + 30 :].sum() < 1e-3 * spectrum.sum()  # the fading spreads it a little
    for order in (0, 1, 2):  # where pieces meet, the feet among them
        edges = error.borders[1:-1]
        before, after = error(edges - 1e-9, order), error(edges + 1e-9, order)
        assert np.abs(after - before).max() < 1e-4 * np.abs(error(angle, order)).max()
    assert ground(CAM, 3)(angle) == pytest.approx(CAM(angle) + error(angle), abs=1e-15)
    assert not np.allclose(grinding_error(CAM, 4)(angle), error(angle), atol=PEAK / 10)


def test_a_cam_without_ramps_has_a_grinding_error_too():
    """It fades over the shortest wave where the stated duration leaves no ramp, or less than none."""
    lobe = Lift(CAM.borders, CAM.coefficients, 1.2 * CAM.closing_angle(0.0))
    error, angle = grinding_error(lobe, 3), np.linspace(-np.pi, np.pi, 14_401)
    assert np.abs(error(angle)).max() == pytest.approx(PEAK, rel=2e-3)
    foot, end = lobe.opening_foot, lobe.closing_angle(0.0)
    assert np.all(error(angle[(angle < foot) | (angle > end)]) == 0.0)
    assert np.abs(error(np.array([foot, end]), 1)).max() < 1e-3 * np.abs(error(angle, 1)).max()


@pytest.mark.parametrize(("level", "word"), [(0.0, "everywhere zero"), (3e-3, "never zero")])
def test_a_lift_that_is_no_lobe_on_a_base_circle_has_no_grinding_error(level, word):
    flat = Lift(np.array([-np.pi, np.pi]), np.array([[level]]), 1.2)
    with pytest.raises(InputError, match=f"{word}.*give a cam that rises"):
        grinding_error(flat, 1)


def test_every_perturbation_is_named_once():
    found = perturbations(KODAMA, seeds=2)
    assert len(found) == 10 and {"preload less", "contact stiffness more", "grinding 1"} <= set(found)
    assert found["grinding 1"].scene is KODAMA and found["grinding 1"].grinding_seed == 1


def test_the_robust_judge_fails_a_cam_for_its_worst_perturbation():
    first = Judge(KODAMA, np.array([6500.0, 6800.0]))
    assert first(CAM).holds
    weak = {"preload less": Perturbation(with_spring(KODAMA, preload=0.6))}
    judge = RobustJudge(first, weak)
    judged = judge(CAM)
    assert not judged.holds and judge.worst == "preload less"
    same = RobustJudge(first, {"nothing": Perturbation(KODAMA)})
    assert same(CAM).share.max() == pytest.approx(first(CAM).share.max(), rel=0.05)  # settled from elsewhere
