"""Smooth lift laws as polynomial pieces: osculating interpolation of the value and five derivatives at each border.

Pieces of degree 11 meet with five continuous derivatives. A law x^p over pieces of `width` relative to its half
duration is met to (p * width)^12 / (12! 2^12), below 1e-12 of its amplitude for p * width < 1.
"""

import numpy as np

MATCHED = 6  # value and five derivatives at each end
_POWERS = np.arange(MATCHED, 2 * MATCHED)
_FACTORIAL = np.cumprod([1, 1, 2, 3, 4, 5])


def _falling(powers: np.ndarray, k: int) -> np.ndarray:
    """Factor of u^p that k derivatives bring down, zero where k > p."""
    return np.prod([powers - i for i in range(k)], axis=0) if k else np.ones(len(powers))


_UPPER = np.array([_falling(_POWERS, k) for k in range(MATCHED)], dtype=float)


def osculating_pieces(borders: np.ndarray, derivatives: np.ndarray) -> np.ndarray:
    """Local coefficients (p, 12) on `borders` (p + 1) from `derivatives` (p + 1, 6) by the same variable.

    Both arrays are NumPy's or both JAX's.
    """
    xp = derivatives.__array_namespace__()
    width = xp.diff(borders)[:, None]
    orders = np.arange(MATCHED)
    start = derivatives[:-1] * width**orders / _FACTORIAL  # in units of the piece's own width
    low = np.arange(MATCHED)
    lower = np.array([_falling(low, k) for k in range(MATCHED)], dtype=float)
    rest = derivatives[1:] * width**orders - start @ lower.T
    upper = xp.linalg.solve(_UPPER, rest.T).T
    return xp.concatenate([start, upper], axis=1) / width ** np.arange(2 * MATCHED)
