"""Gradients of ensembles of cams: against single gradients, and against an evolution strategy."""

import numpy as np
import pytest

from camopt.cam.bumps import moved, with_bumps
from camopt.cam.families.polydyne import polydyne
from camopt.exact.adjoint.gradient import value_and_gradient
from camopt.exact.ensemble import CamEnsemble, cosine, ensemble_gradient, evolution_strategy_gradient
from camopt.scene import InputError
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


def test_unusable_ensembles_are_refused():
    (_, lift, directions), _ = cam(5)
    with pytest.raises(InputError, match="members = 5: an ensemble needs an even number"):
        CamEnsemble(lift, directions, 1e-6, 5, seed=1)
    with pytest.raises(InputError, match="sigma_m = 0"):
        CamEnsemble(lift, directions, 0.0, 4, seed=1)
