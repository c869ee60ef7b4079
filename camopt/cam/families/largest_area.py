"""The largest-area member of a sectioned family under a scene's limits.

For fixed section angles a linear program gives the levels: the area is linear in them, and so is every limit
(`section_limits`). The angles are varied by an outer search. The largest area for given angles is continuous in them,
because limits that cannot be met are relaxed at a penalty instead of making the program infeasible, but it has several
maxima. The outer search is therefore a population search (differential evolution, Storn and Price 1997). Its best point
is refined in angles and levels together, where the problem is smooth, by quadratic programs (SLSQP, Kraft 1988).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import differential_evolution, minimize

from camopt.cam.families.section_limits import limit_rows
from camopt.cam.families.sections import Flank, SectionTable, close_flank, opening_flank
from camopt.cam.ramps import Ramp
from camopt.highs import FARTHEST, minimise
from camopt.scene import InputError
from camopt.scene.design import Design
from camopt.scene.units import DEG, MM

SHORTEST = 2.0 * DEG
"""Shortest section of a searched member [rad]; without a jerk limit some sections shrink to it."""
FINE, COARSE = 60, 20
"""Number of parts of a flank with control points of their own. The control points exceed the acceleration by about 1e-3
(fine) or 1e-2 (coarse) of it, so a coarse program is stricter than a fine one, and takes half the time."""
STRETCH_PRICE = 50.0
"""Penalty, in area ratio, for relaxing all limits by their own size."""
LARGEST = 1e2
"""Largest entry of a row. A row with a larger entry belongs to a limit that is a hundred times tighter than any cam of
this lift and duration could satisfy. It is scaled down, so that its relaxation is not relative to the size of the limit
but to a hundredth of the largest entry; otherwise the solver would neglect all other rows."""
MARGIN = 1e-7
"""Relative margin to every limit in the refinement, so that the linear program of the levels remains feasible there."""
POPULATION, GENERATIONS, POLISH_STEPS, SEED = 32, 8, 60, 0


@dataclass(frozen=True)
class Program:
    """The linear program for the levels of one flank: the largest area ratio area @ z + constant with rows @ z <= bound
    and, at the nose, ends @ z = wanted; the levels are column * z.

    Lengths are relative to the maximum lift and angles to half the duration.
    """

    column: np.ndarray  # (m)
    area: np.ndarray  # (m)
    constant: float
    rows: np.ndarray  # (r, m)
    bound: np.ndarray  # (r)
    ends: np.ndarray  # (e, m)
    wanted: np.ndarray  # (e)


def level_program(
    table: SectionTable, flank: Flank, design: Design, ramp: Ramp, jerk: bool, parts: int = FINE
) -> Program:
    """The linear program of the levels for one flank under the design's limits, the jerk limit only with `jerk`."""
    half, max_lift = flank.borders[-1], design.max_lift_mm * MM
    column = max_lift / half ** table.orders()
    fixed = np.array([ramp.height, ramp.velocity])
    rows, bound = limit_rows(flank, design, jerk, parts)
    ends = np.stack([flank.end(k) * half**k for k in range(len(table.closed_by))]) / max_lift
    area = flank.area() / (2 * max_lift * half)
    rows, bound = rows[:, 2:] * column, bound - rows[:, :2] @ fixed
    large = np.maximum(np.maximum(np.abs(rows).max(axis=1), np.abs(bound)) / LARGEST, 1.0)
    return Program(
        column=column,
        area=area[2:] * column,
        constant=float(area[:2] @ fixed),
        rows=rows / large[:, None],
        bound=bound / large,
        ends=ends[:, 2:] * column,
        wanted=np.array([1.0, 0.0])[: len(ends)] - ends[:, :2] @ fixed,
    )


def solved_levels(program: Program, fixed: Sequence[float | None]) -> tuple[np.ndarray, float]:
    """(best z (m), relaxation of the limits, which is 0 if they can be met); numbers in `fixed` fix entries of z."""
    limits = len(program.rows)
    matrix = np.zeros((limits + len(program.ends), len(program.area) + 1))
    matrix[:limits, :-1], matrix[:limits, -1], matrix[limits:, :-1] = program.rows, -1.0, program.ends
    low, high = np.append(np.full(limits, -np.inf), program.wanted), np.append(program.bound, program.wanted)
    box = [(-FARTHEST, FARTHEST) if k is None else (k, k) for k in fixed]
    solution = minimise(np.append(-program.area, STRETCH_PRICE), matrix, low, high, np.array([*box, (0.0, np.inf)])).x
    return solution[:-1], float(solution[-1])


def best_levels(
    table: SectionTable, flank: Flank, design: Design, ramp: Ramp, jerk: bool, fixed: Mapping[str, float]
) -> tuple[np.ndarray, float]:
    """(x (n) of `Flank` with the largest area, relaxation of the limits). Levels in `fixed` [m/rad^order] are fixed.
    The levels that the conditions at the nose determine satisfy these to rounding."""
    linear = level_program(table, flank, design, ramp, jerk)
    fixed_z = [fixed[n] / c if n in fixed else None for n, c in zip(table.levels, linear.column, strict=True)]
    z, stretch = solved_levels(linear, fixed_z)
    free = [n for n in (*table.closed_by, *table.levels) if n not in fixed]
    x = np.array([ramp.height, ramp.velocity, *(z * linear.column)])
    return close_flank(table, flank, x, design.max_lift_mm * MM, free[: len(table.closed_by)]), stretch


def best_angles(
    table: SectionTable,
    design: Design,
    ramp: Ramp,
    jerk: bool,
    starts: Sequence[Sequence[float]],
    generations: int = GENERATIONS,
    seed: int = SEED,
) -> np.ndarray:
    """Section angles [rad] of the largest area, none below `SHORTEST`; the same call gives the same angles. `starts`
    holds section angles, as shares of half the duration, that join the first population."""
    asked = table, design, ramp, jerk, tuple(map(tuple, starts)), generations, seed
    return _best_angles(*asked).copy()


@lru_cache(maxsize=64)  # a comparison needs members that the search for the largest confirmed cam has found
def _best_angles(table, design, ramp, jerk, starts, generations, seed) -> np.ndarray:
    from scipy.stats import qmc  # imported here because it loads all of SciPy's statistics

    half, count = design.duration_deg * DEG / 2, len(table.sections)
    if half <= count * SHORTEST:
        raise InputError(f"{table.family}: {count} sections of at least {SHORTEST / DEG:g} deg need a longer duration")

    def flank_program(shares: np.ndarray, parts: int) -> Program:
        return level_program(table, opening_flank(table, section_angles(shares, half)), design, ramp, jerk, parts)

    def cost(shares: np.ndarray) -> float:
        linear = flank_program(shares, COARSE)
        z, stretch = solved_levels(linear, [None] * len(table.levels))
        return STRETCH_PRICE * stretch - float(linear.area @ z) - linear.constant

    first = qmc.Sobol(count - 1, scramble=False).random(POPULATION)
    for i, start in enumerate(starts):
        first[i] = angle_shares(np.array(start) * half, half)
    best = differential_evolution(
        cost,
        [(0.0, 1.0)] * (count - 1),
        init=first,  # pyright: ignore[reportArgumentType]  # SciPy's annotation forgets that an array may be given
        maxiter=generations,
        tol=1e-6,
        polish=False,
        rng=np.random.default_rng(seed),
    )
    z, _ = solved_levels(flank_program(best.x, FINE), [None] * len(table.levels))
    return section_angles(_polished(flank_program, best.x, z), half)


def _polished(flank_program: Callable[[np.ndarray, int], Program], shares: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Shares (count - 1) of a local optimum near the given shares and levels z; the given ones if SLSQP finds none."""
    count, rows = len(shares), 2 * len(flank_program(shares, FINE).bound)

    @lru_cache(maxsize=64)  # derivatives by the levels are taken at the same angles
    def program_of(angles: tuple[float, ...]) -> Program:
        return flank_program(np.clip(angles, 0.0, 1.0), FINE)

    @lru_cache(maxsize=64)  # SLSQP evaluates the objective and both sets of constraints at the same points
    def at(point: tuple[float, ...]) -> tuple[float, np.ndarray, np.ndarray]:
        linear, levels = program_of(point[:count]), np.array(point[count:])
        slack = np.ones(rows)  # the same number for all angles, whichever rows the nose limit has
        slack[: len(linear.bound)] = linear.bound - MARGIN - linear.rows @ levels
        return -float(linear.area @ levels) - linear.constant, slack, linear.ends @ levels - linear.wanted

    result = minimize(
        lambda v: at(tuple(v))[0],
        np.concatenate([shares, z]),
        method="SLSQP",
        bounds=[(0.0, 1.0)] * count + [(None, None)] * len(z),
        constraints=[
            {"type": "ineq", "fun": lambda v: at(tuple(v))[1]},
            {"type": "eq", "fun": lambda v: at(tuple(v))[2]},
        ],
        options={"maxiter": POLISH_STEPS, "ftol": 1e-9},
    )
    return np.clip(result.x[:count], 0.0, 1.0) if result.success else shares


def section_angles(shares: np.ndarray, half: float) -> np.ndarray:
    """Section angles [rad] of shares (count - 1); each share is taken of the angle that earlier sections have left."""
    rest = half - (len(shares) + 1) * SHORTEST
    angles = []
    for share in shares:
        angles.append(SHORTEST + share * rest)
        rest *= 1 - share
    return np.array([*angles, SHORTEST + rest])


def angle_shares(angles: np.ndarray, half: float) -> np.ndarray:
    """Shares (count - 1) for which `section_angles` gives these angles [rad], clipped to 0 to 1."""
    rest, shares = half - len(angles) * SHORTEST, []
    for angle in angles[:-1]:
        shares.append(float(np.clip((angle - SHORTEST) / rest, 0.0, 1.0)) if rest > 0 else 0.0)
        rest *= 1 - shares[-1]
    return np.array(shares)
