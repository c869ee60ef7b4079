"""Polynomials on intervals: Bernstein control points, piecewise levels over the cam angle, and osculating pieces.

A polynomial lies between its smallest and its largest control point (Farin, Curves and Surfaces for CAGD, 2002, ch. 5).

Osculating pieces of degree 11 have the value and five derivatives of a smooth law at each border, so that they join
with five continuous derivatives. A law x^p on pieces of `width`, relative to its half duration, is approximated to (p *
width)^12 / (12! 2^12), which is below 1e-12 of its amplitude for p * width < 1.
"""

from dataclasses import dataclass
from functools import cache
from math import comb, prod
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
    """Pieces sum_k c[i, k] (theta - borders[i])^k [SI] between `borders` [rad]; two equal borders stand for one angle.

    The exact level is within `error` of the pieces: a constraint uses the lower side, an upper bound the upper side.
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
        """Power coefficients about the angles `start` (k) [rad] of the pieces that apply at the angles `within` (k)."""
        piece = np.clip(np.searchsorted(self.borders, within, side="right") - 1, 0, len(self.coefficients) - 1)
        return recentred(self, piece, start)


def recentred(law: Any, piece: np.ndarray, start: Float[np.ndarray, " m"]) -> Float[np.ndarray, "m q"]:
    """Coefficients about new starts [rad] of the pieces with the indices `piece` (m) of a lift law or a level."""
    c = law.coefficients[piece].copy()
    step, q = start - law.borders[piece], c.shape[1]
    for low in range(q - 1):  # repeated synthetic division
        for k in range(q - 2, low - 1, -1):
            c[:, k] += step * c[:, k + 1]
    return c


def flat_level(value: float, low: float, high: float) -> PiecewiseLevel:
    """The same value at all angles from `low` to `high` [rad]."""
    return PiecewiseLevel(np.array([low, high]), np.array([[value]]))


MATCHED = 6  # value and five derivatives at each end
_POWERS = np.arange(MATCHED, 2 * MATCHED)
_FACTORIAL = np.cumprod([1, 1, 2, 3, 4, 5])


def falling(powers: np.ndarray, k: int) -> np.ndarray:
    """Factors of the k-th derivative of u^p, by the powers p, in NumPy or JAX; zero where k > p."""
    return prod((powers - i for i in range(k)), start=np.ones(len(powers)))


def power_derivatives(powers: np.ndarray, u: np.ndarray, order: int) -> np.ndarray:
    """The derivative `order` of u^p for every u >= 0 (k) and power p (q), shape (k, q)."""
    factor = falling(powers, order)
    left = powers.__array_namespace__().where(factor != 0, powers - order, 0)
    return factor * u[:, None] ** left


_UPPER = np.array([falling(_POWERS, k) for k in range(MATCHED)], dtype=float)


def osculating_pieces(borders: np.ndarray, derivatives: np.ndarray) -> np.ndarray:
    """Local coefficients (p, 12) on `borders` (p + 1) from the values and five `derivatives` (p + 1, 6). Both arrays
    are NumPy's or both are JAX's."""
    xp = derivatives.__array_namespace__()
    width = xp.diff(borders)[:, None]
    orders = np.arange(MATCHED)
    start = derivatives[:-1] * width**orders / _FACTORIAL  # in units of the piece's own width
    low = np.arange(MATCHED)
    lower = np.array([falling(low, k) for k in range(MATCHED)], dtype=float)
    rest = derivatives[1:] * width**orders - start @ lower.T
    upper = xp.linalg.solve(_UPPER, rest.T).T
    return xp.concatenate([start, upper], axis=1) / width ** np.arange(2 * MATCHED)
