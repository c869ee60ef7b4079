"""Crests and near misses of watches that are polynomials, against the roots of their slopes."""

from math import comb
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from camopt.exact.kernel.instants import TIE, _summit, crest, largest, nearest_miss
from camopt.exact.kernel.tables import SEPARATED, TERMS
from tests.exact.interpreted import interpret

WIDTH = 7
"""Coefficients of a polynomial, which are the state here."""
PER_STEP = 0.01
"""Angle per step [rad]."""


@pytest.fixture(autouse=True)
def _by_python(monkeypatch):
    interpret(monkeypatch, __name__, "camopt.exact.kernel.")


def traced(*segments, others=()):
    """(setting, trace) whose last watch is in each segment (polynomial of the steps since its start, length); before it
    stand those of another element, which are the same in all segments."""
    steps = int(max(length for _, length in segments)) + 1
    moved = np.zeros((steps + 1, WIDTH + 1, WIDTH))
    for i, j, k in np.ndindex(steps + 1, WIDTH, WIDTH):
        moved[i, j, k] = comb(j, k) * i ** (j - k) if j >= k else 0.0
    count = len(others) + 1
    series = np.zeros((1, count, WIDTH + 1, TERMS + 1))
    series[0, -1, :WIDTH, :WIDTH] = np.eye(WIDTH)
    tables = SimpleNamespace(
        count=np.array([count]), element=np.array([[*[1] * len(others), 0]]), states=np.array([[SEPARATED, SEPARATED]]),
        steps=moved[None], series=series,
    )  # fmt: skip
    looks = [[q.deriv(d)(i) for i in range(steps + 1) for d in (0, 1) for q in (*others, p)] for p, _ in segments]
    lengths = np.array([float(length) for _, length in segments])
    trace = SimpleNamespace(
        angle=np.concatenate([[0.0], PER_STEP * np.cumsum(lengths)]), length=lengths,
        slot=np.zeros(len(segments), dtype=int), looks=np.array(looks),
        y=np.array([np.pad(p.coef, (0, WIDTH - len(p.coef))) for p, _ in segments]),
    )  # fmt: skip
    return SimpleNamespace(tables=tables, cam=SimpleNamespace(speed=PER_STEP), step=1.0), trace


def turns(polynomial, low, high):
    """Where a polynomial turns inside (low, high)."""
    roots = polynomial.deriv().roots()
    return np.sort(roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > low) & (roots.real < high)])


@pytest.mark.parametrize("size", [1.0, 1e-4])
def test_the_crest_of_a_polynomial_is_its_highest_turn_or_end(size):
    random, inner = np.random.default_rng(0), 0
    for _ in range(60):
        polynomial, sign = size * Polynomial.fromroots(random.uniform(-0.2, 1.2, 2)).integ(), random.choice([-1.0, 1.0])
        low, high = np.sort(random.uniform(0.0, 1.0, 2))
        places = np.array([low, high, *turns(polynomial, low, high)])
        wanted = places[np.argmax(sign * polynomial(places))]
        w = np.pad(polynomial.coef, (0, TERMS + 1 - len(polynomial.coef)))
        at, best, steep, inside = crest(w, sign, low, high)
        assert at == pytest.approx(wanted, abs=1e-9) and best == pytest.approx(sign * polynomial(wanted), abs=1e-12)
        assert steep == pytest.approx(0.0 if inside else sign * polynomial.deriv()(wanted), abs=1e-12)
        assert inside == (low < wanted < high)
        inner += inside
    assert 10 < inner < 50


def test_a_crest_is_sought_between_its_ends_though_newton_leads_beyond_another():
    """From the middle, where the slope hardly falls, the first step ends at 2.6."""
    slope = -Polynomial.fromroots([0.7, 2.0, 3.0]) * (Polynomial([-0.4, 1.0]) ** 2 + 0.0257)
    w = np.pad(slope.integ().coef, (0, TERMS - 6))
    assert _summit(w, 1.0, 0.0, 1.0) == pytest.approx(0.7, abs=1e-12)


HUMPS = 2.0 - 0.01 * Polynomial.fromroots([1.3, 1.3, 6.6, 6.6])
"""Two crests of height 2."""


@pytest.mark.parametrize("tilt", [2e-5, -2e-5])
@pytest.mark.parametrize("lengths", [(8.0,), (4.0, 4.0), (2.5, 1.75, 3.75)])
def test_the_runner_up_is_the_other_crest_whichever_comes_first(tilt, lengths):
    whole = HUMPS + Polynomial([0.0, tilt])
    starts = np.cumsum([0.0, *lengths])[:-1]
    s, trace = traced(
        *((whole(Polynomial([start, 1.0])), length) for start, length in zip(starts, lengths, strict=True))
    )
    crests = np.array([t for t in turns(whole, 0.0, 8.0) if whole.deriv(2)(t) < 0.0])
    second, first = crests[np.argsort(whole(crests))]
    value, k, length, slope, runner = largest(s, trace, 0, SEPARATED, 1.0, 0.0, trace.angle[-1])
    assert (value, starts[k] + length) == pytest.approx((whole(first), first), abs=1e-9) and slope == 0.0
    assert value > runner == pytest.approx(whole(second), abs=1e-12)
    assert runner > value * (1.0 - TIE)


@pytest.mark.parametrize("before", [-1e-14, 0.0, 1e-14])
@pytest.mark.parametrize("after", [-1e-14, 0.0, 1e-14])
@pytest.mark.parametrize("higher", [0.0, 1.0005])
def test_a_crest_where_two_segments_meet_is_one_whatever_rounding_says(before, after, higher):
    """The slope at its end, and at the start of the next segment, is zero but for rounding of either sign."""
    rise, fall = Polynomial([-8.0, 6.0 + before, -1.0]), Polynomial([1.0, after, -1.0])  # crests of 1 at 3 and at 0
    rest = [(higher + Polynomial([0.0, 0.0, -1.0])(Polynomial([-1.5, 1.0])), 3.0)] if higher else []
    s, trace = traced((rise, 3.0), (fall, 2.0), *rest)
    value, k, _, _, runner = largest(s, trace, 0, SEPARATED, 1.0, 0.0, trace.angle[-1])
    assert value == pytest.approx(max(1.0, higher), abs=1e-12) and (k == 2) == (higher > 1.0)
    assert runner == (pytest.approx(1.0, abs=1e-12) if higher else -np.inf)


@pytest.mark.parametrize(("low", "high"), [(0.4, 1.1), (1.7, 5.2), (3.1, 3.9), (5.5, 8.0)])
def test_the_largest_value_between_two_angles_is_sought_there_only(low, high):
    s, trace = traced((HUMPS, 8.0))
    places = np.array([low, high, *turns(HUMPS, low, high)])
    for sign in (1.0, -1.0):
        wanted = np.max(sign * HUMPS(places))
        value, _, length, _, _ = largest(s, trace, 0, SEPARATED, sign, low * PER_STEP, high * PER_STEP)
        assert value == pytest.approx(wanted, abs=1e-12)
        assert sign * HUMPS(length) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("others", [(), (Polynomial([9.0, -1.0]),), (Polynomial([9.0, -1.0]), Polynomial([1.0, 1.0]))])
@pytest.mark.parametrize(
    "swings",
    [
        (Polynomial([2.0, -1.0, 0.2]), Polynomial([1.0, 0.4, -0.3, 0.04])),
        (Polynomial([6.30, -5.0, 1.0]), Polynomial([6.26, -5.0, 1.0])),  # whose tangents cross far below zero
    ],
)
def test_the_nearest_miss_is_the_lowest_point_at_which_a_watch_turns_back(others, swings):
    s, trace = traced(*((swing, 6.0) for swing in swings), others=others)
    lowest = [swing(t) for swing in swings for t in turns(swing, 0.0, 6.0) if swing.deriv(2)(t) > 0.0]
    assert len(lowest) == 2
    assert nearest_miss(s, trace, 0) == pytest.approx(min(lowest), abs=1e-12)
    assert nearest_miss(*traced((Polynomial([1.0, -0.1]), 6.0)), 0) == np.inf
