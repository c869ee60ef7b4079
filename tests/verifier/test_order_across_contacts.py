"""The order that the step methods really have where a contact closes with a jump in force, and where it does not.

Between contacts they have their orders of the textbook (test_methods); across a switching inside a step the error is
that of acting on the wrong side of it for a part of the step: first order where the force jumps (a damped contact),
and one more where only its slope does. Errors scatter with where in the step the switching falls, so the fit is over
the mean of several heights.
"""

import numpy as np
import pytest

from camopt.exact import prepare
from camopt.study.extremes.extremes import STEP_METHODS
from tests.verifier.trains import ball_on_seat, no_lift

STEPS = 16000 * 2 ** np.arange(4)  # finer than where smooth error still counts
HEIGHTS = 0.1 + 1e-3 * np.arange(12)


def positions_after_one_bounce(method, damping, steps):
    """Where masses are a quarter of a second after they are let go at HEIGHTS: they touch once, at 0.14 to 0.15 s."""
    revolve = method(ball_on_seat(1e5, damping), no_lift(), 2 * np.pi, int(steps))
    found = []
    for height in HEIGHTS:
        response = revolve(np.array([height, 0.0]))
        i = int(np.argmin(np.abs(response.angle + np.pi / 2)))
        assert abs(response.angle[i] + np.pi / 2) < 1e-9
        found.append(response.x[i, 0])
    return np.array(found)


@pytest.mark.parametrize(("damping", "order"), [(0.0, 2.0), (100.0, 1.0)])
@pytest.mark.parametrize("name", ["rkg", "tmm", "houbolt"])
def test_order_across_a_contact(name, damping, order):
    truth = positions_after_one_bounce(prepare, damping, 2000)
    found = [positions_after_one_bounce(STEP_METHODS[name], damping, n) for n in STEPS]
    errors = [np.mean(np.abs(positions - truth)) for positions in found]
    assert -np.polyfit(np.log(STEPS), np.log(errors), 1)[0] == pytest.approx(order, abs=0.25)
