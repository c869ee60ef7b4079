"""A lift on few pieces: the constants of the fit, and which pieces become one."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.exact.settled import lift_pieces
from camopt.exact.settled.lift_pieces import (
    LIFT_ERROR,
    NODES,
    SLOPE_ERROR,
    WIDEST,
    WIDTH,
    _constants,
    compress_lift,
    lift_between,
)
from camopt.measure.as_built import grinding_error, lobe_of
from camopt.scene import load_scene


def test_the_fit_gives_every_polynomial_of_its_degree_back():
    powers, slopes, hermite, hermite_at, fit, to_start = _constants()
    for coefficients in np.random.default_rng(0).normal(size=(5, WIDTH)):
        known = Polynomial(coefficients)
        value, slope = known(NODES), known.deriv()(NODES)
        assert coefficients @ powers == pytest.approx(value) and coefficients @ slopes == pytest.approx(slope)
        ends = np.array([value[0], slope[0], value[-1], slope[-1]])
        found = ends @ hermite + (value - ends @ hermite_at) @ fit
        assert found == pytest.approx(coefficients, abs=1e-12)
        assert coefficients @ to_start == pytest.approx(known(Polynomial([-1.0, 1.0])).coef, abs=1e-12)


def test_the_fit_keeps_value_and_slope_at_both_ends_whatever_lies_between():
    _, _, hermite, hermite_at, fit, _ = _constants()
    value, slope = np.exp(3.0 * NODES), 3.0 * np.exp(3.0 * NODES)
    ends = np.array([value[0], slope[0], value[-1], slope[-1]])
    found = Polynomial(ends @ hermite + (value - ends @ hermite_at) @ fit)
    assert found(NODES[[0, -1]]) == pytest.approx(value[[0, -1]])
    assert found.deriv()(NODES[[0, -1]]) == pytest.approx(slope[[0, -1]])
    assert np.abs(found(NODES) - value).max() < 0.01 * np.abs(ends @ hermite_at - value).max()


@pytest.mark.parametrize(("count", "circle"), [(63, 1), (64, 3), (200, 8)])
def test_pieces_become_one_until_no_two_neighbours_fit_into_the_widest(count, circle):
    """One parabola, cut at equal angles: any two pieces can be one, and a base circle is merged whatever its width."""
    edges, height = np.linspace(-2.0, 2.0, count + 1), 1e-3
    flank = np.stack([height * (4.0 - edges[:-1] ** 2), -2.0 * height * edges[:-1], np.full(count, -height)], axis=1)
    borders = np.concatenate([np.linspace(-np.pi, -2.0, circle + 1)[:-1], edges, [2.5, np.pi]])
    lift = Lift(borders, np.concatenate([np.zeros((circle, 3)), flank, np.zeros((2, 3))]), 2.0)
    few, coefficients = compress_lift(lift)
    still = ~np.any(coefficients, axis=1)
    assert still.tolist() == [True, *[False] * (len(still) - 2), True]
    inside = few[1:-1]
    assert np.diff(inside).max() <= WIDEST < np.min(inside[2:] - inside[:-2])


def test_pieces_of_which_no_two_can_be_one_stay_however_many_they_are(monkeypatch):
    """A zigzag. Both ways to pair neighbours are tried once."""
    edges, tried = np.linspace(-np.pi, np.pi, 301), []
    rise = 1e-3 * np.diff(edges)[0]
    zigzag = Lift(edges, np.array([[0.0, 1e-3], [rise, -1e-3]] * 150), 2.0)
    original = lift_pieces._merged

    def merged(lift, begin, end, still, parity):
        assert parity not in tried
        tried.append(parity)
        return original(lift, begin, end, still, parity)

    monkeypatch.setattr(lift_pieces, "_merged", merged)
    assert np.array_equal(compress_lift(zigzag)[0], edges) and tried == [0, 1]


@pytest.mark.parametrize(
    "of",
    [lambda lift: lift, lambda lift: lift.shifted(grinding_error(lobe_of(lift), 7, 2e-6, (2, 40)))],
    ids=["polydyne", "ground"],
)
def test_few_pieces_follow_the_lift(of):
    lift = of(polydyne(load_scene("kodama")))
    borders, coefficients = compress_lift(lift)
    few = replace(lift, borders=borders, coefficients=coefficients)
    angles = np.linspace(-np.pi, np.pi, 30_001)
    assert np.abs(few(angles) - lift(angles)).max() < 2 * LIFT_ERROR
    assert np.abs(few(angles, 1) - lift(angles, 1)).max() < 2 * SLOPE_ERROR
    assert few.opening_foot == lift.opening_foot
    assert len(coefficients) < 0.7 * len(lift.coefficients)


def test_a_ground_cam_is_given_back_on_the_pieces_of_the_cam_as_designed():
    """Pieces too wide for the error's waves are halved, and no border is lost: slopes are moved back to its pieces."""
    plain = polydyne(load_scene("kodama"))
    waves = plain.shifted(grinding_error(lobe_of(plain), 7, 2e-6, (2, 40)))
    found, angle = lift_between(waves, plain.borders), np.linspace(-np.pi, np.pi, 20_001)
    assert np.isin(plain.borders, found.borders).all()
    assert len(plain.borders) < len(found.borders) < len(waves.borders) / 2
    assert np.abs(found(angle) - waves(angle)).max() < 2.0 * LIFT_ERROR
    assert np.abs(found(angle, 1) - waves(angle, 1)).max() < 2.0 * SLOPE_ERROR


def test_a_piece_of_roundings_width_is_left_out():
    """Ramps may leave one: their straight part has no length where foot and velocity make the whole height."""
    plain, at = polydyne(load_scene("kodama")), 5
    borders = np.insert(plain.borders, at + 1, np.nextafter(plain.borders[at], 4.0))
    pieces = np.insert(plain.coefficients, at, plain.coefficients[at], axis=0)
    found, angle = lift_between(Lift(borders, pieces, plain.half_duration), borders), np.linspace(-np.pi, np.pi, 5_001)
    assert np.diff(found.borders).min() > 1e-6
    assert np.abs(found(angle) - plain(angle)).max() < 2.0 * LIFT_ERROR
