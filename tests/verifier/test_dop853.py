"""DOP853 with located switchings: order-free accuracy, analytic bounces, and a linear train against event-exact."""

import numpy as np
import pytest

from camopt.exact import engine
from camopt.scene import MotionRefused
from camopt.scene.train import GROUND
from camopt.scene.units import DEG, MM
from camopt.verifier.methods import dop853
from tests.verifier.scenes import from_rest
from tests.verifier.test_methods import SPEED, START, reference, second_flight
from tests.verifier.trains import ball_on_seat, no_lift, smooth_lift, train, two_springs

GRID = np.linspace(-180.0, 180.0, 721) * DEG


def at(response, angles=GRID):
    """Positions at sampled angles."""
    i = np.clip(np.searchsorted(response.angle, angles - 1e-9), 0, len(response.angle) - 1)
    assert np.abs(response.angle[i] - angles).max() < 1e-9
    return response.x[i]


def test_smooth_motion_within_the_permitted_error():
    for steps, error in ((360, 1e-5), (3600, 1e-9)):
        end = dop853.prepare(two_springs(), smooth_lift(0.5), SPEED, steps)(START)
        assert np.abs(np.concatenate([end.x[-1], end.v[-1]]) - reference()).max() < error


@pytest.mark.parametrize("damping", [0.0, 120.0])
def test_mass_bounces_on_its_seat_at_the_analytic_times(damping):
    stiffness, height = 4e4, 0.2
    touch, leave, apex = second_flight(stiffness, damping, height)
    motion = dop853.prepare(ball_on_seat(stiffness, damping), no_lift(), 2 * np.pi / 0.6, 1800)(np.array([height, 0.0]))
    switch = np.flatnonzero(np.diff(motion.angle) == 0)
    # the permitted error is 4e-8 of each millimetre and metre per second
    assert motion.time[switch[:2]] == pytest.approx([touch, leave], abs=1e-7)
    assert motion.x[motion.time > leave, 0].max() == pytest.approx(apex, rel=1e-5)
    assert motion.force[switch[0] + 1, 0] == pytest.approx(damping * np.sqrt(20 * height), rel=1e-6, abs=1e-4)
    assert motion.force.min() >= 0


# at 7000 r/min it bounces, and 1440 samples miss one of the 63 switchings
@pytest.mark.parametrize(("speed_rpm", "samples", "within_mm"), [(5000, 1440, 1e-6), (7000, 2880, 1e-4)])
def test_linear_train_against_event_exact(speed_rpm, samples, within_mm):
    case, rest = from_rest("kodama", speed_rpm)
    exact, motion = at(engine.prepare(*case, 7200)(rest)), dop853.prepare(*case, samples)(rest)
    assert np.abs(at(motion) - exact).max() < within_mm * MM
    assert np.ptp(exact[:, -6]) > 8 * MM  # the valve did move


def test_a_touch_between_two_samples_is_found():
    """Contact lasts 1 ms and the motion is sampled every 8 ms: the step's own ends and samples must see it."""
    stiffness, height = 1e7, 0.1
    motion = dop853.prepare(ball_on_seat(stiffness, 0.0), no_lift(), 2 * np.pi, 120)(np.array([height, 0.0]))
    touches = np.count_nonzero(np.diff(motion.angle) == 0) / 2
    period = 2 * np.sqrt(2 * height / 10) + np.pi / np.sqrt(stiffness)
    assert touches == int(1 / period + 0.5)
    assert motion.x.max() == pytest.approx(height, rel=1e-4)


def test_endless_switching_is_refused(monkeypatch):
    monkeypatch.setattr(dop853, "MOST_SWITCHINGS", 50)
    with pytest.raises(MotionRefused, match="at 60 cam r/min: contacts switch more than 50"):
        dop853.prepare(ball_on_seat(1e9, 0.0), no_lift(), 2 * np.pi, 360)(np.array([1e-6, 0.0]))


@pytest.mark.parametrize("height", [0.05, 0.1, 0.15, 0.2, 0.25])
def test_two_contacts_that_close_at_the_same_instant_are_one_of_twice_the_stiffness(height):
    """Once the first one has switched, round-off has already moved the second one's surface beyond its zero."""
    half = (GROUND, 0, True, False, 2e4, 60.0, 0.0, 0.0)
    case = no_lift(), 2 * np.pi / 0.6, 1800
    start = np.array([height, 0.0])
    pair = dop853.prepare(train([1.0], [half, half], force=-10.0), *case)(start)
    one = dop853.prepare(ball_on_seat(4e4, 120.0), *case)(start)
    assert one.force.max() > 100.0
    assert pair.x[-1] == pytest.approx(one.x[-1], abs=1e-9)
    assert pair.force.max(axis=0) == pytest.approx(0.5 * one.force.max(), rel=1e-6)
