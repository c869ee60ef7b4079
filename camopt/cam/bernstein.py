"""Bernstein control points: a polynomial lies between its smallest and its largest one (Farin 2002, ch. 5)."""

from functools import cache
from math import comb

import numpy as np

from camopt.scene.shapes import Float


@cache
def from_powers(degree: int) -> Float[np.ndarray, "{degree}+1 {degree}+1"]:
    """Matrix from the power coefficients of a polynomial on [0, 1] to its control points."""
    k = range(degree + 1)
    return np.array([[comb(i, j) / comb(degree, j) for j in k] for i in k])
