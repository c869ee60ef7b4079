"""Linear programs with many dense rows and few columns: HiGHS on a working set of rows that grows as needed.

Of several ten thousand rows only about as many bind as there are columns. Each round solves the program on the working
set and adds the rows that the solution violates, until there are none. The rows keep their model and its basis, from
which HiGHS's dual simplex method continues when rows are added or right-hand sides change (Huangfu and Hall 2018).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from highspy import HighsBasisStatus

from camopt.highs import FARTHEST, FEASIBILITY, Infeasible, Solver, entries_of, succeeds

NOTHING = 1e-100
"""Size below which entries count as zero, as those of forces that have decayed long after the cam has passed."""
ADDED_PER_ROUND = 400
"""Largest number of rows added in one round: those with the largest violation."""
MAX_ROUNDS = 60
KEPT_PER_COLUMN = 4
"""Rows per column, the tightest ones, that are kept once a model has more than twice as many."""


@dataclass(frozen=True)
class Rows:
    """Left-hand side of matrix (r, m) @ z <= bound; `column` (m) are typical sizes of z, for the solver's scaling."""

    matrix: np.ndarray
    column: np.ndarray

    @cached_property
    def norm(self) -> np.ndarray:
        """Largest entry of each row at the typical sizes (r); 1 for a row without entries above NOTHING."""
        largest = np.abs(self.matrix * self.column).max(axis=1)
        return np.where(largest > NOTHING, largest, 1.0)

    @cached_property
    def scaled(self) -> np.ndarray:
        """The matrix for the solver: columns times the typical sizes, rows with a largest entry of one."""
        return self.matrix * self.column / self.norm[:, None]

    @cached_property
    def model(self) -> "WarmModel":
        """The solver's model of these rows, which keeps the last working set and basis."""
        return WarmModel(self.scaled)


@dataclass(frozen=True)
class Optimum:
    """Maximiser of a linear program: point z (m), value, duals (r) >= 0 with d value / d bound, tightest rows."""

    z: np.ndarray
    value: float
    duals: np.ndarray
    working: np.ndarray  # indices of the tightest rows, a good first working set for a similar program


class WarmModel:
    """A HiGHS model of some rows of `matrix` (r, m), columns free in sign, that keeps its basis between programs.

    Columns are restricted to FARTHEST at first, so that every working set has an optimum.
    """

    def __init__(self, matrix: np.ndarray):
        self.matrix, self.indices = matrix, np.zeros(0, dtype=int)  # indices of the rows in the model
        self.solver, self.reach = Solver(), FARTHEST
        self._highs, self._columns = self.solver.highs, np.arange(matrix.shape[1], dtype=np.int32)
        edge = np.full(len(self._columns), FARTHEST)
        succeeds(self._highs.addVars(len(edge), -edge, edge))

    def add(self, rows: np.ndarray, level: np.ndarray) -> None:
        """Adds `rows` to the model, with right-hand sides from `level` (r)."""
        rows = np.setdiff1d(rows, self.indices)
        starts, columns, entries = entries_of(self.matrix[rows])
        lowest = np.full(len(rows), -np.inf)
        succeeds(self._highs.addRows(len(rows), lowest, level[rows], len(entries), starts[:-1], columns, entries))
        self.indices = np.concatenate([self.indices, rows])

    def keep(self, rows: np.ndarray) -> None:
        """Removes the slack rows that are not among `rows`; the basis remains valid without them."""
        out = np.flatnonzero(self._slack() & ~np.isin(self.indices, rows)).astype(np.int32)
        succeeds(self._highs.deleteRows(len(out), out))
        self.indices = np.delete(self.indices, out)

    def basis(self) -> np.ndarray:
        """Indices of the rows that determine the last solution: the nonbasic ones, as many as columns at a vertex."""
        return self.indices[~self._slack()]

    def _slack(self) -> np.ndarray:
        """Whether each row of the model is slack in the last solution."""
        return np.array([status == HighsBasisStatus.kBasic for status in self._highs.getBasis().row_status], dtype=bool)

    def pose(self, cost: np.ndarray, level: np.ndarray) -> None:
        """Sets the objective (m) and the right-hand sides (r) of the rows in the model."""
        succeeds(self._highs.changeColsCost(len(cost), self._columns, -cost))
        count = len(self.indices)
        rows, lowest = np.arange(count, dtype=np.int32), np.full(count, -np.inf)
        change = self._highs.changeRowsBounds  # pyright: ignore[reportAttributeAccessIssue]  # its stubs leave it out
        succeeds(change(count, rows, lowest, level[self.indices]))

    def within(self, reach: float) -> None:
        """Restricts every column to `reach` on either side of zero."""
        if reach != self.reach:
            edge, self.reach = np.full(len(self._columns), reach), reach
            succeeds(self._highs.changeColsBounds(len(edge), self._columns, -edge, edge))

    def solve(self) -> tuple[np.ndarray, np.ndarray]:
        """Solution (m) and duals of the rows in the model. Raises as `Solver.decide` does."""
        solution = self.solver.decide()
        return np.array(solution.col_value), np.maximum(-np.array(solution.row_dual), 0.0)


def maximise(objective: np.ndarray, rows: Rows, bound: np.ndarray, working: np.ndarray) -> Optimum:
    """The point z (m) with the largest objective @ z under rows.matrix @ z <= bound (r), z free in sign.

    `working` (w) are the row indices of the first working set if the model has no rows yet; they affect only the time
    taken. Raises Infeasible, Unbounded, and ArithmeticError where the solver fails.
    """
    level, model = bound / rows.norm, rows.model
    if level.min(initial=0.0) < -FARTHEST * len(objective):
        raise Infeasible("a row of almost nothing is to be below zero")
    cost = objective * rows.column
    cost_scale = np.abs(cost).max() or 1.0
    model.within(FARTHEST)
    model.pose(cost / cost_scale, level)
    if len(model.indices) == 0:
        model.add(working, level)
    for _ in range(MAX_ROUNDS):
        u, multipliers = model.solve()
        excess = rows.scaled @ u - level
        broken = excess > FEASIBILITY
        broken[model.indices] = False  # these are satisfied to the solver's tolerance
        worst = np.flatnonzero(broken)
        if len(worst):
            model.add(worst[np.argsort(excess[worst])[-ADDED_PER_ROUND:]], level)
        elif np.abs(u).max() >= model.reach:  # no row bounds this direction: it is unbounded or has no effect
            model.within(np.inf)
        else:
            return _optimum(objective, rows, model, u, multipliers * cost_scale, excess)
    raise ArithmeticError(f"the linear program still breaks rows after {MAX_ROUNDS} rounds")


def _optimum(objective, rows: Rows, model: WarmModel, u, multipliers, excess) -> Optimum:
    """The optimum at the scaled point u (m), which violates no row; the slackest rows are removed from the model."""
    duals = np.zeros(len(excess))
    duals[model.indices] = multipliers / rows.norm[model.indices]
    z = u * rows.column
    tightest = np.argsort(-excess)[: KEPT_PER_COLUMN * len(z)]
    if len(model.indices) > 2 * len(tightest):
        model.keep(tightest)
    return Optimum(z, float(objective @ z), duals, tightest)


class ElasticProgram:
    """A linear program with penalised constraint violation (elastic mode).

    The last entry of a point is s >= 0. Row i of (r, m) may be violated by give[i] * s, and the objective is reduced by
    cost * s. `size` is a typical s, for the solver's scaling.
    """

    def __init__(self, rows: Rows, bound: np.ndarray, give: np.ndarray, objective, cost: float, size: float, working):
        last = np.append(np.zeros(len(rows.column)), -1.0)
        matrix = np.vstack([np.column_stack([rows.matrix, -give]), last])
        self.bound, self.rows = bound, Rows(matrix, np.append(rows.column, size))
        self.objective, self.working = np.append(objective, -cost), np.append(working, len(give))

    def solve(self, bound: np.ndarray | None = None) -> Optimum:
        """The point of largest value, with other right-hand sides (r) if these are given. Raises Infeasible where the
        rows that may not be violated contradict each other."""
        bound = self.bound if bound is None else bound
        return maximise(self.objective, self.rows, np.append(bound, 0.0), self.working)


def least_relaxation(rows: Rows, bound: np.ndarray, give: np.ndarray, size: float, working: np.ndarray) -> float | None:
    """Smallest s >= 0 with rows.matrix @ z <= bound + give (r) * s; None where no s is enough."""
    try:
        optimum = ElasticProgram(rows, bound, give, np.zeros(len(rows.column)), 1.0, size, working).solve()
    except Infeasible:
        return None
    return max(float(optimum.z[-1]), 0.0)
