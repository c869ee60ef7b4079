"""Gradients of ensembles of cams, compared with single gradients and with an evolution strategy."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact.adjoint.motion import value_and_gradient
from camopt.scene import MotionRefused
from camopt.study.gradient.paths import cosine, moved, with_bumps
from experiments.ensemble_gradients import (
    Bumped,
    drawn_heights,
    evolution_strategy,
    of_pairs,
    pathwise,
    split_half_cosine,
)
from tests.exact.gradient_problems import kodama

NAMES = ("jump_mm", "bounce_mm")


def bumped(count: int, rpm: float) -> Bumped:
    scene, train = kodama()
    return Bumped(train, *with_bumps(polydyne(scene), count), scene.cam_speed(rpm), NAMES)


def test_bumps_leave_the_ramps_and_have_height_one():
    (scene, _), (_, lift, directions, *_) = kodama(), bumped(20, 6000)
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
    one = bumped(5, 6000)
    slopes = pathwise(one, drawn_heights(4, 5, 1e-12, seed=1))
    single = value_and_gradient(one.train, one.lift, one.cam_speed, NAMES)
    wanted = np.einsum("lpq,mpq->lm", single.by_coefficients, one.directions)
    assert np.linalg.norm(slopes.mean(axis=0) - wanted) < 1e-5 * np.linalg.norm(wanted)
    assert split_half_cosine(slopes) == pytest.approx([1.0, 1.0])


def test_the_pathwise_mean_is_that_of_the_evolution_strategy_and_has_less_noise():
    one = bumped(5, 6500)
    slopes = pathwise(one, drawn_heights(100, 5, 1e-6, seed=2))
    judge = evolution_strategy(one, drawn_heights(1200, 5, 1e-6, seed=3), 1e-6)
    for found, reference in zip(slopes.mean(axis=0), judge.mean(axis=0), strict=True):
        assert cosine(found, reference) > 0.97
        assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(reference), rel=0.2)
    assert np.all(slopes[:, 0].std(axis=0) < judge[:, 0].std(axis=0))


def test_a_refused_member_leaves_out_its_pair():
    def numbers(heights: np.ndarray) -> np.ndarray:
        if heights[0] == 2.0:
            raise MotionRefused("no motion")
        return np.where(heights == -3.0, np.nan, heights)

    heights, pairs = of_pairs(numbers, np.array([[1.0], [2.0], [3.0], [4.0]]))
    np.testing.assert_array_equal(heights, [[1.0], [4.0]])
    np.testing.assert_array_equal(pairs, [[[1.0], [-1.0]], [[4.0], [-4.0]]])
