"""The inputs given over the cam angle, lift and forces, on common pieces that end where either of them has a border.

In a piece a force is constant + slope (angle - start). Without such forces the lift's pieces are unchanged.
"""

from collections.abc import Sequence
from functools import cached_property
from math import comb

import numpy as np

from camopt.scene.train import Forcing

APART = 1e-12
"""Angle [rad] within which a row of a force coincides with a border of the lift."""


class Inputs:
    """The division of p pieces of a lift into m pieces by the rows of f forces."""

    def __init__(self, forcing: Sequence[Forcing], borders: np.ndarray):
        self.forcing, self.lift_borders, self.borders = tuple(forcing), borders, borders
        if self.forcing:
            rows = np.unique(np.concatenate([force.angle for force in self.forcing]))
            new = rows[np.abs(rows[:, None] - borders).min(axis=1) > APART]
            self.borders = np.sort(np.concatenate([borders, new[np.diff(new, prepend=-np.inf) > APART]]))

    @cached_property
    def _piece(self) -> np.ndarray:
        """The lift's piece that contains each piece (m)."""
        return np.searchsorted(self.lift_borders, self.borders[:-1], "right") - 1

    @cached_property
    def _moved(self) -> np.ndarray:
        """Matrices (m, q, q), for the largest q, that shift polynomial coefficients to the starts of the pieces."""
        k = np.arange(64)
        binomial = np.array([[float(comb(j, i)) for j in k] for i in k])
        offset = self.borders[:-1] - self.lift_borders[self._piece]
        return binomial * offset[:, None, None] ** np.maximum(k - k[:, None], 0)

    @cached_property
    def _rows(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """For each force: the row before the start of each piece (m), the position of this start between the row and
        the next one as a share (m), and the distance of the two rows (m) [rad]."""
        rows = []
        for force in self.forcing:
            i = np.clip(np.searchsorted(force.angle, self.borders[:-1] + APART, "right") - 1, 0, len(force.angle) - 2)
            width = force.angle[i + 1] - force.angle[i]
            rows.append((i, (self.borders[:-1] - force.angle[i]) / width, width))
        return rows

    def pieces(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients (m, q + 2f) of all inputs, [m/rad^k] then [N, N/rad], from those of the lift (p, q)."""
        if not self.forcing:
            return coefficients
        q = coefficients.shape[1]
        lift = np.einsum("mij,mj->mi", self._moved[:, :q, :q], coefficients[self._piece])
        columns = [lift]
        for force, (i, share, width) in zip(self.forcing, self._rows, strict=True):
            low, high = force.force[i], force.force[i + 1]
            columns.append(np.stack([low + share * (high - low), (high - low) / width], axis=1))
        return np.concatenate(columns, axis=1)

    def back(self, by_pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradients of l numbers with respect to the lift's coefficients (l, p, q) and to the rows of all forces
        (l, rows), from those with respect to the inputs' pieces (l, m, q + 2f)."""
        count, q = len(by_pieces), by_pieces.shape[2] - 2 * len(self.forcing)
        if not self.forcing:
            return by_pieces, np.zeros((count, 0))
        moved = np.einsum("lmi,mij->lmj", by_pieces[:, :, :q], self._moved[:, :q, :q])
        by_lift = np.einsum("lmj,mp->lpj", moved, np.eye(len(self.lift_borders) - 1)[self._piece])
        rows = []
        for j, (force, (i, share, width)) in enumerate(zip(self.forcing, self._rows, strict=True)):
            by_constant, by_slope = by_pieces[:, :, q + 2 * j], by_pieces[:, :, q + 2 * j + 1] / width
            row = np.eye(len(force.angle))
            rows.append(
                (by_constant * (1.0 - share) - by_slope) @ row[i] + (by_constant * share + by_slope) @ row[i + 1]
            )
        return by_lift, np.concatenate(rows, axis=1)
