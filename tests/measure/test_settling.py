"""Settling on motions whose next state is known."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.measure.settling import Figures, settle
from camopt.scene import MotionRefused, Response
from camopt.scene.laws import LINEAR, OIL
from camopt.scene.settled import MEASURED, PLAIN_REVOLUTIONS, RANGED, SETTLED_POSITION, WATCHED
from camopt.scene.train import GROUND
from camopt.scene.vibration import slowest_leak
from tests.verifier.trains import ball_on_seat, laws, train

TRAIN = ball_on_seat(1e5, 1.0)
UNIT = np.array([6e-7, 6e-4])
"""Position [m] and velocity [m/s] within which a motion wanders that settles by no other measure."""


def revolve_to(after, train=TRAIN):
    """A method of a train with one mass whose revolution ends in `after(state)`."""

    def revolve(state):
        x, v, z = np.split(np.stack([state, after(state)]), [1, 2], axis=1)
        zeros = np.zeros(2)
        return Response(train, 1.0, np.array([-np.pi, np.pi]), zeros, x, v, zeros[:, None], z)

    return revolve


def test_settles_when_position_and_velocity_stand():
    # quartered every revolution: the change of revolution k is 3 * 4^-k; 1 um is first passed at k = 11
    settled = settle(revolve_to(lambda y: 0.25 * y), np.array([1.0, 0.0]))
    assert settled.periodic and settled.revolutions == 11
    assert settled.response.revolutions == 5
    assert settled.response.x[0, 0] == 0.25**11
    # a velocity's 1 mm/s is passed at k = 6
    assert settle(revolve_to(lambda y: 0.25 * y), np.array([0.0, 1.0])).revolutions == 6


def test_what_does_not_settle_is_aperiodic_and_measured_longer():
    settled = settle(revolve_to(lambda y: -y), np.array([1e-3, 0.0]))
    assert not settled.periodic and settled.revolutions == 40
    assert settled.response.revolutions == 9
    assert settle(revolve_to(lambda y: -y), np.array([1e-3, 0.0]), most=7, aperiodic=3).response.revolutions == 4


def test_what_comes_within_the_tolerances_again_and_again_and_leaves_them_as_often_wanders():
    changes = np.array([0.5, 3.0, 0.5, 0.5, 0.5, 0.5]) * SETTLED_POSITION  # beyond them in the first that is measured
    turns = iter(range(1000))

    def after(y):
        turn = next(turns)
        return y + np.array([changes[turn % 6] * (-1) ** turn, 0.0])

    settled = settle(revolve_to(after), np.zeros(2))
    assert not settled.periodic and PLAIN_REVOLUTIONS + RANGED <= settled.revolutions < PLAIN_REVOLUTIONS + RANGED + 12


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
    """The same with one memory."""
    return revolve_to(after, replace(TRAIN, laws=laws([OIL], 1e5, leak=1.0)))


def test_a_memory_settles_as_a_position_does():
    # 3 * 4^-k passes 1 um, for which a memory waits too, at k = 11, and as a velocity it would at k = 6
    settled = settle(remembering(lambda y: 0.25 * y), np.array([0.0, 0.0, 1.0]))
    assert settled.periodic and settled.revolutions == 11
    assert settled.response.memory[0, 0] == 0.25**11
    assert settle(remembering(lambda y: 0.25 * y), np.array([0.0, 1.0, 0.0])).revolutions == 6


def test_an_adjuster_whose_leak_takes_revolutions_must_stand_closer():
    """What is still to come counts, and not only the last change."""
    slow = remembering(lambda y: 0.9 * y)
    for known in ({}, {"decay": -np.log(0.9)}):  # where nothing is known of the decay, it is measured
        settled = settle(slow, np.array([0.0, 0.0, 5e-6]), **known)
        assert settled.periodic and settled.response.memory[0, 0] < 1e-6


@pytest.mark.parametrize("start", np.linspace(0.05, 0.45, 9))
@pytest.mark.parametrize("growth", [3.2, 3.7, 3.99])
@pytest.mark.parametrize("measured", [MEASURED, MEASURED + 1])
def test_what_wanders_by_less_than_the_tolerance_is_not_periodic(measured, growth, start):
    """The logistic map, in units of 0.6 um: a cycle of two, and chaos of two kinds."""
    after = lambda y: growth * y * (1.0 - y / UNIT)  # noqa: E731
    settled = settle(revolve_to(after), UNIT * np.array([start, start]), measured=measured)
    assert not settled.periodic and WATCHED <= settled.revolutions < WATCHED + measured + 2


def test_what_settles_while_its_range_is_measured_is_periodic():
    """Some 40 revolutions of 5 um each, and quartered from then on."""
    after = lambda y: np.where(y > 1e-5, y - 5e-6, 0.25 * y)  # noqa: E731
    settled = settle(revolve_to(after), np.array([1.2e-5 + 39.5 * 5e-6, 0.0]))
    assert settled.periodic and 40 < settled.revolutions < 55 and abs(settled.response.x[0, 0]) < 1e-9


@pytest.mark.parametrize("ratio", [0.01, 0.5, -0.7, 0.9, 0.96])
def test_revolutions_are_those_that_were_run(ratio):
    ran = []
    settled = settle(revolve_to(lambda y: ran.append(1) or ratio * y), np.array([3e-6, 0.0]))
    assert settled.periodic and settled.revolutions + settled.response.revolutions == len(ran)


def test_the_leak_of_a_seated_adjuster_is_that_of_its_force():
    """A column k between a cam contact and a seat of k each keeps its force for leak (1/k + 2/k)."""
    k, leak = 2e7, 1e5
    elements = [
        (GROUND, 0, True, True, k, 0.0, 0.0, 0.0),
        (0, 1, False, False, k, 0.0, 0.0, 0.0),
        (GROUND, 1, True, False, k, 0.0, 100.0, 0.0),
    ]
    own = laws([LINEAR, OIL, LINEAR], k, leak=[0.0, leak, 0.0])
    parts = train([0.1, 0.1], elements, force=-10.0, valve=1, seat=2, cam_side=(0,), laws=own)
    assert slowest_leak(parts) == pytest.approx(0.5 * k / (3 * leak), rel=1e-9)
    assert slowest_leak(TRAIN) == np.inf


def test_a_motion_without_bound_is_refused_whatever_its_memories_do():
    with pytest.raises(MotionRefused):
        settle(remembering(lambda y: y + np.array([1e4, 0.0, 0.0])), np.zeros(3))
    assert settle(remembering(lambda y: y + np.array([0.0, 1e4, 0.0])), np.zeros(3), most=3).revolutions == 3
