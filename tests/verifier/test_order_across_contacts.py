"""The order that the step methods really have where a contact closes with a jump in force, and where it does not.

Between contacts they have their orders of the textbook (test_methods); across a switching inside a step the error is
that of acting on the wrong side of it for a part of the step: first order where the force jumps (a damped contact),
and one more where only its slope does. Errors scatter with where in the step the switching falls, so the fit is over
the mean of several heights.
"""

import numpy as np
import pytest

from camopt.exact import prepare
from camopt.verifier.methods import houbolt, rkg, tmm
from tests.exact.small_trains import STILL, ball

STEPS = 16000 * 2 ** np.arange(4)  # finer than where smooth error still counts
HEIGHTS = 0.1 + 1e-3 * np.arange(12)
ORDERS = {
    ("rkg", 0.0): 2.0,
    ("tmm", 0.0): 2.0,
    ("houbolt", 0.0): 2.0,
    ("rkg", 100.0): 1.0,
    ("tmm", 100.0): 1.0,
    ("houbolt", 100.0): 1.0,
}
PREPARE = {"rkg": rkg.prepare, "tmm": tmm.prepare, "houbolt": houbolt.prepare}


def position_after_one_bounce(method, train, height, steps):
    """Where the mass is a quarter of a second after it is let go: it touches once, at 0.14 to 0.15 s."""
    response = method(train, STILL, 2 * np.pi, int(steps))(np.array([height, 0.0]))
    i = int(np.argmin(np.abs(response.angle + np.pi / 2)))
    assert abs(response.angle[i] + np.pi / 2) < 1e-9
    return response.x[i, 0]


@pytest.mark.parametrize(("name", "damping"), ORDERS)
def test_order_across_a_contact(name, damping):
    train = ball(1e5, damping)
    truth = [position_after_one_bounce(prepare, train, h, 2000) for h in HEIGHTS]
    error = [
        np.mean(
            [
                abs(position_after_one_bounce(PREPARE[name], train, h, n) - t)
                for h, t in zip(HEIGHTS, truth, strict=True)
            ]
        )
        for n in STEPS
    ]
    order = -np.polyfit(np.log(STEPS), np.log(error), 1)[0]
    assert order == pytest.approx(ORDERS[name, damping], abs=0.25)
