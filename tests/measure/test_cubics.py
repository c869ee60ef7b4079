"""Stationary points and changes of sign of chains of cubics, against the roots of each polynomial by NumPy."""

import numpy as np
import pytest

from camopt.measure.cubics import sign_changes, with_stationary_points

POINTS, CHANGES = (getattr(program, "py_func", program) for program in (with_stationary_points, sign_changes))
"""As plain Python, which these few pieces do not notice."""


@pytest.fixture(params=range(4))
def chain(request):
    """Angles, values, steps and coefficients of cubics that join without a step."""
    drawn = np.random.default_rng(request.param)
    step = drawn.uniform(0.1, 2.0, 12)
    slopes = drawn.normal(size=(3, 12))
    values = np.concatenate([[0.3], 0.3 + np.cumsum(slopes.sum(axis=0))])
    return np.concatenate([[-1.0], -1.0 + np.cumsum(step)]), values, step, np.vstack([values[:-1], slopes])


def inside(coefficients):
    """Real roots between zero and one of a polynomial in ascending powers."""
    roots = np.polynomial.polynomial.polyroots(coefficients)
    roots = roots[np.abs(roots.imag) < 1e-9].real
    return np.sort(roots[(roots > 0.0) & (roots < 1.0)])


def test_every_stationary_point_stands_between_its_samples_with_its_value(chain):
    angle, values, step, c = chain
    expected = [(angle[0], values[0])]
    for i in range(len(step)):
        piece = np.polynomial.Polynomial(c[:, i])
        expected += [(angle[i] + u * step[i], piece(u)) for u in inside(piece.deriv().coef)]
        expected.append((angle[i + 1], values[i + 1]))
    assert len(expected) > len(angle)
    np.testing.assert_allclose(np.stack(POINTS(*chain), axis=1), expected, rtol=0.0, atol=1e-9)


def test_every_change_of_sign_is_found_with_its_direction(chain):
    angle, _, step, c = chain
    expected = [
        (angle[i] + u * step[i], float(np.polynomial.Polynomial(c[:, i]).deriv()(u) < 0.0))
        for i in range(len(step))
        for u in inside(c[:, i])
    ]
    assert expected
    found = CHANGES(angle, step, c, *POINTS(*chain))
    np.testing.assert_allclose(np.stack(found, axis=1), expected, rtol=0.0, atol=1e-9)


def test_a_change_of_sign_in_a_last_step_of_one_rounding_is_found_there():
    one = np.spacing(1.0)
    angle, values = np.array([0.0, 1.0 + one, 1.0 + 2.0 * one]), np.array([-2.0, -1.0, 1.0])
    step = np.diff(angle)
    c = np.vstack([values[:-1], np.diff(values), np.zeros((2, 2))])
    at, falling = CHANGES(angle, step, c, angle, values)
    assert 1.0 + one <= at[0] <= 1.0 + 2.0 * one and falling.tolist() == [False]
