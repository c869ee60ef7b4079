"""Gradients of ensembles of cams: against single gradients, and against an evolution strategy."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact.adjoint.motion import value_and_gradient
from camopt.scene import InputError, MotionRefused
from camopt.study.gradient.paths import cosine, moved, with_bumps
from experiments.ensemble_gradients import CamEnsemble, ensemble_gradient, evolution_strategy_gradient, summary
from tests.exact.gradient_problems import kodama

NAMES = ["jump_mm", "bounce_mm"]


def cam(count):
    scene, train = kodama()
    return (train, *with_bumps(polydyne(scene), count)), scene


def test_bumps_leave_the_ramps_and_have_height_one():
    (_, lift, directions), scene = cam(20)
    theta = np.linspace(-np.pi, np.pi, 20001)
    assert np.abs(lift(theta) - polydyne(scene)(theta)).max() < 1e-16
    outside = np.abs(theta) > lift.half_duration
    for i in (0, 10, 19):
        change = moved(lift, directions, np.eye(20)[i])(theta) - lift(theta)
        assert not np.any(change[outside])
        assert change.max() == pytest.approx(1.0, abs=1e-4)
    fourth = moved(lift, directions, np.ones(20))(theta, 4) - lift(theta, 4)
    assert np.abs(np.diff(fourth)).max() < 2e-2 * np.abs(fourth).max()  # C4: no step between samples


def test_cams_that_hardly_differ_have_the_gradient_of_one():
    (train, lift, directions), scene = cam(5)
    speed = scene.cam_speed(6000)
    found = ensemble_gradient(train, CamEnsemble(lift, directions, 1e-12, 4, seed=1), speed, NAMES)
    single = value_and_gradient(train, lift, speed, NAMES)
    assert found.values == pytest.approx(single.values, rel=1e-6)
    slopes = np.einsum("lpq,mpq->lm", single.by_coefficients, directions)
    assert np.linalg.norm(found.gradient - slopes) < 1e-5 * np.linalg.norm(slopes)
    assert found.members == 4
    assert found.split_half_cosine == pytest.approx(1.0)


def test_the_pathwise_mean_is_that_of_the_evolution_strategy_and_has_less_noise():
    (train, lift, directions), scene = cam(5)
    speed = scene.cam_speed(6500)
    pathwise = ensemble_gradient(train, CamEnsemble(lift, directions, 1e-6, 100, seed=2), speed, NAMES)
    judge = evolution_strategy_gradient(train, CamEnsemble(lift, directions, 1e-6, 1200, seed=3), speed, NAMES)
    assert pathwise.values == pytest.approx(judge.values, rel=1e-2)
    for found, reference in zip(pathwise.gradient, judge.gradient, strict=True):
        assert cosine(found, reference) > 0.97
        assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(reference), rel=0.2)
    assert np.all(pathwise.standard_error[0] * np.sqrt(100) < judge.standard_error[0] * np.sqrt(1200))


def test_pairs_without_a_value_are_left_out_of_all_means():
    """Of four pairs one has a refused member: the others make mean, error and halves."""
    values = np.array([[1.0, 3.0], [2.0, np.nan], [5.0, 7.0], [0.0, 2.0]])[:, :, None]
    slopes = np.array([[1.0, 0.0], [9.0, 9.0], [0.0, 2.0], [0.0, 4.0]])[:, None, :]
    found = summary(["bounce_mm"], values, slopes)
    assert (found.members, found.refused) == (6, 2)
    assert found.values == pytest.approx([3.0])
    assert found.gradient[0] == pytest.approx([1 / 3, 2.0])
    assert found.standard_error[0] == pytest.approx([1 / 3, 2 / np.sqrt(3)])
    assert found.split_half_cosine == pytest.approx([0.0])
    with pytest.raises(MotionRefused, match="of 4 pairs of cams 0 move"):
        summary(["bounce_mm"], np.where(values > 1.9, np.nan, values), slopes)


def test_members_come_in_pairs_of_opposite_heights():
    (_, lift, directions), _ = cam(3)
    ensemble = CamEnsemble(lift, directions, 2e-6, 6, seed=4)
    heights, lifts = ensemble.heights(), ensemble.lifts()
    assert heights.shape == (3, 3) and len(lifts) == 6
    assert CamEnsemble(lift, directions, 4e-6, 6, seed=4).heights() == pytest.approx(2 * heights)
    for i, height in enumerate(heights):
        change = np.einsum("m,mpq->pq", height, directions)
        for one, sign in ((lifts[2 * i], 1.0), (lifts[2 * i + 1], -1.0)):
            np.testing.assert_allclose(one.coefficients, lift.coefficients + sign * change, rtol=1e-12, atol=1e-14)


def test_unusable_ensembles_are_refused():
    (_, lift, directions), _ = cam(5)
    with pytest.raises(InputError, match="members = 5: an ensemble needs an even number"):
        CamEnsemble(lift, directions, 1e-6, 5, seed=1)
    with pytest.raises(InputError, match="sigma_m = 0"):
        CamEnsemble(lift, directions, 0.0, 4, seed=1)
