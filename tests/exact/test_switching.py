"""Where a watch turns negative, against the roots that NumPy finds of the same polynomial."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from camopt.exact.kernel.switching import SAMPLES, _dip, first_negative, first_suspect, suspect
from camopt.exact.kernel.tables import TERMS
from tests.exact.interpreted import interpret


@pytest.fixture(autouse=True)
def _by_python(monkeypatch):
    interpret(monkeypatch, __name__, "camopt.exact.kernel.")


def series(polynomial):
    return np.pad(polynomial.coef, (0, TERMS + 1 - len(polynomial.coef)))


def falls(polynomial):
    """Where a polynomial falls through zero inside (0, 1)."""
    roots = polynomial.roots()
    inside = np.sort(roots.real[(np.abs(roots.imag) < 1e-12) & (roots.real > 0.0) & (roots.real < 1.0)])
    return inside[polynomial.deriv()(inside) < 0.0]


def first(polynomial):
    return first_negative(series(polynomial), 0.0, 1.0, np.empty(SAMPLES + 1), np.empty(SAMPLES + 1))


@pytest.mark.parametrize("depth", [1.0, 1e-6, 1e-9])
@pytest.mark.parametrize("share", [0.08, 0.31, 0.5, 0.77, 0.9])
def test_a_dip_between_two_samples_is_entered_where_its_polynomial_says(depth, share):
    for i in range(0, SAMPLES, 7):
        lowest, shallow = (i + share) / SAMPLES, 0.9 * depth * (min(share, 1.0 - share) / SAMPLES) ** 2
        dip = Polynomial([-lowest, 1.0]) ** 2 * Polynomial([1.0, 0.3]) - shallow
        entry = falls(dip)[0]
        within = _dip(series(dip), i / SAMPLES, (i + 1) / SAMPLES)
        assert within == pytest.approx(entry, abs=1e-8) and first(dip) == pytest.approx(within, abs=1e-12)
        assert first(dip + 1.01 * shallow) == -1.0


@pytest.mark.parametrize("inside", [Polynomial([0.0, SAMPLES]), Polynomial([1.0, -SAMPLES])])
def test_a_dip_that_only_the_tangent_at_one_sample_foretells_is_found(inside):
    """The slope is small at the other one, beyond which the polynomial turns again."""
    dip = 30.0 * (0.07 - Polynomial.fromroots([0.4, 1.02]).integ())(inside)
    assert first(dip) == pytest.approx(falls(dip)[0], abs=1e-9) and first(dip) < 1.0 / SAMPLES


def test_the_first_fall_of_a_polynomial_is_found():
    random, found = np.random.default_rng(1), 0
    for _ in range(200):
        polynomial = Polynomial(random.normal(size=4) * [1.0, 3.0, 6.0, 6.0])
        polynomial -= polynomial(0.0) - abs(random.normal()) - 0.01
        entries = falls(polynomial)
        assert first(polynomial) == pytest.approx(entries[0] if len(entries) else -1.0, abs=1e-9)
        found += len(entries) > 0
    assert 50 < found < 150


def test_a_watch_is_suspect_where_it_or_a_tangent_at_an_end_is_negative_within_the_step():
    for numbers in np.random.default_rng(2).normal([1.0, 0.0, 1.0, 0.0], size=(200, 4)):
        before, rise, after, last = numbers
        lowest = min(before, before + rise, after, after - last)
        assert suspect(numbers, 0, 0, 1) == (lowest < 0.0)


def test_a_cubic_that_dips_at_the_end_of_a_step_is_suspect():
    before, rise, after, last = 1.0, 0.0, 0.1, 3.0
    cubic = [before, rise, 3.0 * (after - before) - 2.0 * rise - last, rise + last - 2.0 * (after - before)]
    assert len(falls(Polynomial(cubic))) == 1
    assert suspect(np.array([before, rise, after, last]), 0, 0, 1)


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("height", [0.5, 2.0, 6.0])
def test_the_first_suspect_step_is_the_first_one_with_a_suspect_watch(count, height):
    random, steps, at, seen = np.random.default_rng(3), 5, 2, set()
    for _ in range(100):
        looks = np.concatenate([np.zeros((steps + 1, count)) + height, np.zeros((steps + 1, count))], axis=1)
        looks += random.normal(size=looks.shape)
        both = np.concatenate([looks[:-1], looks[1:]], axis=1).reshape(steps, 4, count)
        doubtful = (np.minimum(both[:, 0], both[:, 2]) < 0.0) | (both[:, 0] + both[:, 1] < 0.0)
        doubtful |= both[:, 2] - both[:, 3] < 0.0
        wanted = np.append(np.flatnonzero(doubtful.any(axis=1)), steps)[0]
        assert first_suspect(np.concatenate([np.zeros(at), looks.ravel()]), at, count, steps) == wanted
        seen.add(int(wanted))
    assert len(seen) > 1 or height == 6.0


def test_steep_looks_are_suspect_however_low_all_of_them_are():
    assert first_suspect(np.array([0.1, -3.0, 0.2, 3.0]), 0, 1, 1) == 0
