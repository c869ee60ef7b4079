"""What the cam angle imposes: pieces that give lift and forces back, and slopes that are the transpose of these."""

import numpy as np
import pytest

from camopt.exact.affine.inputs import Inputs
from camopt.scene.train import Forcing

BORDERS = np.array([-np.pi, -1.0, 0.5, np.pi])
LIFT = np.array([[0.0, 0.0, 0.0], [0.0, 0.3, -0.1], [0.2, -0.4, 0.05]])
FORCES = (
    Forcing(0, np.array([-np.pi, -1.0, 0.2, np.pi]), np.array([3.0, 7.0, -2.0, 3.0])),
    Forcing(1, np.array([-np.pi, 0.2, 1.3, 2.0, np.pi]), np.array([1.0, -4.0, 6.0, 2.5, 1.0])),
)


def test_the_pieces_are_those_of_the_lift_cut_where_a_force_bends():
    inputs, inside = Inputs(FORCES, BORDERS), np.linspace(-3.1, 3.1, 311)
    assert inputs.borders == pytest.approx([-np.pi, -1.0, 0.2, 0.5, 1.3, 2.0, np.pi])
    at = np.searchsorted(inputs.borders, inside) - 1
    row, u = inputs.pieces(LIFT)[at], inside - inputs.borders[at]
    own = np.searchsorted(BORDERS, inside) - 1
    lift = (LIFT[own] * (inside - BORDERS[own])[:, None] ** np.arange(3)).sum(axis=1)
    assert (row[:, :3] * u[:, None] ** np.arange(3)).sum(axis=1) == pytest.approx(lift, abs=1e-12)
    for j, force in enumerate(FORCES):
        assert row[:, 3 + 2 * j] + row[:, 4 + 2 * j] * u == pytest.approx(force.at(inside), abs=1e-12)


def test_slopes_by_the_pieces_are_those_by_lift_and_rows():
    """Pieces are linear in coefficients and rows: with any cotangents both sides of the transpose agree."""
    rng = np.random.default_rng(0)
    inputs = Inputs(FORCES, BORDERS)
    bars = rng.normal(size=(2, *inputs.pieces(LIFT).shape))
    by_lift, by_rows = inputs.back(bars)
    change = rng.normal(size=LIFT.shape)
    moved = inputs.pieces(LIFT + change) - inputs.pieces(LIFT)
    assert np.einsum("lpq,pq->l", by_lift, change) == pytest.approx(np.einsum("lmj,mj->l", bars, moved))
    rows = [rng.normal(size=len(force.angle)) for force in FORCES]
    pushed = tuple(Forcing(f.on, f.angle, f.force + row) for f, row in zip(FORCES, rows, strict=True))
    moved = Inputs(pushed, BORDERS).pieces(LIFT) - inputs.pieces(LIFT)
    assert by_rows @ np.concatenate(rows) == pytest.approx(np.einsum("lmj,mj->l", bars, moved))


def test_without_forces_nothing_is_cut():
    inputs, bars = Inputs((), BORDERS), np.ones((2, 3, 3))
    assert inputs.borders is BORDERS and inputs.pieces(LIFT) is LIFT
    by_lift, by_rows = inputs.back(bars)
    assert by_lift is bars and by_rows.shape == (2, 0)
