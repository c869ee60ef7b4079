"""Settling on motions whose next state is known."""

import numpy as np
import pytest

from camopt.measure.settling import Figures, settle
from camopt.scene import MotionRefused, Response
from tests.verifier.trains import ball_on_seat

TRAIN = ball_on_seat(1e5, 1.0)


def revolve_to(after):
    """A method whose revolution ends in `after(state)`."""

    def revolve(state):
        ends = np.stack([state, after(state)])
        zeros = np.zeros(2)
        return Response(TRAIN, 1.0, np.array([-np.pi, np.pi]), zeros, ends[:, :1], ends[:, 1:], zeros[:, None])

    return revolve


def test_settles_when_position_and_velocity_stand():
    # halved every revolution: the change of revolution k is 2^-k; 1 um is first passed at k = 20
    settled = settle(revolve_to(lambda y: 0.5 * y), np.array([1.0, 0.0]))
    assert settled.periodic and settled.revolutions == 20
    assert settled.response.revolutions == 5
    assert settled.response.x[0, 0] == 0.5**20
    # a velocity's 1 mm/s is passed at k = 10
    assert settle(revolve_to(lambda y: 0.5 * y), np.array([0.0, 1.0])).revolutions == 10


def test_what_does_not_settle_is_aperiodic_and_measured_longer():
    settled = settle(revolve_to(lambda y: -y), np.array([1e-3, 0.0]))
    assert not settled.periodic and settled.revolutions == 40
    assert settled.response.revolutions == 9
    assert settle(revolve_to(lambda y: -y), np.array([1e-3, 0.0]), most=7, aperiodic=3).response.revolutions == 4


@pytest.mark.parametrize("after", [lambda y: 2e9 * y, lambda y: np.nan * y])
def test_a_motion_without_bound_is_refused(after):
    with pytest.raises(MotionRefused, match="stability"):
        settle(revolve_to(after), np.array([1e-3, 0.0]))


def test_worst_is_largest_or_where_less_is_worse_smallest():
    figures = Figures({"bounce_mm": np.array([0.1, 0.4, 0.2]), "contact_force_min_N": np.array([30.0, 10.0, 20.0])})
    assert figures.worst("bounce_mm") == 0.4 and figures.range("bounce_mm") == (0.1, 0.4)
    assert figures.worst("contact_force_min_N") == 10.0
    assert np.isnan(Figures({"bounce_mm": np.array([0.1, np.nan])}).worst("bounce_mm"))
