"""Sobol points, which fill a cube more evenly than drawn ones, for the few dimensions of a search.

I. M. Sobol (1967), with the direction numbers of S. Joe and F. Y. Kuo, SIAM J. Sci. Comput. 30 (2008) 2635. They are
those of `scipy.stats.qmc.Sobol` without scrambling, digit by digit; loading SciPy's statistics takes longer than a
search of section angles.
"""

import numpy as np

BITS = 30
NUMBERS = ((1, 0, (1,)), (2, 1, (1, 3)), (3, 1, (1, 3, 1)), (3, 2, (1, 1, 1)), (4, 1, (1, 1, 3, 3)),
           (4, 4, (1, 3, 5, 13)), (5, 2, (1, 1, 5, 5, 17)))  # fmt: skip
"""From the second dimension on: degree and inner coefficients of the primitive polynomial, first direction numbers."""
DIMENSIONS = len(NUMBERS) + 1


def sobol(count: int, dimensions: int) -> np.ndarray:
    """The first points (count, dimensions) in [0, 1), the origin first; beyond DIMENSIONS SciPy's own."""
    if dimensions > DIMENSIONS:
        from scipy.stats import qmc

        return qmc.Sobol(dimensions, scramble=False).random(count)
    directions = np.stack([_directions(d) for d in range(dimensions)], axis=1)
    points, at = np.zeros((count, dimensions)), np.zeros(dimensions, dtype=np.int64)
    for i in range(1, count):
        lowest_zero = (~(i - 1) & i).bit_length() - 1  # of i - 1: Gray code (Antonov and Saleev 1979)
        at = at ^ directions[lowest_zero]
        points[i] = at / 2.0**BITS
    return points


def _directions(dimension: int) -> np.ndarray:
    """Direction numbers (BITS) of a dimension, as integers over 2^BITS."""
    if dimension == 0:
        return np.array([1 << (BITS - 1 - i) for i in range(BITS)])
    degree, inner, first = NUMBERS[dimension - 1]
    m = list(first)
    for i in range(degree, BITS):
        new = m[i - degree] ^ (m[i - degree] << degree)
        for k in range(1, degree):
            new ^= ((inner >> (degree - 1 - k)) & 1) * (m[i - k] << k)
        m.append(new)
    return np.array([one << (BITS - 1 - i) for i, one in enumerate(m)])
