"""Gradients through a damped contact: the closed form, and the methods that include the jump."""

from importlib.util import find_spec

import numpy as np
import pytest

from experiments.support import gradient_ball as ball


def test_the_closed_form_conserves_momentum_by_its_coefficient_of_restitution():
    """With almost no damping the speed is reversed, and with less damping the rebound is faster."""
    speeds = [ball.closed_form(np.array([2.0, 0.01, c, 1e6]))[1] for c in (1e-6, 100.0, 400.0)]
    assert speeds[0] == pytest.approx(2.0, rel=1e-8)
    assert speeds[0] > speeds[1] > speeds[2] > 0.0


def test_the_exact_path_and_events_are_right_and_a_switch_is_not():
    exact, events, switch = (
        ball.judged(method, 1) for method in (ball.exact_path, ball.diffrax_events(1e-8), ball.diffrax_switch(1e-8))
    )
    assert exact["relative_error"] < 1e-8  # the error of the closed form's differences
    assert events["relative_error"] < 1e-5  # of a tolerance of 1e-8
    assert switch["value_error"] < 1e-5 and switch["relative_error"] > 1.0


@pytest.mark.skipif(not find_spec("warp"), reason="NVIDIA Warp (warp-lang) is not installed")
def test_warp_meets_the_end_and_not_the_gradient():
    found = ball.judged(ball.warp_kernel(2000), 1)
    assert found["value_error"] < 1e-2  # of first order in a step of a hundredth of a millisecond
    assert found["relative_error"] > 1.0
