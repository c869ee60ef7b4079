"""Linear programs with many dense rows and few columns: SciPy's HiGHS on a working set of rows that grows as needed.

Of several ten thousand limit and force rows only about as many bind as there are free coefficients. Each round solves
on the working set and adds the rows that the answer breaks, until none is left: the optimum of the whole program.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import linprog

FEASIBILITY = 1e-10
"""Largest violation of a scaled row: the least tolerance that HiGHS takes."""
TOLERANCES = {"primal_feasibility_tolerance": FEASIBILITY, "dual_feasibility_tolerance": 1e-9}
ADDED_PER_ROUND = 400
"""Most violated rows added in one round."""
MAX_ROUNDS = 60
KEPT_PER_COLUMN = 4
"""Rows per column that are kept as the next program's first working set: the tightest ones."""


class Infeasible(Exception):
    """No point satisfies the rows; not a user's error by itself, the caller knows which limits the rows came from."""


@dataclass(frozen=True)
class Rows:
    """Left side of matrix (r, m) @ z <= bound; `column` (m) are typical sizes of z, for the solver's scaling."""

    matrix: np.ndarray
    column: np.ndarray

    @cached_property
    def norm(self) -> np.ndarray:
        """Largest entry of each row at the typical sizes (r); a row of zeros has norm 1."""
        largest = np.abs(self.matrix * self.column).max(axis=1)
        return np.where(largest > 0, largest, 1.0)

    @cached_property
    def scaled(self) -> np.ndarray:
        """The matrix as the solver sees it: typical columns, rows with a largest entry of one."""
        return self.matrix * self.column / self.norm[:, None]


@dataclass(frozen=True)
class Optimum:
    """Maximiser of a linear program: point z (m), value, duals (r) >= 0 with d value / d bound, tightest rows."""

    z: np.ndarray
    value: float
    duals: np.ndarray
    working: np.ndarray  # indices of the tightest rows: a good first working set for a program that differs little

    @property
    def active(self) -> np.ndarray:
        """Rows with a positive dual."""
        return np.flatnonzero(self.duals > 0)


def maximise(objective: np.ndarray, rows: Rows, bound: np.ndarray, working: np.ndarray) -> Optimum:
    """The point z (m) with the largest objective @ z under rows.matrix @ z <= bound (r), z free in sign.

    `working` (w): row indices to begin with; they decide the time taken, not the answer. Raises Infeasible, and
    ArithmeticError where the program is unbounded or the solver gives up.
    """
    level = bound / rows.norm
    cost = objective * rows.column
    cost_scale = np.abs(cost).max() or 1.0
    working = np.unique(working)
    for _ in range(MAX_ROUNDS):
        u, multipliers = _solve(cost / cost_scale, rows.scaled[working], level[working], len(working) == len(level))
        if u is None:
            working = np.arange(len(level))  # unbounded on the working set only
            continue
        excess_of_all = rows.scaled @ u - level
        excess = excess_of_all.copy()
        excess[working] = 0.0  # these hold to the solver's tolerance
        broken = np.flatnonzero(excess > FEASIBILITY)
        if len(broken) == 0:
            duals = np.zeros(len(bound))
            duals[working] = multipliers * cost_scale / rows.norm[working]
            z = u * rows.column
            tightest = np.argsort(-excess_of_all)[: KEPT_PER_COLUMN * len(z)]
            return Optimum(z, float(objective @ z), duals, tightest)
        worst = broken[np.argsort(excess[broken])[-ADDED_PER_ROUND:]]
        working = np.union1d(working, worst)
    raise ArithmeticError(f"the linear program still breaks rows after {MAX_ROUNDS} rounds")


def _solve(cost, matrix, level, whole: bool) -> tuple[np.ndarray | None, np.ndarray]:
    """Solution and duals of one round; (None, empty) where it is unbounded although rows are still left out."""
    for method in ("highs-ds", "highs-ipm"):  # the simplex method gives up on some programs that are nearly infeasible
        answer = linprog(-cost, A_ub=matrix, b_ub=level, bounds=(None, None), method=method, options=TOLERANCES)
        if answer.status in (0, 2, 3):
            break
    else:
        if _least_violation(matrix, level) > FEASIBILITY:
            raise Infeasible(answer.message)
    if answer.status == 2:
        raise Infeasible(answer.message)
    if answer.status == 3 and not whole:
        return None, np.zeros(0)
    if answer.status != 0:
        raise ArithmeticError(f"the linear program was not solved: {answer.message}")
    return answer.x, np.maximum(-answer.ineqlin.marginals, 0.0)


def _least_violation(matrix: np.ndarray, level: np.ndarray) -> float:
    """Smallest s >= 0 for which matrix @ u <= level + s has a solution: a program that always has one."""
    cost = np.append(np.zeros(matrix.shape[1]), 1.0)
    bounds = [(None, None)] * matrix.shape[1] + [(0.0, None)]
    elastic = np.column_stack([matrix, -np.ones(len(level))])
    answer = linprog(cost, A_ub=elastic, b_ub=level, bounds=bounds, method="highs-ds")
    if answer.status != 0:
        raise ArithmeticError(f"whether the linear program has a solution was not decided: {answer.message}")
    return float(answer.fun)


def least_relaxation(rows: Rows, bound: np.ndarray, give: np.ndarray, size: float, working: np.ndarray) -> float | None:
    """Smallest s >= 0 with rows.matrix @ z <= bound + give (r) * s; None where no s is enough.

    `size` is a typical s, for the solver's scaling.
    """
    last = np.zeros(rows.matrix.shape[1] + 1)
    last[-1] = -1.0
    elastic = Rows(np.vstack([np.column_stack([rows.matrix, -give]), last]), np.append(rows.column, size))
    try:
        found = maximise(last, elastic, np.append(bound, 0.0), np.append(working, len(bound)))
    except Infeasible:
        return None
    return max(float(found.z[-1]), 0.0)
