"""Settling on motions whose next state is known."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.measure.settling import Figures, settle
from camopt.scene import MotionRefused, Response
from camopt.scene.laws import LINEAR, OIL
from camopt.scene.train import GROUND
from camopt.scene.vibration import slowest_leak
from tests.verifier.trains import ball_on_seat, laws, train

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


def remembering(after):
    """A method of a train with one mass and one memory whose revolution ends in `after(state)`."""
    oil = replace(TRAIN, laws=laws([OIL], 1e5, leak=1.0))

    def revolve(state):
        ends = np.stack([state, after(state)])
        zeros = np.zeros(2)
        return Response(
            oil, 1.0, np.array([-np.pi, np.pi]), zeros, ends[:, :1], ends[:, 1:2], zeros[:, None], ends[:, 2:]
        )

    return revolve


def test_a_memory_settles_as_a_position_does():
    # 2^-k passes 1 um, for which a memory waits too, at k = 20, and as a velocity it would at k = 10
    settled = settle(remembering(lambda y: 0.5 * y), np.array([0.0, 0.0, 1.0]))
    assert settled.periodic and settled.revolutions == 20
    assert settled.response.memory[0, 0] == 0.5**20
    assert settle(remembering(lambda y: 0.5 * y), np.array([0.0, 1.0, 0.0])).revolutions == 10


def test_an_adjuster_whose_leak_takes_revolutions_must_stand_closer():
    """What is still to come counts, and not only the last change."""
    slow = remembering(lambda y: 0.9 * y)
    assert settle(slow, np.array([0.0, 0.0, 5e-6])).revolutions == 1
    settled = settle(slow, np.array([0.0, 0.0, 5e-6]), decay=-np.log(0.9))
    assert settled.periodic and settled.response.memory[0, 0] < 1e-6 / 0.9


def test_the_leak_of_a_seated_adjuster_is_that_of_its_force():
    """A column k between a cam contact and a seat of k each keeps its force for leak (1/k + 2/k)."""
    k, leak = 2e7, 1e5
    elements = [
        (GROUND, 0, True, True, k, 0.0, 0.0, 0.0),
        (0, 1, False, False, k, 0.0, 0.0, 0.0),
        (GROUND, 1, True, False, k, 0.0, 100.0, 0.0),
    ]
    parts = train([0.1, 0.1], elements, force=np.array([-10.0, -10.0]), valve=1, seat=2, cam_side=(0,))
    parts = replace(parts, laws=laws([LINEAR, OIL, LINEAR], k, leak=[0.0, leak, 0.0]))
    assert slowest_leak(parts) == pytest.approx(0.5 * k / (3 * leak), rel=1e-9)
    assert slowest_leak(TRAIN) == np.inf


def test_a_motion_without_bound_is_refused_whatever_its_memories_do():
    with pytest.raises(MotionRefused):
        settle(remembering(lambda y: y + np.array([1e4, 0.0, 0.0])), np.zeros(3))
    assert settle(remembering(lambda y: y + np.array([0.0, 1e4, 0.0])), np.zeros(3), most=3).revolutions == 3
