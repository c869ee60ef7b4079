"""A ball in free flight, all of whose figures are polynomials: metrics, their cotangents, whole revolutions.

Python runs what is compiled otherwise.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from camopt.cam.lift import Lift
from camopt.exact import prepare
from camopt.exact.adjoint.motion import TracedMotion
from camopt.exact.adjoint.seeds import empty_seeds
from camopt.exact.adjoint.slopes import room_for_bars
from camopt.exact.adjoint.sweep import Bars, sweep
from camopt.exact.kernel import revolution as of_revolution
from camopt.exact.kernel.propagators import propagators
from camopt.exact.kernel.trace import rows_of
from camopt.scene.units import DEG
from tests.exact.interpreted import interpret
from tests.exact.small_trains import GRAVITY, STILL, ball

PERIOD = 0.02
"""Seconds per revolution of the cam."""
START = np.array([0.1, -1.0])
HEIGHT = Polynomial([*START, -0.5 * GRAVITY])
"""Of the ball above the floor, by the time [m]."""


@pytest.fixture(autouse=True)
def _by_python(monkeypatch):
    interpret(monkeypatch, __name__, "camopt.exact.")


def flying(revolutions=1):
    return TracedMotion(ball(1e4, 0.0), STILL, 2.0 * np.pi / PERIOD, START, revolutions)


def cut(segments):
    """(setting, the first segments of the flight, its duration [s])."""
    motion = flying()
    trace = rows_of(motion.trace, 0, segments)
    return motion.setting, trace, (trace.angle[-1] + np.pi) / motion.cam_speed


@pytest.mark.parametrize("weight", [1.0, -0.3])
def test_a_sweep_differentiates_the_integral_of_the_distance_by_the_start(weight, monkeypatch):
    """By the start, height changes by 1 and by the time. No room is read unwritten."""
    s, trace, end = cut(2)
    seeds, width = empty_seeds(2, 0, s.train), s.cam.pieces.shape
    seeds.integral[:] = weight
    bars = Bars(*(part[0] for part in room_for_bars(s.train, width, 1, False)))
    with monkeypatch.context() as unwritten:
        unwritten.setattr(np, "empty", lambda shape: np.full(shape, np.nan))
        sweep(s, trace, seeds, bars)
    assert bars.start == pytest.approx([weight * end / s.step, weight * 0.5 * end**2 / s.step], rel=1e-9)


def test_without_a_push_the_contact_force_is_zero_and_the_contact_apart_in_the_whole_window():
    motion = flying()
    assert motion.values(["contact_force_max_N", "contact_force_min_N"]).tolist() == [0.0, 0.0]
    assert motion.values(["jump_deg"]) == pytest.approx(2.0 * STILL.half_duration / DEG)
    assert motion.by_half_duration(["jump_deg"]) == pytest.approx(2.0 / DEG, rel=1e-6)


def test_the_largest_contact_force_may_be_that_at_the_very_start():
    """Pressed 20 um into 1e6 N/m under a weight of 10 N, a damped ball swings back to less than these 20 N."""
    train, depth = replace(ball(1e-3, 0.0), mass_damping=np.array([200.0])), 20e-6
    whole = Lift(STILL.borders, STILL.coefficients, np.pi)
    start = np.array([-5e-3 - depth, 0.0])
    motion = TracedMotion(train, whole, 2.0 * np.pi / PERIOD, start)
    assert motion.values(["contact_force_max_N"]) == pytest.approx(1e6 * depth, rel=1e-6)


def test_revolutions_follow_each_other_along_one_parabola():
    motion = flying(2)
    time = (motion.trace.angle + np.pi) / motion.cam_speed
    assert time[-1] == pytest.approx(2.0 * PERIOD) and np.all(np.diff(time) > 0.0)
    assert motion.trace.y[:, 0] == pytest.approx(HEIGHT(time), abs=1e-12)
    assert motion.end == pytest.approx([HEIGHT(time[-1]), HEIGHT.deriv()(time[-1])], abs=1e-12)


def test_the_next_piece_of_the_lift_follows_though_rounding_has_put_the_time_behind_its_border(monkeypatch):
    """As where a contact switches at the border: else nothing would move there for ever."""
    original, stops = of_revolution.next_stop, []

    def next_stop(cam, piece, t, target, step):
        border, target, end = original(cam, piece, t, target, step)
        stops.append(t)
        assert len(stops) < 200, "time stands still"
        return border, target, np.nextafter(end, 1.0) if end == border and piece == 0 else end

    monkeypatch.setattr(of_revolution, "next_stop", next_stop)
    two = Lift(np.array([-np.pi, 1.0, np.pi]), np.zeros((2, 2)), 1.0)
    end = prepare(ball(1e4, 0.0), two, 2.0 * np.pi / PERIOD).advance(START)
    assert end == pytest.approx([HEIGHT(PERIOD), HEIGHT.deriv()(PERIOD)], abs=1e-12)


def test_a_train_whose_modes_do_not_die_out_is_never_leapt_over():
    train = ball(1e4, 0.0)
    revolution = prepare(train, STILL, 2.0 * np.pi / PERIOD)
    with propagators(train, revolution.step, 2, 8).lent() as one:
        assert one.tables.leap.key[0] == -1
    ends = [HEIGHT(PERIOD), HEIGHT.deriv()(PERIOD)]
    assert revolution.advance(START) == pytest.approx(ends, abs=1e-12)
