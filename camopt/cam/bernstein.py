"""Polynomials on intervals: Bernstein control points, and a level over the cam angle that consists of pieces.

A polynomial lies between its smallest and its largest control point (Farin, Curves and Surfaces for CAGD, 2002, ch. 5).
"""

from dataclasses import dataclass
from functools import cache
from math import comb
from typing import Any

import numpy as np

from camopt.scene.shapes import Float


@cache
def from_powers(degree: int) -> Float[np.ndarray, "{degree}+1 {degree}+1"]:
    """Matrix from the power coefficients of a polynomial on [0, 1] to its control points."""
    k = range(degree + 1)
    return np.array([[comb(i, j) / comb(degree, j) for j in k] for i in k])


@dataclass(frozen=True)
class PiecewiseLevel:
    """Pieces sum_k c[i, k] (theta - borders[i])^k [SI] between `borders` [rad]; two equal borders are one angle.

    What is meant lies within `error` of the pieces: who holds it takes the lower side, who bounds it the upper.
    """

    borders: Float[np.ndarray, " edges"]
    coefficients: Float[np.ndarray, "p q"]
    error: float = 0.0

    @property
    def low(self) -> float:
        """First angle [rad]."""
        return float(self.borders[0])

    @property
    def high(self) -> float:
        """Last angle [rad]."""
        return float(self.borders[-1])

    @property
    def size(self) -> float:
        """Largest value at a border."""
        return float(np.abs(self.coefficients[:, 0]).max())

    def taylor(self, start: Float[np.ndarray, " k"], within: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k q"]:
        """Power coefficients about angles `start` (k) [rad] of the pieces that hold at angles `within` (k)."""
        piece = np.clip(np.searchsorted(self.borders, within, side="right") - 1, 0, len(self.coefficients) - 1)
        return recentred(self, piece, start)


def recentred(of: Any, piece: np.ndarray, start: Float[np.ndarray, " m"]) -> Float[np.ndarray, "m q"]:
    """Coefficients about new starts [rad] of the pieces of the numbers `piece` (m) of a lift law or a level."""
    c = of.coefficients[piece].copy()
    step = start - of.borders[piece]
    q = c.shape[1]
    for low in range(q - 1):  # repeated synthetic division
        for k in range(q - 2, low - 1, -1):
            c[:, k] += step * c[:, k + 1]
    return c


def flat_level(value: float, low: float, high: float) -> PiecewiseLevel:
    """The same value at all angles from `low` to `high` [rad]."""
    return PiecewiseLevel(np.array([low, high]), np.array([[value]]))
