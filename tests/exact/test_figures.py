"""The highest point of a cubic on a part of its interval, against the roots of its slope."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from camopt.exact.settled import figures
from camopt.exact.settled.figures import excess, excess_lift, top, value
from camopt.scene.units import MM
from tests.exact.interpreted import interpret


@pytest.fixture(autouse=True)
def _by_python(monkeypatch):
    interpret(monkeypatch, __name__, "camopt.exact.")


def test_the_top_of_a_cubic_is_its_highest_turn_or_end():
    random, inner = np.random.default_rng(0), 0
    for _ in range(100):
        power = random.choice([-1.0, 1.0]) * Polynomial.fromroots(random.uniform(-0.2, 1.2, 2)).integ()
        cubic = power(0.0), power.deriv()(0.0), power(1.0), power.deriv()(1.0)
        low, high = np.sort(random.uniform(0.0, 1.0, 2))
        turns = power.deriv().roots()
        turns = turns.real[(np.abs(turns.imag) < 1e-12) & (turns.real > low) & (turns.real < high)]
        assert value(cubic, high) == pytest.approx(power(high), abs=1e-12)
        highest = np.max(power(np.array([low, high, *turns])))
        for best in (-np.inf, highest - 1e-9):
            assert top(cubic, low, high, best) == pytest.approx(highest, abs=1e-12)
        inner += highest > max(power(low), power(high)) + 1e-4
    assert inner > 10


@pytest.mark.parametrize("bend", [-1.0, 1.0])
def test_the_top_of_a_parabola_is_its_vertex(bend):
    """Without a cubic part the slope has one root only."""
    power = Polynomial([0.3, -0.8 * bend, bend])
    cubic = power(0.0), power.deriv()(0.0), power(1.0), power.deriv()(1.0)
    wanted = power(0.4) if bend < 0.0 else power(1.0)
    assert top(cubic, 0.0, 1.0, -np.inf) == pytest.approx(wanted, abs=1e-15)


RISING, FALLING = (0.0, 1.0, 1.0, 1.0), (1.0, -1.0, 0.0, -1.0)


@pytest.mark.parametrize(
    ("distance", "lift", "wanted"),
    [
        (RISING, (0.3, -1.0, -0.7, -1.0), 1.0),
        (RISING, (-0.7, 1.0, 0.3, 1.0), 0.7),
        (FALLING, (0.3, -1.0, -0.7, -1.0), 0.7),
        (FALLING, (-0.7, 1.0, 0.3, 1.0), 1.0),
    ],
)
def test_lift_below_the_lash_does_not_add_to_the_excess(distance, lift, wanted):
    assert excess(distance, lift, -np.inf) == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("turn", [0, 1])
def test_the_excess_of_a_revolution_is_its_own(monkeypatch, turn):
    """In each of three revolutions, of a segment each, the valve rests at another height over a cam without lift."""
    heights, angle = [2.0, 1.0, 3.0], np.pi * np.array([-1.0, 1.0, 3.0, 5.0])

    def resting(operator, state, size, count, seen):
        seen[:] = np.tile([state[0], 0.0], count // 2)

    monkeypatch.setattr(figures, "apply", resting)
    tables = SimpleNamespace(steps=np.zeros((1, 4)), sizes=SimpleNamespace(state=1, lift=2), distance=[None])
    s = SimpleNamespace(train=SimpleNamespace(cam_side=[0], gap=[0.0]), tables=tables)
    y = np.array([[height, 0.0, 0.0] for height in (*heights, 0.0)])
    trace = SimpleNamespace(length=[1.0] * 3, angle=angle, slot=[0] * 3, y=y)
    assert excess_lift(s, trace, turn) == pytest.approx(heights[turn] / MM)


@pytest.mark.parametrize("length", [0.4, 1.4, 2.0, 2.4])
def test_the_valve_is_highest_in_the_last_part_of_a_segment_whether_that_is_a_whole_step_or_not(monkeypatch, length):
    """The distance is a parabola in steps, whose vertex lies a tenth of a step before the segment's end."""
    distance = Polynomial([1.0, 0.0, -1.0])(Polynomial([0.1 - length, 1.0]))

    def sampled(operator, state, size, count, seen):
        for i in range(count // 2):
            seen[2 * i : 2 * i + 2] = distance(float(i)), distance.deriv()(float(i))

    monkeypatch.setattr(figures, "apply", sampled)
    monkeypatch.setattr(figures, "seat_distance", lambda s, state: (distance(length), distance.deriv()(length)))
    tables = SimpleNamespace(steps=np.zeros((1, 4)), sizes=SimpleNamespace(state=0, lift=2), distance=[None])
    s = SimpleNamespace(train=SimpleNamespace(cam_side=[0], gap=[0.0]), tables=tables)
    trace = SimpleNamespace(length=[length], angle=[-0.1, 0.1], slot=[0], y=np.zeros((2, 2)))
    assert excess_lift(s, trace, 0) == pytest.approx(1.0 / MM, rel=1e-12)
