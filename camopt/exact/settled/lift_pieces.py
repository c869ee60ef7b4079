"""Compression of a lift law to few pieces, so that the kernel does not stop at borders where the lift is smooth.

A ground cam has hundreds of pieces, and a Polydyne has high powers; a span of the kernel ends at every border, and its
tables grow with the powers. Neighbouring pieces are therefore merged to one polynomial of degree 7 if this reproduces
the lift within `LIFT_ERROR` and its slope within `SLOPE_ERROR`, and a piece that it does not reproduce is halved. The
polynomials have the lift's value and slope at both ends, and are least-squares fits in between.
"""

from functools import lru_cache
from math import comb

import numpy as np

from camopt.cam.lift import Lift, without_narrow

LIFT_ERROR = 1e-10
"""Largest error of the lift [m], a tenth of a nanometre: at a contact of 1e8 N/m it causes 0.01 N."""
SLOPE_ERROR = 3e-8
"""Largest error of the slope [m/rad]: at a damper of 1000 N s/m and 400 rad/s it causes 0.01 N."""
WIDTH = 8
"""Number of coefficients per piece."""
WIDEST = np.radians(30.0)
"""Largest width of a merged piece [rad]; pieces of this width are few enough."""
HALVINGS = 6
"""Largest number of times that a piece is halved."""
NODES = -np.cos(np.pi * np.arange(17) / 16)
"""Nodes on [-1, 1] of the fit and of its error."""


@lru_cache(maxsize=256)
def compress_lift(lift: Lift) -> tuple[np.ndarray, np.ndarray]:
    """Borders (p + 1) [rad] and coefficients (p, WIDTH) [m/rad^k] of a lift law; they are zero on the base circle."""
    borders, flat = lift.borders, ~np.any(lift.coefficients, axis=1)
    begin, end, still = borders[:-1], borders[1:], flat
    if lift.coefficients.shape[1] > WIDTH:
        begin, end, still = _halved(lift, begin, end, still)
    parity, idle = 0, 0
    while idle < 2 and len(begin) > 1:
        merged = _merged(lift, begin, end, still, parity)
        idle = idle + 1 if len(merged[0]) == len(begin) else 0
        (begin, end, still), parity = merged, 1 - parity
    coefficients = _fitted(lift, begin, end)[0]
    coefficients[still] = 0.0
    return np.append(begin, end[-1]), coefficients


def lift_between(lift: Lift, borders: np.ndarray) -> Lift:
    """The lift on the pieces between `borders` (p + 1) [rad], for example a ground cam on those of the designed cam.

    A piece is halved if a polynomial of degree 7 does not reproduce the lift.
    """
    borders = without_narrow(borders)
    begin, end, _ = _halved(lift, borders[:-1], borders[1:], np.zeros(len(borders) - 1, bool))
    pieces = _fitted(lift, begin, end)[0]
    return Lift(np.append(begin, end[-1]), pieces, lift.half_duration, lift.family, lift.parameters)


def _halved(lift: Lift, begin, end, still):
    """The pieces after halving those on which a polynomial of degree 7 does not reproduce the lift."""
    for _ in range(HALVINGS):
        bad = ~still & ~_fitted(lift, begin, end)[1]
        if not bad.any():
            break
        middle = 0.5 * (begin + end)
        begin = np.sort(np.concatenate([begin, middle[bad]]))
        end = np.append(begin[1:], end[-1])
        still = np.repeat(still, np.where(bad, 2, 1))
    return begin, end, still


def _merged(lift: Lift, begin, end, still, parity: int):
    """The pieces after merging every second pair of neighbours if one polynomial reproduces the lift."""
    first = np.arange(parity, len(begin) - 1, 2)
    alike = still[first] == still[first + 1]
    first = first[alike & (still[first] | (end[first + 1] - begin[first] <= WIDEST))]
    first = first[_fitted(lift, begin[first], end[first + 1])[1]]
    keep = np.ones(len(begin), bool)
    keep[first + 1] = False
    begin = begin[keep]
    return begin, np.append(begin[1:], end[-1]), still[keep]


def _fitted(lift: Lift, begin: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Polynomials (k, WIDTH) [m/rad^k] about the starts of k intervals, and whether they reproduce the lift there."""
    half = 0.5 * (end - begin)[:, None]
    angle = begin[:, None] + half * (NODES + 1.0)
    angle[:, -1] = end
    piece = np.searchsorted(lift.borders, angle, "right") - 1
    piece[:, 0] = np.searchsorted(lift.borders, begin + 1e-12, "right") - 1
    piece[:, -1] = np.searchsorted(lift.borders, end - 1e-12, "left") - 1
    offset = angle - lift.borders[piece]
    value, slope = np.zeros_like(angle), np.zeros_like(angle)
    for k in range(lift.coefficients.shape[1] - 1, -1, -1):
        slope = slope * offset + value
        value = value * offset + lift.coefficients[piece, k]
    slope = slope * half
    ends = np.stack([value[:, 0], slope[:, 0], value[:, -1], slope[:, -1]], axis=1)
    fitted = ends @ HERMITE + (value - ends @ HERMITE_AT) @ FIT  # (k, WIDTH) in powers of -1 to 1
    error = np.abs(fitted @ POWERS - value).max(axis=1, initial=0.0)
    slope_error = (np.abs(fitted @ SLOPES - slope) / half).max(axis=1, initial=0.0)
    about_start = fitted @ TO_START / half ** np.arange(WIDTH)
    return about_start, (error < LIFT_ERROR) & (slope_error < SLOPE_ERROR)


def _constants() -> tuple[np.ndarray, ...]:
    powers = NODES ** np.arange(WIDTH)[:, None]
    slopes = np.vstack([np.zeros(len(NODES)), np.arange(1, WIDTH)[:, None] * powers[:-1]])
    ends = np.column_stack([powers[:4, 0], slopes[:4, 0], powers[:4, -1], slopes[:4, -1]])
    hermite = np.zeros((4, WIDTH))
    hermite[:, :4] = np.linalg.inv(ends)
    bubble = np.array([1.0, 0.0, -2.0, 0.0, 1.0])  # (1 - x^2)^2: neither value nor slope at the ends
    shapes = np.zeros((WIDTH - 4, WIDTH))
    for k in range(WIDTH - 4):
        shapes[k, k : k + 5] = bubble
    fit = np.linalg.pinv((shapes @ powers).T).T @ shapes
    to_start = np.array([[comb(k, j) * (-1.0) ** (k - j) for j in range(WIDTH)] for k in range(WIDTH)])
    return powers, slopes, hermite, hermite @ powers, fit, to_start


POWERS, SLOPES, HERMITE, HERMITE_AT, FIT, TO_START = _constants()
