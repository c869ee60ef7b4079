"""The limits of a drawing in a certificate: what their multipliers add to the bound, and to the program they come from.

A limit says that sum_k w_k lift^(k) <= level. Its multipliers are masses >= 0, each spread evenly over a cell of
angles, so that each multiplies the limit's mean over the cell, which every cam that keeps the limit keeps too. As
lift^(k)(t) = start^(k)(t) + integral over s < t of (t - s)^n / n! control(s) ds, the mean over a cell from a to b has
the kernel ((b - s)_+^(n+1) - (a - s)_+^(n+1)) / ((n + 1)! (b - a)), a piecewise polynomial. At one angle the cell is
that angle.
"""

from math import factorial

import numpy as np
from scipy.interpolate import PPoly

from camopt.cam.linear_limits import LinearLimit, linear_limits, radii_held_near
from camopt.cam.polynomials import PiecewiseLevel
from camopt.cam.ramps import Ramp
from camopt.scene.design import Design


def bounded_limits(design: Design) -> list[LinearLimit]:
    """The limits of a drawing that a bound may use: all but those that are held in a chosen way."""
    return [limit for limit in linear_limits(design) if not limit.chosen]


def left_out(design: Design) -> list[str]:
    """The keys of the limits on the shape that the bound leaves out: it holds with them too, only less tightly."""
    shape = [key for key in ("snap_max_mm_per_deg4", "waves_max") if getattr(design, key)]
    chosen = [limit.key for limit in linear_limits(design) if limit.chosen]
    return list(dict.fromkeys([*shape, *chosen, *radii_held_near(design)]))


def cells(limit: LinearLimit, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Begin and end (k) [rad] of the cell of every mass: one angle, or half an interval to both sides of each angle."""
    low, high = limit.level.low, limit.level.high
    if low == high:
        return np.array([low]), np.array([low])
    middles = 0.5 * (grid[1:] + grid[:-1])
    low, high = max(low, grid[0]), min(high, grid[-1])
    starts = np.clip(np.concatenate([grid[:1], middles]), low, high)
    return starts, np.clip(np.concatenate([middles, grid[-1:]]), low, high)


def limit_terms(
    design: Design, grid: np.ndarray, masses: tuple[np.ndarray, ...], opening: Ramp, power: int
) -> tuple[float, PPoly]:
    """Constant and kernel of the sum of mass times (level - weighted sum); the control is lift^(power)."""
    terms, edges, constant = [], [grid], 0.0
    for limit, mass in zip(bounded_limits(design), masses, strict=True):
        begin, end = cells(limit, grid)
        used = (mass > 0) & ((end > begin) | (limit.level.low == limit.level.high))
        begin, end, mass = begin[used], end[used], mass[used]
        constant += float(mass @ (_mean_level(limit.level, begin, end) + limit.level.error))
        middle = 0.5 * (begin + end) - grid[0]
        start = [opening.height + opening.velocity * middle, np.full(len(middle), opening.velocity)]
        for order, weight in enumerate(limit.weights):
            if weight and order < 2:
                constant -= weight * float(mass @ start[order])
            if weight:
                terms.append((begin, end, weight * mass, power - 1 - order))
        edges += [begin, end]
    borders = np.unique(np.clip(np.concatenate(edges), grid[0], grid[-1]))
    taylor = np.zeros((power + 1, len(borders) - 1))
    for begin, end, mass, n in terms:
        _subtract_means(taylor, borders, begin, end, mass, n)
    return constant, PPoly(taylor[::-1], borders)


def _subtract_means(taylor, borders, begin, end, mass, n: int) -> None:
    """Subtracts mass times the mean of (t - s)_+^n / n! over every cell from the Taylor coefficients of the pieces."""
    left, right = borders[:-1], borders[1:]
    for a, b, m in zip(begin, end, mass, strict=True):
        before = right <= a + 1e-15  # s lies wholly before the cell
        inside = ~before & (right <= b + 1e-15)
        x, y = b - left, a - left
        for j in range(n + 2):
            q, sign = n + 1 - j, (-1) ** j / factorial(j)
            if a == b:
                if j <= n:
                    taylor[j, before] -= m * sign * x[before] ** (n - j) / factorial(n - j)
                continue
            if q > 0:  # (x^q - y^q) / (x - y), in which nothing cancels
                mean = sum(x[before] ** i * y[before] ** (q - 1 - i) for i in range(q))
                taylor[j, before] -= m * sign * mean / factorial(q)
            taylor[j, inside] -= m * sign * x[inside] ** q / factorial(q) / (b - a)


def _mean_level(level: PiecewiseLevel, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The mean of the level's pieces over every cell."""
    if len(level.coefficients) == 1:
        return np.full(len(begin), level.coefficients[0, 0])
    total = PPoly(level.coefficients[:, ::-1].T, level.borders).antiderivative()
    return (total(end) - total(begin)) / (end - begin)
