"""Linear programs with many dense rows and few columns: HiGHS on a working set of rows that grows as needed.

Of several ten thousand limit and force rows only about as many bind as there are free coefficients. Each round solves
on the working set and adds the rows that the answer breaks, until none is left: the optimum of the whole program. The
rows keep their model and its basis: the dual simplex method goes on from it when rows are added, and when the program
is solved again with other right sides (Huangfu and Hall 2018, as HiGHS has it).
"""

from dataclasses import dataclass
from functools import cached_property

import highspy
import numpy as np
from highspy import HighsBasisStatus, HighsModelStatus, HighsStatus

FEASIBILITY = 1e-10
"""Largest violation of a scaled row: the least tolerance that HiGHS takes."""
SMALLEST = 1e-12
"""Entries of scaled rows that are left out: the least size that HiGHS takes."""
NOTHING = 1e-100
"""Entries that count as zero: what is left of a force long after the cam has passed, at low speeds and high damping."""
FARTHEST = 1e15
"""Distance from zero, in typical columns, to which no row may ask a point to go: a row of almost nothing whose right
side is below zero. HiGHS refuses such numbers."""
OPTIONS = {
    "output_flag": False,
    "presolve": "off",  # it would throw the basis away
    "parallel": "off",  # `threads` stays alone: HiGHS wants one number of them in the whole process
    "primal_feasibility_tolerance": FEASIBILITY,
    "dual_feasibility_tolerance": 1e-9,
    "small_matrix_value": SMALLEST,
    "simplex_iteration_limit": 5000,  # ordinary programs take hundreds; near a contradiction it may go round
}
ATTEMPTS = ("simplex", 0), ("simplex", 0), ("simplex", 1), ("simplex", 2), ("ipx", 0)
"""Solvers and seeds in turn, until one decides: from the basis, without it, perturbed in other ways as HiGHS' authors
advise (ERGO-Code/HiGHS issue 1607), by interior points."""
ADDED_PER_ROUND = 400
"""Most violated rows added in one round."""
MAX_ROUNDS = 60
KEPT_PER_COLUMN = 4
"""Rows per column that are kept for the next program: the tightest ones; slack ones go once there are twice as many."""


class GaveUp(ArithmeticError):
    """The solver ends without an answer."""


class Unbounded(ArithmeticError):
    """Points of any value satisfy the rows."""


class Infeasible(Exception):
    """No point satisfies the rows; not a user's error by itself, the caller knows which limits the rows came from."""


@dataclass(frozen=True)
class Rows:
    """Left side of matrix (r, m) @ z <= bound; `column` (m) are typical sizes of z, for the solver's scaling."""

    matrix: np.ndarray
    column: np.ndarray

    @cached_property
    def norm(self) -> np.ndarray:
        """Largest entry of each row at the typical sizes (r); a row of nothing above NOTHING has norm 1."""
        largest = np.abs(self.matrix * self.column).max(axis=1)
        return np.where(largest > NOTHING, largest, 1.0)

    @cached_property
    def scaled(self) -> np.ndarray:
        """The matrix as the solver sees it: typical columns, rows with a largest entry of one."""
        return self.matrix * self.column / self.norm[:, None]

    @cached_property
    def model(self) -> "WarmModel":
        """The solver's model of these rows, which remembers the last working set and basis."""
        return WarmModel(self.scaled)


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


class WarmModel:
    """A HiGHS model of some rows of `matrix` (r, m), columns free in sign, that keeps its basis between programs."""

    def __init__(self, matrix: np.ndarray):
        self.matrix, self.held = matrix, np.zeros(0, dtype=int)  # indices of the rows in the model
        self.pivots = 0  # of the simplex method, so far
        self._highs = highspy.Highs()
        for name, value in OPTIONS.items():
            _succeeds(self._highs.setOptionValue(name, value))
        self._columns = np.arange(matrix.shape[1], dtype=np.int32)
        free = np.full(len(self._columns), np.inf)
        _succeeds(self._highs.addVars(len(free), -free, free))

    def add(self, rows: np.ndarray, level: np.ndarray) -> None:
        """Take further rows in, their right sides from `level` (r)."""
        rows = np.setdiff1d(rows, self.held)
        dense, lowest = self.matrix[rows], np.full(len(rows), -np.inf)
        kept = np.abs(dense) > SMALLEST
        row, column = np.nonzero(kept)
        starts = np.searchsorted(row, np.arange(len(rows))).astype(np.int32)
        entries, columns = dense[kept], column.astype(np.int32)
        _succeeds(self._highs.addRows(len(rows), lowest, level[rows], len(entries), starts, columns, entries))
        self.held = np.concatenate([self.held, rows])

    def begin_like(self, other: "WarmModel", level: np.ndarray, working: np.ndarray, like: np.ndarray) -> None:
        """Hold the rows that are `like` those of another model with as many columns, and begin from its basis.

        `like` (other.held) are the rows here that stand for the ones held there, -1 where none does. The rows `working`
        are held too: what bounds one program may leave another one that differs unbounded.
        """
        self.add(np.union1d(like[like >= 0], working), level)
        basis = other._highs.getBasis()
        status = {
            row: one for row, one in zip(like.tolist(), basis.row_status, strict=True) if one != HighsBasisStatus.kBasic
        }
        if len(status) < len(other.basis()) or -1 in status:
            return  # rows there share one here, or have none: that is no basis any more
        basis.row_status = [status.get(row, HighsBasisStatus.kBasic) for row in self.held.tolist()]
        _succeeds(self._highs.setBasis(basis))

    def keep(self, rows: np.ndarray) -> None:
        """Leave out the slack rows that are not among `rows`; a basis without them stays one."""
        slack = [status == HighsBasisStatus.kBasic for status in self._highs.getBasis().row_status]
        out = np.flatnonzero(slack & ~np.isin(self.held, rows)).astype(np.int32)
        _succeeds(self._highs.deleteRows(len(out), out))
        self.held = np.delete(self.held, out)

    def basis(self) -> np.ndarray:
        """Indices of the rows that hold the last solution, as many as columns at a vertex: those outside the basis."""
        status = self._highs.getBasis().row_status
        return self.held[[one != HighsBasisStatus.kBasic for one in status]]

    def pose(self, cost: np.ndarray, level: np.ndarray) -> None:
        """Another objective (m) and right sides (r) on the rows in the model."""
        _succeeds(self._highs.changeColsCost(len(cost), self._columns, -cost))
        count = len(self.held)
        every, lowest = np.arange(count, dtype=np.int32), np.full(count, -np.inf)
        change = self._highs.changeRowsBounds  # pyright: ignore[reportAttributeAccessIssue]  # its stubs leave it out
        _succeeds(change(count, every, lowest, level[self.held]))

    def solve(self) -> tuple[np.ndarray | None, np.ndarray]:
        """Solution (m) and duals of the rows in the model; (None, empty) where the program is unbounded on them.

        Raises Infeasible, and GaveUp where the solver decides nothing.
        """
        for solver, seed in ATTEMPTS:
            _succeeds(self._highs.setOptionValue("solver", solver))
            _succeeds(self._highs.setOptionValue("random_seed", seed))
            self._highs.run()
            self.pivots += self._highs.getInfo().simplex_iteration_count
            status = self._highs.getModelStatus()
            if status == HighsModelStatus.kOptimal:
                found = self._highs.getSolution()
                return np.array(found.col_value), np.maximum(-np.array(found.row_dual), 0.0)
            if status == HighsModelStatus.kInfeasible:
                raise Infeasible(f"{len(self.held)} rows have no point in common")
            if status == HighsModelStatus.kUnbounded:
                return None, np.zeros(0)
            _succeeds(self._highs.clearSolver())
        raise GaveUp(
            f"the linear program of {len(self.held)} rows was not solved: {self._highs.modelStatusToString(status)}"
        )


def _succeeds(status: HighsStatus) -> None:
    """HiGHS takes what it is given: warnings and errors are mistakes in this file."""
    if status != HighsStatus.kOk:
        raise RuntimeError(f"HiGHS refused a call: {status}")


def maximise(objective: np.ndarray, rows: Rows, bound: np.ndarray, working: np.ndarray) -> Optimum:
    """The point z (m) with the largest objective @ z under rows.matrix @ z <= bound (r), z free in sign.

    `working` (w): row indices to begin with where these rows are new to the solver; else it goes on from where it
    stands. Both decide the time taken, not the answer. Raises Infeasible, Unbounded, and ArithmeticError where the
    solver gives up.
    """
    level, model = bound / rows.norm, rows.model
    if level.min(initial=0.0) < -FARTHEST:
        raise Infeasible("a row of almost nothing is to be below zero")
    cost = objective * rows.column
    cost_scale = np.abs(cost).max() or 1.0
    model.pose(cost / cost_scale, level)
    if len(model.held) == 0:
        model.add(working, level)
    for _ in range(MAX_ROUNDS):
        u, multipliers = _solved(model, level)
        if u is None:
            if len(model.held) == len(level):
                raise Unbounded("the linear program is unbounded")
            model.add(np.arange(len(level)), level)  # unbounded on the working set only
            continue
        excess = rows.scaled @ u - level
        broken = excess > FEASIBILITY
        broken[model.held] = False  # these hold to the solver's tolerance
        worst = np.flatnonzero(broken)
        if len(worst) == 0:
            duals = np.zeros(len(bound))
            duals[model.held] = multipliers * cost_scale / rows.norm[model.held]
            z = u * rows.column
            tightest = np.argsort(-excess)[: KEPT_PER_COLUMN * len(z)]
            if len(model.held) > 2 * len(tightest):
                model.keep(tightest)
            return Optimum(z, float(objective @ z), duals, tightest)
        model.add(worst[np.argsort(excess[worst])[-ADDED_PER_ROUND:]], level)
    raise ArithmeticError(f"the linear program still breaks rows after {MAX_ROUNDS} rounds")


def _solved(model: WarmModel, level: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """What the model's rows give; where the solver decides nothing, a program that always has a solution decides."""
    try:
        return model.solve()
    except GaveUp:
        if least_violation(model.matrix[model.held], level[model.held]) > FEASIBILITY:
            raise Infeasible(f"{len(model.held)} rows have no point in common") from None
        raise


def least_violation(matrix: np.ndarray, level: np.ndarray) -> float:
    """Smallest s >= 0 for which matrix (r, m) @ u <= level (r) + s has a solution."""
    last = np.append(np.zeros(matrix.shape[1]), -1.0)
    elastic = WarmModel(np.vstack([np.column_stack([matrix, -np.ones(len(level))]), last]))
    elastic.pose(last, level)
    elastic.add(np.arange(len(level) + 1), np.append(level, 0.0))
    u, _ = elastic.solve()
    assert u is not None, "s is bounded from below"
    return float(u[-1])


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
