"""How the valve comes down, on small traces that are written by hand, and the cotangents of what is taken there."""

from types import SimpleNamespace

import numpy as np
import pytest

from camopt.exact.adjoint import metrics as metrics_of
from camopt.exact.adjoint.closing import leaked, nominal_closing, seed_leaked, touch
from camopt.exact.adjoint.seeds import Seeds, seed_end
from camopt.exact.kernel.tables import ACTING, SEPARATED, Sizes
from camopt.scene.units import MM
from tests.exact.interpreted import interpret

STEP = 0.01
"""Seconds."""
SPEED = 10.0
"""Of the cam [rad/s]."""


@pytest.fixture(autouse=True)
def _by_python(monkeypatch):
    interpret(monkeypatch, __name__, "camopt.exact.")


def no_seeds(segments, width):
    chain, by_segment = (np.zeros(9, dtype=int), np.zeros(9), np.full((9, width), np.nan)), np.zeros((2, segments))
    one, weight, head = np.zeros(1, dtype=int), np.array([2.5]), np.full(segments, -1)
    return Seeds(one, weight, head, *chain, *by_segment, np.zeros((1, 4)), np.zeros(1))


def on_its_seat(constant, states, positions, next_foot=2.0):
    """(setting, trace) of a valve on a seat of 1e6 N/m, at positions [m] and in states of its seat by segment, from
    -1 to 1 rad, and that opens again at `next_foot` [rad]."""
    train = SimpleNamespace(
        seat=0,
        a=np.array([-1]), b=np.array([0]), gap=np.zeros(1), mass=np.ones(1), touch=np.zeros(1, dtype=int),
        law=np.array([[constant, 1.0e6, 0.0, 0.0]]),
    )  # fmt: skip
    tables = SimpleNamespace(states=np.array([[SEPARATED], [ACTING]]), element=np.zeros((2, 1), dtype=int))
    closing = [0 if state == SEPARATED else -1 for state in states]
    trace = SimpleNamespace(
        angle=np.linspace(-1.0, 1.0, len(states) + 1), length=np.ones(len(states)), watch=np.array(closing),
        slot=np.array([0 if state == SEPARATED else 1 for state in states]),
        y=np.array([[x, 0.0] for x in (*positions, positions[-1])]),
    )  # fmt: skip
    return SimpleNamespace(train=train, tables=tables, step=STEP, opening_foot=next_foot - 2 * np.pi), trace


def of_the_closing(s, trace):
    """Bounce, seating velocity and impact velocity."""
    return [metrics_of.measure(metric, s, trace, None, 0)[0] for metric in (0, 5, 6)]


def test_a_valve_that_never_leaves_its_seat_has_not_opened():
    shut = on_its_seat(0.0, [ACTING, ACTING], [-1e-5, -1e-5])
    assert touch(*shut, 0) == (-1, False) and of_the_closing(*shut) == [0.0, 0.0, 0.0]


def test_a_valve_opens_where_it_leaves_the_touch_of_its_seat_though_this_lies_below_its_zero():
    """A law of -10 N at compression zero touches 10 um deep; the valve lifts off to 5 um below zero."""
    assert touch(*on_its_seat(-10.0, [ACTING, SEPARATED, ACTING], [-2e-5, -5e-6, -2e-5]), 0) == (1, True)


@pytest.mark.parametrize(("next_foot", "touched"), [(0.0, -1), (0.4, 1)])
def test_a_valve_that_touches_after_it_should_open_again_has_not_touched(next_foot, touched):
    """The second of three segments, in which the valve is off its seat, ends at a third of a radian."""
    states, positions = [ACTING, SEPARATED, ACTING], [-1e-5, 1e-5, -1e-5]
    moved = on_its_seat(0.0, states, positions, next_foot)
    assert touch(*moved, 0) == (touched, True) and (touched >= 0 or np.all(np.isnan(of_the_closing(*moved))))


@pytest.mark.parametrize(("half", "force"), [(0.3, 7.0), (0.4, 0.0)])
@pytest.mark.parametrize("apart", [0, 2])
def test_a_contact_that_is_apart_at_an_end_of_the_event_has_no_force_there(monkeypatch, apart, half, force):
    """Three segments, which meet a third of a radian before and after the nose."""
    s, trace = on_its_seat(0.0, [SEPARATED if k == apart else ACTING for k in range(3)], [0.0, 0.0, 0.0])
    s.train.cam_side, s.half_duration = [0], half
    monkeypatch.setattr(metrics_of, "largest", lambda *_: (-7.0, 1, 0.5, 0.0, -np.inf))
    assert metrics_of.contact_force(s, trace, None, 0, -1.0)[0] == force


@pytest.mark.parametrize("speed", [0.3, 0.0])
def test_a_touch_that_ends_the_very_first_segment_is_an_impact(monkeypatch, speed):
    """Of no speed if the valve does not come down, whatever it did before."""
    s, trace = on_its_seat(0.0, [SEPARATED, ACTING], [1e-5, 0.0])
    s.train.valve, trace.y[:, 1] = 0, [-0.7, -speed, 0.0]
    monkeypatch.setattr(metrics_of, "closed_window", lambda *_: (0, True, -1.0, 1.0, -1, 0.0))
    assert metrics_of.impact_velocity(s, trace, None, 0)[0] == speed


@pytest.mark.parametrize("heights", [(3.0, 2.0), (2.0, 3.0)])
def test_the_runner_up_of_a_jump_is_that_of_the_other_contact(monkeypatch, heights):
    """Two contacts between cam and valve jump [mm], each once."""
    s, trace = on_its_seat(0.0, [SEPARATED], [0.0])
    s.train.cam_side, s.train.touch, s.half_duration = [0, 1], np.zeros(2, dtype=int), 1.0
    monkeypatch.setattr(metrics_of, "largest", lambda s, trace, e, *_: (1e6 * MM * heights[e], 1, 0.5, 0.0, -np.inf))
    assert metrics_of.jump_height(s, trace, None, 0) == pytest.approx((3.0, 2.0))


@pytest.mark.parametrize("turn", [0, 1])
@pytest.mark.parametrize("lash", [0.0, 0.19, 0.64])
def test_the_lift_falls_to_the_lash_where_its_parabola_says_in_the_revolution_asked(turn, lash):
    """Lift 1 - angle^2 about each nose, with base circles between; a fall ends in a rounding below zero."""
    per_step = STEP * SPEED
    once, flat = np.array([-np.pi, -1.0, 0.0, 1.0]), [0.0, 0.0, 0.0]
    begin = np.array([*once, *(once + 2.0 * np.pi), 3.0 * np.pi])
    lifts = [flat, [0.0, 2.0 * per_step, -(per_step**2)], [1.0, 0.0, -(per_step**2)], [-1e-15, 0.0, 0.0]]
    y = np.array([[7.0, 7.0, *lift] for lift in (*lifts, *lifts, flat)])
    trace = SimpleNamespace(angle=begin, length=np.diff(begin) / per_step, y=y)
    s = SimpleNamespace(
        tables=SimpleNamespace(sizes=Sizes(1, 2, 3, 0)), opening_foot=-1.0,
        train=SimpleNamespace(gap=np.array([lash]), cam_side=np.array([0]), adjusters=np.zeros(0, dtype=int)),
    )  # fmt: skip
    k, length = nominal_closing(s, trace, turn, 0)
    assert k == 2 + 4 * turn
    assert begin[k] + length * per_step == pytest.approx(2.0 * np.pi * turn + np.sqrt(1.0 - lash), abs=1e-9)
    s.train.gap[:] = 1.1  # above the nose
    assert nominal_closing(s, trace, turn, 0)[0] == -1


@pytest.mark.parametrize("turn", [0, 1])
def test_what_adjusters_have_leaked_changes_with_both_states_and_with_the_time_of_the_touch(turn):
    """Two memories of one mass; the rates of the state are a matrix of which the last two columns are theirs."""
    sizes, random, weight, touched = Sizes(1, 4, 2, 0), np.random.default_rng(0), 0.7, 2
    motion = random.normal(size=(1, 7, 3))
    y = random.normal(size=(4, 6)) + np.arange(4.0)[:, None]
    angle = np.array([-3.0, -1.0, 0.0, 1.0]) + 2.0 * np.pi * turn
    trace = SimpleNamespace(angle=angle, length=np.array([20.0, 10.0, 10.0]), slot=np.zeros(3, dtype=int), y=y)
    train = SimpleNamespace(adjusters=np.array([2, 3]), mass=np.ones(1))
    tables = SimpleNamespace(sizes=sizes, motion=motion)
    s = SimpleNamespace(train=train, tables=tables, opening_foot=-1.0, step=STEP)
    total = (y[3] - y[1])[2:4].sum()
    assert leaked(s, trace, turn, touched) == (pytest.approx(total), 1) and total > 0.0
    seeds = no_seeds(3, 6)
    seed_leaked(s, trace, seeds, turn, touched, weight)
    assert seeds.head.tolist() == [-1, 0, 1] and seeds.length[:2].tolist() == [0.0, 10.0]
    assert seeds.bar[0].tolist() == [0, 0, -weight, -weight, 0, 0]
    assert seeds.bar[1].tolist() == [0, 0, weight, weight, 0, 0]
    seen = np.array([*y[3, :5], y[3, 5] / STEP, 1.0])
    assert seeds.time == pytest.approx([0.0, 0.0, weight * (seen @ motion[0, :, 1:]).sum()])
    trace.y, none = y[::-1], no_seeds(3, 6)  # refilled, which counts as nothing lost whatever the states
    seed_leaked(s, trace, none, turn, touched, weight)
    assert leaked(s, trace, turn, touched)[0] == 0.0 and none.used[0] == 0


@pytest.mark.parametrize(
    ("k", "length", "switching"), [(1, 0.0, 0), (1, 4.0, 1), (1, 2.0, None), (2, 0.0, 1), (2, 4.0, None)]
)
def test_an_extreme_at_a_switching_moves_with_its_time(k, length, switching):
    """The watch changes by 30 units per second, which is 0.3 per step."""
    trace, seeds = SimpleNamespace(length=np.full(3, 4.0), watch=np.array([5, 0, -1])), no_seeds(3, 4)
    seed_end(SimpleNamespace(step=STEP), trace, seeds, k, length, 30.0 * STEP)
    assert seeds.time == pytest.approx([2.5 * 30.0 * (i == switching) for i in range(3)])


@pytest.mark.parametrize(("runner_up", "slopes"), [(2.0 - 1e-13, False), (2.0 + 1e-13, False), (1.999, True)])
def test_where_a_value_and_its_runner_up_are_one_there_is_no_gradient(monkeypatch, runner_up, slopes):
    """Rounding would say which of the two is differentiated; where it is not asked for, nothing is spoiled."""
    monkeypatch.setattr(metrics_of, "measure", lambda metric, *_: (2.0, runner_up if metric else -np.inf))
    trace = SimpleNamespace(length=np.ones(3))
    for weight in (1.0, 0.0):
        seeds, values = no_seeds(3, 4)._replace(following=np.zeros(9, dtype=int)), np.empty((2, 2))
        metrics_of.evaluate(None, trace, seeds, np.array([0, 1]), np.array([1.0, weight]), 0, values)
        assert np.array_equal(values, [[2.0, -np.inf], [2.0, runner_up]])
        assert seeds.used[0] == (0 if slopes or weight == 0.0 else 1)
        if seeds.used[0]:
            assert seeds.head[2] == 0 and seeds.length[0] == 1.0 and np.all(np.isnan(seeds.bar[0]))
            metrics_of.evaluate(None, trace, seeds, np.array([0]), np.ones(1), 0, values)
            assert np.all(seeds.head == -1), "what was observed for one metric counts for the next"
