"""The limits of a design on the flank of a sectioned cam, as rows on its levels that hold at every angle.

They bound the Bernstein control points of parts of the sections. The cam is symmetric, so a limit on the closing flank
is imposed on the opening flank as its mirror image.
"""

from functools import cache, lru_cache

import numpy as np
from scipy.linalg import pascal

from camopt.cam.families.sections import Flank
from camopt.cam.linear_limits import LinearLimit, linear_limits
from camopt.cam.polynomials import PiecewiseLevel, falling, from_powers
from camopt.scene.design import ROUNDING, Design
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3

NO_BOUND = 1e3
"""Bound, relative to the size of a limit, in place of an infinite one; no cam reaches it."""


@cache
def to_bernstein(degree: int, edges: tuple[float, ...]) -> np.ndarray:
    """Matrix (parts * (degree + 1), degree + 1) from power coefficients on [0, 1] to control points between `edges`."""
    k = np.arange(degree + 1)
    start, end = np.array(edges[:-1])[:, None, None], np.array(edges[1:])[:, None, None]
    taylor = pascal(degree + 1, kind="upper") * start ** np.maximum(k - k[:, None], 0)
    parts = from_powers(degree) @ ((end - start) ** k[:, None] * taylor)
    return parts.reshape(-1, degree + 1)


def control_points(flank: Flank, order: int, parts: int, start: float = 0.0) -> np.ndarray:
    """Rows (c, n) of the control points of the derivative `order` from the angle `start` [rad] to the nose."""
    degree = flank.pieces.shape[1] - 1 - order
    widths = np.diff(flank.borders)
    powers = falling(np.arange(order, order + degree + 1), order)[:, None] * flank.relative[:, order:]
    shares = _shares(max(1, parts // len(flank.pieces)))
    inside = np.searchsorted(flank.borders[:-1], start)  # the first piece that begins at or after the start
    matrix = to_bernstein(degree, shares) @ powers[inside:] / widths[inside:, None, None] ** order
    points = matrix.reshape(-1, matrix.shape[2])
    first = max(0.0, (start - flank.borders[inside - 1]) / widths[inside - 1]) if inside else 1.0
    if first == 1.0:
        return points
    edges = tuple(first + (1.0 - first) * share for share in shares)
    begun = to_bernstein.__wrapped__(degree, edges) @ powers[inside - 1] / widths[inside - 1] ** order
    return np.concatenate([begun, points])


@cache
def _shares(parts: int) -> tuple[float, ...]:
    """Edges of equal parts of a piece, from 0 to 1."""
    return tuple(np.linspace(0.0, 1.0, parts + 1).tolist())


def limit_rows(flank: Flank, design: Design, jerk: bool, parts: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows (r, n) and bounds (r) of the design's limits, rows @ x <= bound, each relative to the size of the limit."""
    half = flank.borders[-1]
    groups = []
    acceleration = control_points(flank, 2, parts)
    if design.acceleration_max_mm_per_deg2 is not None:
        groups.append((acceleration / (design.acceleration_max_mm_per_deg2 * MM_PER_DEG2), 1.0))
    if design.acceleration_min_mm_per_deg2 is not None:
        groups.append((acceleration / (design.acceleration_min_mm_per_deg2 * MM_PER_DEG2), 1.0))
    if jerk and design.jerk_max_mm_per_deg3 is not None:
        jerk_points = control_points(flank, 3, parts) / (design.jerk_max_mm_per_deg3 * MM_PER_DEG3)
        groups += [(jerk_points, 1.0), (-jerk_points, 1.0)]
    lift = control_points(flank, 0, 1)[:-2]  # the last two are the end lift itself
    groups.append((lift / (design.max_lift_mm * MM), 1.0))
    for limit in _linear_limits(design):  # pyright: ignore[reportArgumentType]  (frozen, and so hashable)
        groups += [drawing_rows(flank, limit, side, parts) for side in sides(limit)]
    if design.nose_deg:  # last, and from the nose outwards, so that a section that leaves it drops rows at the end only
        usual = design.max_lift_mm * MM / half**2
        groups.append((control_points(flank, 2, parts, half - design.nose_deg * DEG)[::-1] / usual, 0.0))
    matrices, bounds = zip(*groups, strict=True)
    counts = [len(matrix) for matrix in matrices]
    return np.concatenate(matrices), np.concatenate(
        [np.full(n, bound) - ROUNDING for n, bound in zip(counts, bounds, strict=True)]
    )


@lru_cache(maxsize=16)
def _linear_limits(design: Design) -> tuple[LinearLimit, ...]:
    return tuple(linear_limits(design))


def sides(limit: LinearLimit) -> tuple[int, ...]:
    """The flanks on which rows of a limit differ: 1 the opening one, -1 the closing one."""
    level = limit.level
    if level.low == level.high:
        return (1 if level.low <= 0 else -1,)
    mirrored = len(level.coefficients) == 1 and level.low == -level.high
    return (1,) if mirrored and not any(limit.weights[1::2]) else (1, -1)


def drawing_rows(flank: Flank, limit: LinearLimit, side: int, parts: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows (c, n) and bounds (c) of a limit of the drawing on one flank, relative to its size."""
    weights = [w * side**k for k, w in enumerate(limit.weights)]
    half, size = flank.borders[-1], limit.size
    degree = flank.pieces.shape[1] - 1
    widths = np.diff(flank.borders)
    powers = np.zeros_like(flank.relative)  # of the weighted sum, by the angle relative to each piece's width
    for k, weight in enumerate(weights):
        factor = falling(np.arange(k, degree + 1), k)
        powers[:, : degree + 1 - k] += weight * factor[:, None] * flank.relative[:, k:] / widths[:, None, None] ** k
    if limit.level.low == limit.level.high:
        at = half - abs(limit.level.low)
        piece = min(int(np.searchsorted(flank.borders, at, side="right")) - 1, len(powers) - 1)
        row = ((at - flank.borders[piece]) / widths[piece]) ** np.arange(degree + 1) @ powers[piece]
        return row[None] / size, limit.level.coefficients[0] / size
    shares = _shares(max(1, parts // len(powers)))
    matrix = to_bernstein(degree, shares) @ powers
    edges = (flank.borders[:-1, None] + widths[:, None] * np.array(shares) - half) * side  # cam angles
    begin, end = np.sort([edges[:, :-1].ravel(), edges[:, 1:].ravel()], axis=0)
    bound = np.repeat(_lower_bound(limit.level, begin, end), degree + 1)
    return matrix.reshape(-1, matrix.shape[2]) / size, np.minimum(bound / size, NO_BOUND)


def _lower_bound(level: PiecewiseLevel, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """A lower bound on the level between `begin` and `end` (k) [rad], by the pieces there; infinite outside it."""
    width = np.diff(level.borders)[:, None] ** np.arange(level.coefficients.shape[1])
    least = (level.coefficients * width @ from_powers(level.coefficients.shape[1] - 1).T).min(axis=1) - level.error
    count = len(least)
    first = np.clip(np.searchsorted(level.borders, begin, side="right") - 1, 0, count - 1)
    last = np.clip(np.searchsorted(level.borders, end, side="left"), first + 1, count)
    reaching = np.minimum.reduceat(np.append(least, np.inf), np.column_stack([first, last]).ravel())[::2]
    outside = (end <= level.low + 1e-12) | (begin >= level.high - 1e-12)
    return np.where(outside, np.inf, reaching)
