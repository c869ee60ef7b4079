"""HiGHS, as the whole package asks it: a program is tried in other ways until one of them decides it.

Huangfu and Hall, Parallelizing the dual revised simplex method, Mathematical Programming Computation 10 (2018).
"""

from collections.abc import Callable, Sequence
from contextvars import ContextVar
from threading import local
from typing import Any, NamedTuple

import highspy
import numpy as np
from highspy import HighsModelStatus, HighsStatus
from scipy.sparse import csr_array, issparse

FEASIBILITY = 1e-10
"""Largest violation of a row: the least tolerance that HiGHS takes."""
SMALLEST = 1e-12
"""Entries of rows that are left out: the least size that HiGHS takes."""
FARTHEST = 1e6
"""Half the side of the box in which a column without bounds is looked for. The dual simplex method needs a point whose
prices are right to begin with, which a column has at one end of its box and a column that is free in sign has not: with
free columns HiGHS may end without an answer (`experiments/linear_programs.py` counts how often)."""
OPTIONS = {
    "output_flag": False,
    "presolve": "off",  # it would throw a basis away, and on a few columns it takes longer than the solution
    "parallel": "off",  # `threads` stays alone: HiGHS wants one number of them in the whole process
    "primal_feasibility_tolerance": FEASIBILITY,
    "dual_feasibility_tolerance": 1e-9,
    "small_matrix_value": SMALLEST,
    "simplex_iteration_limit": 5000,  # ordinary programs take hundreds; near a contradiction it may go round
}
WAY = {"solver": "simplex", "random_seed": 0, "simplex_scale_strategy": 2}
ATTEMPTS = ({}, {}, {"random_seed": 1}, {"simplex_scale_strategy": 0}, {"solver": "ipx"})
"""Changes of WAY in turn, until one decides: from the basis, without it, perturbed in another way as HiGHS' authors
advise (ERGO-Code/HiGHS issue 1607), with rows and columns as they are given, by interior points."""
LARGE = {
    "presolve": "on",
    "primal_feasibility_tolerance": 1e-7,
    "dual_feasibility_tolerance": 1e-7,
    "simplex_iteration_limit": 100_000,
}
"""Other options of large sparse programs. Their tolerances are HiGHS' own, as on thousands of equations in a row
rounding leaves none of FEASIBILITY; what is made of their answer is a bound for any multipliers."""
INTERIOR = ({"solver": "ipx"}, {}, {"simplex_scale_strategy": 0})
"""ATTEMPTS at such a program, on which the simplex method takes long."""

WATCH: ContextVar[Callable[[], None]] = ContextVar("WATCH", default=lambda: None)
"""Called before every run of the solver; what it raises ends a program for which nobody waits any more."""


class Unbounded(ArithmeticError):
    """Points of any value satisfy the rows."""


class Infeasible(Exception):
    """No point satisfies the rows; not a user's error by itself, the caller knows which limits the rows came from."""


class Solver:
    """A HiGHS model with the options of the package; `highs` is it."""

    def __init__(self, **options: Any):
        self.highs, self.pivots = highspy.Highs(), 0  # of the simplex method, so far
        for name, value in (OPTIONS | options).items():
            succeeds(self.highs.setOptionValue(name, value))

    def decide(self, attempts: Sequence[dict] = ATTEMPTS) -> highspy.HighsSolution:
        """The optimum of the model. Raises Infeasible, Unbounded, and ArithmeticError where no attempt decides."""
        for attempt in attempts:
            for name, value in (WAY | attempt).items():
                succeeds(self.highs.setOptionValue(name, value))
            WATCH.get()()
            self.highs.run()
            self.pivots += max(self.highs.getInfo().simplex_iteration_count, 0)
            status = self.highs.getModelStatus()
            if status == HighsModelStatus.kOptimal:
                return self.highs.getSolution()
            if status == HighsModelStatus.kInfeasible:
                raise Infeasible(f"{self.highs.getNumRow()} rows have no point in common")
            if status == HighsModelStatus.kUnbounded:
                raise Unbounded("the linear program is unbounded")
            succeeds(self.highs.clearSolver())
        says = self.highs.modelStatusToString(status)
        raise ArithmeticError(f"the linear program of {self.highs.getNumRow()} rows was not solved: {says}")


def succeeds(status: HighsStatus) -> None:
    """HiGHS takes what it is given: warnings and errors are mistakes in the caller."""
    if status != HighsStatus.kOk:
        raise RuntimeError(f"HiGHS refused a call: {status}")


class Minimum(NamedTuple):
    """Minimiser x (m) of a linear program, its value, and the derivatives of the value by the bounds of rows and x."""

    x: np.ndarray
    value: float
    row_duals: np.ndarray  # (r)
    column_duals: np.ndarray  # (m), positive at a lower bound, negative at an upper one


_SOLVERS = local()
"""The solvers of every thread: making one takes as long as solving a small program with it."""


def entries_of(rows: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where in the others each of dense or sparse rows (r, m) starts (r + 1), and the columns and values of its entries
    that HiGHS takes."""
    if issparse(rows):
        matrix = csr_array(rows, copy=True)
        matrix.data = np.where(np.abs(matrix.data) > SMALLEST, matrix.data, 0.0)
        matrix.eliminate_zeros()
        return matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32), matrix.data
    kept = np.abs(rows) > SMALLEST
    row, column = np.nonzero(kept)
    return np.searchsorted(row, np.arange(len(rows) + 1)).astype(np.int32), column.astype(np.int32), rows[kept]


def minimise(cost: np.ndarray, rows: Any, low: Any, high: Any, bounds: np.ndarray, *, large: bool = False) -> Minimum:
    """The x (m) of least cost (m) @ x under low (r) <= rows (r, m) @ x <= high (r), x within `bounds` (m, 2).

    `rows` are dense or sparse; a low or high that is one number holds for all rows. With `large` presolve and interior
    points come first. Raises Infeasible, Unbounded, and ArithmeticError where the solver gives up.
    """
    name, entries = "large" if large else "plain", entries_of(rows)
    solver = vars(_SOLVERS).get(name) or vars(_SOLVERS).setdefault(name, Solver(**(LARGE if large else {})))
    model = highspy.HighsLp()
    model.num_row_, model.num_col_ = rows.shape[0], len(cost)
    model.col_cost_, model.col_lower_, model.col_upper_ = cost, *np.transpose(bounds)
    model.row_lower_, model.row_upper_ = (np.broadcast_to(side, model.num_row_) for side in (low, high))
    model.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    model.a_matrix_.start_, model.a_matrix_.index_, model.a_matrix_.value_ = entries
    succeeds(solver.highs.passModel(model))  # which forgets what was solved before
    found = solver.decide(INTERIOR if large else ATTEMPTS)
    x = np.array(found.col_value)
    return Minimum(x, float(np.dot(cost, x)), np.array(found.row_dual), np.array(found.col_dual))
