"""The highest point of a cubic on a part of its interval, against the roots of its slope."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from camopt.exact.settled.figures import top, value
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
        assert top(cubic, low, high, -np.inf) == pytest.approx(highest, abs=1e-12)
        inner += highest > max(power(low), power(high)) + 1e-4
    assert inner > 10


@pytest.mark.parametrize("bend", [-1.0, 1.0])
def test_the_top_of_a_parabola_is_its_vertex(bend):
    """Without a cubic part the slope has one root only."""
    power = Polynomial([0.3, -0.8 * bend, bend])
    cubic = power(0.0), power.deriv()(0.0), power(1.0), power.deriv()(1.0)
    wanted = power(0.4) if bend < 0.0 else power(1.0)
    assert top(cubic, 0.0, 1.0, -np.inf) == pytest.approx(wanted, abs=1e-15)
