"""The largest-area member of a sectioned family under a scene's limits.

For fixed section angles the levels solve a linear program: the area is linear in them, and so is every limit on the
Bernstein control points of a section (Farin, Curves and Surfaces for CAGD, 2002, ch. 5), which bound it at every
angle. The angles are searched around it: the value is continuous in them, because limits that cannot be met are
stretched at a price instead of failing, but it has several maxima, hence a population search (differential evolution,
Storn and Price 1997) before the simplex of Nelder and Mead (1965).
"""

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import pairwise
from math import comb, perm

import numpy as np
from scipy.optimize import differential_evolution, linprog, minimize
from scipy.stats import qmc

from camopt.cam.families.sections import Flank, SectionTable, closed, flank
from camopt.cam.ramps import Ramp
from camopt.scene import InputError
from camopt.scene.schema import Design
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3

SHORTEST = 2.0 * DEG
"""Shortest section of a searched member: without a jerk limit some sections shrink as far as they are let."""
FINE, COARSE = 60, 20
"""Parts of a flank with control points of their own: they exceed the acceleration by about 1e-3 or 1e-2 of it, so that
a coarse program is the safe side of a fine one, in half the time."""
HAIR = 1e-9
"""Relative tightening of every limit, so that round-off in the solver cannot break it."""
STRETCH_PRICE = 100.0
"""Area, in maximum lift times half duration, that stretching all limits by their own size costs."""
TOLERANCES = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-9}
POPULATION, GENERATIONS, SIMPLEX_RUNS, SIMPLEX_STEPS, SEED = 32, 8, 2, 120, 0


@cache
def to_bernstein(degree: int, edges: tuple[float, ...]) -> np.ndarray:
    """Matrix (parts * (degree + 1), degree + 1) from power coefficients on [0, 1] to control points between edges."""
    k = np.arange(degree + 1)
    binomial = np.array([[comb(i, j) for i in k] for j in k], dtype=float)
    rows = np.array([[comb(i, j) / comb(degree, j) for j in k] for i in k])
    parts = []
    for start, end in pairwise(edges):
        taylor = binomial * float(start) ** np.maximum(k - k[:, None], 0)
        parts.append(rows @ ((end - start) ** k[:, None] * taylor))
    return np.concatenate(parts)


def control_points(one: Flank, order: int, parts: int, start: float = 0.0) -> np.ndarray:
    """Rows (c, n) of the control points of the derivative `order` from the angle `start` [rad] to the nose."""
    degree = one.pieces.shape[1] - 1 - order
    factor = np.array([perm(k + order, order) for k in range(degree + 1)], dtype=float)
    shares = np.linspace(0.0, 1.0, max(1, parts // len(one.pieces)) + 1)
    widths = np.diff(one.borders)
    found = []
    for low, width, piece in zip(one.borders[:-1], widths, one.relative, strict=True):
        first = max(0.0, (start - low) / width)
        if first < 1.0:
            matrix = to_bernstein(degree, tuple(shares))
            if first > 0.0:
                matrix = to_bernstein.__wrapped__(degree, tuple(first + (1.0 - first) * shares))
            found.append(matrix @ (factor[:, None] * piece[order:]) / width**order)
    return np.concatenate(found)


def limit_rows(one: Flank, design: Design, jerk: bool, parts: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows (r, n) and bounds (r) with rows @ x <= bound: the design's limits, each relative to its own size."""
    half = one.borders[-1]
    groups = []
    acceleration = control_points(one, 2, parts)
    if design.acceleration_max_mm_per_deg2 is not None:
        groups.append((acceleration / (design.acceleration_max_mm_per_deg2 * MM_PER_DEG2), 1.0))
    if design.acceleration_min_mm_per_deg2 is not None:
        groups.append((acceleration / (design.acceleration_min_mm_per_deg2 * MM_PER_DEG2), 1.0))
    if design.nose_deg:
        usual = design.max_lift_mm * MM / half**2
        groups.append((control_points(one, 2, parts, half - design.nose_deg * DEG) / usual, 0.0))
    if jerk and design.jerk_max_mm_per_deg3 is not None:
        found = control_points(one, 3, parts) / (design.jerk_max_mm_per_deg3 * MM_PER_DEG3)
        groups += [(found, 1.0), (-found, 1.0)]
    lift = control_points(one, 0, 1)[:-2]  # the last two are the end lift itself
    groups.append((lift / (design.max_lift_mm * MM), 1.0))
    bounds = [np.full(len(matrix), bound - HAIR) for matrix, bound in groups]
    return np.concatenate([matrix for matrix, _ in groups]), np.concatenate(bounds)


def best_levels(
    table: SectionTable,
    one: Flank,
    design: Design,
    ramp: Ramp,
    jerk: bool,
    given: Mapping[str, float],
    parts: int = FINE,
) -> tuple[np.ndarray, float, float]:
    """The levels of largest area for one flank, those in `given` [m/rad^order] kept.

    Returns x (n), its area ratio, and the stretch of the limits that it needs: 0 where they can be met.
    """
    half, max_lift = one.borders[-1], design.max_lift_mm * MM
    column = max_lift / half ** table.orders()
    fixed = np.array([ramp.height, ramp.velocity])
    rows, bound = limit_rows(one, design, jerk, parts)
    ends = np.stack([one.end(k) * half**k for k in range(len(table.closed_by))]) / max_lift
    area = one.area() / (max_lift * half)
    kept = [given[n] / c if n in given else None for n, c in zip(table.levels, column, strict=True)]
    result = linprog(
        np.append(-area[2:] * column, STRETCH_PRICE),
        A_ub=np.column_stack([rows[:, 2:] * column, -np.ones(len(rows))]),
        b_ub=bound - rows[:, :2] @ fixed,
        A_eq=np.column_stack([ends[:, 2:] * column, np.zeros(len(ends))]),
        b_eq=np.array([1.0, 0.0])[: len(ends)] - ends[:, :2] @ fixed,
        bounds=[*((k, k) for k in kept), (0.0, None)],
        options=TOLERANCES,
    )
    if result.x is None:
        raise ArithmeticError(f"{table.family}: the linear program of the levels failed: {result.message}")
    free = [n for n in (*table.closed_by, *table.levels) if n not in given]
    x = np.concatenate([fixed, result.x[:-1] * column])
    x = closed(table, one, x, max_lift, free[: len(table.closed_by)])
    return x, float(area @ x) / 2, float(result.x[-1])


def best_angles(
    table: SectionTable,
    design: Design,
    ramp: Ramp,
    jerk: bool,
    starts: Sequence[Sequence[float]],
    generations: int = GENERATIONS,
    seed: int = SEED,
) -> np.ndarray:
    """Section angles [rad] of the largest area, none below `SHORTEST`; the same call gives the same angles.

    `starts`: section angles, in shares of half the duration, that join the first population. Raises InputError where
    no member of the family was found that meets the limits.
    """
    half, count = design.duration_deg * DEG / 2, len(table.sections)
    if half <= count * SHORTEST:
        raise InputError(f"{table.family}: {count} sections of at least {SHORTEST / DEG:g} deg need a longer duration")

    def cost(shares: np.ndarray, parts: int) -> float:
        _, ratio, stretch = best_levels(table, flank(table, _angles(shares, half)), design, ramp, jerk, {}, parts)
        return STRETCH_PRICE / 2 * stretch - ratio

    box = [(0.0, 1.0)] * (count - 1)
    first = qmc.Sobol(count - 1, scramble=False).random(POPULATION)
    for i, start in enumerate(starts):
        first[i] = _shares(np.array(start) * half, half)
    found = differential_evolution(
        cost,
        box,
        args=(COARSE,),
        init=first,  # pyright: ignore[reportArgumentType]  # SciPy's annotation forgets that an array may be given
        maxiter=generations,
        tol=1e-6,
        polish=False,
        rng=np.random.default_rng(seed),
    )
    shares, options = found.x, {"maxfev": SIMPLEX_STEPS, "xatol": 1e-5, "fatol": 1e-8}
    for _ in range(SIMPLEX_RUNS):  # a fresh simplex leaves the kinks of the limits on which the last one collapsed
        shares = minimize(cost, shares, args=(FINE,), method="Nelder-Mead", bounds=box, options=options).x
    return _angles(shares, half)


def _angles(shares: np.ndarray, half: float) -> np.ndarray:
    """Section angles [rad]: each share (count - 1) cuts its part off what the sections before it have left."""
    rest = half - (len(shares) + 1) * SHORTEST
    angles = []
    for share in shares:
        angles.append(SHORTEST + share * rest)
        rest *= 1 - share
    return np.array([*angles, SHORTEST + rest])


def _shares(angles: np.ndarray, half: float) -> np.ndarray:
    """Inverse of `_angles`, clipped to what it can reach."""
    rest, shares = half - len(angles) * SHORTEST, []
    for angle in angles[:-1]:
        shares.append(float(np.clip((angle - SHORTEST) / rest, 0.0, 1.0)) if rest > 0 else 0.0)
        rest *= 1 - shares[-1]
    return np.array(shares)
