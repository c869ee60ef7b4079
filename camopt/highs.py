"""Linear programs by HiGHS: the solver is run with other settings until one run decides a program.

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
"""Largest violation of a row: the smallest tolerance that HiGHS accepts."""
SMALLEST = 1e-12
"""Magnitude below which an entry of a row is dropped: the smallest value that HiGHS accepts."""
FARTHEST = 1e6
"""Half the side of the box that replaces missing bounds of a column. The dual simplex method starts from a dual
feasible point. A column with bounds has one at an end of its box, and a free column has none: with free columns HiGHS
may end without an answer (`experiments/linear_programs.py` counts how often)."""
OPTIONS = {
    "output_flag": False,
    "presolve": "off",  # presolve discards the basis, and for few columns it takes longer than the solution
    "parallel": "off",  # `threads` is not set: HiGHS allows one number of threads per process
    "primal_feasibility_tolerance": FEASIBILITY,
    "dual_feasibility_tolerance": 1e-9,
    "small_matrix_value": SMALLEST,
    "simplex_iteration_limit": 5000,  # ordinary programs take hundreds; nearly infeasible ones may cycle
}
SIMPLEX = {"solver": "simplex", "random_seed": 0, "simplex_scale_strategy": 2}
ATTEMPTS = ({}, {}, {"random_seed": 1}, {"simplex_scale_strategy": 0}, {"solver": "ipx"})
"""Changes of SIMPLEX, tried in turn until a run decides: from the basis, without it, perturbed in another way as HiGHS'
authors advise (ERGO-Code/HiGHS issue 1607), with unscaled rows and columns, by interior points."""
LARGE = {
    "presolve": "on",
    "primal_feasibility_tolerance": 1e-7,
    "dual_feasibility_tolerance": 1e-7,
    "simplex_iteration_limit": 100_000,
}
"""Options that differ for large sparse programs. Their tolerances are HiGHS' defaults, because rounding in thousands of
coupled equations exceeds FEASIBILITY; the bound that is computed from the answer holds for any multipliers."""
LARGE_ATTEMPTS = ({"solver": "ipx"}, {}, {"simplex_scale_strategy": 0})
"""The ATTEMPTS for large programs, on which the simplex method is slow."""

WATCH: ContextVar[Callable[[], None]] = ContextVar("WATCH", default=lambda: None)
"""Callback before every run of the solver; an exception that it raises cancels a program whose result is obsolete."""


class Unbounded(ArithmeticError):
    """The rows admit points of arbitrarily low cost."""


class Infeasible(Exception):
    """No point satisfies the rows. It need not be a user's error: the caller knows which limits the rows came from."""


class Solver:
    """A HiGHS model, `highs`, with the options of the package."""

    def __init__(self, **options: Any):
        self.highs, self.pivots = highspy.Highs(), 0  # simplex iterations of all runs
        for name, value in (OPTIONS | options).items():
            succeeds(self.highs.setOptionValue(name, value))

    def decide(self, attempts: Sequence[dict] = ATTEMPTS) -> highspy.HighsSolution:
        """Solves the model. Raises Infeasible, Unbounded, or ArithmeticError where no attempt decides."""
        for attempt in attempts:
            for name, value in (SIMPLEX | attempt).items():
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
        outcome = self.highs.modelStatusToString(status)
        raise ArithmeticError(f"the linear program of {self.highs.getNumRow()} rows was not solved: {outcome}")


def succeeds(status: HighsStatus) -> None:
    """Raises RuntimeError unless HiGHS accepted a call: warnings and errors are mistakes of the caller."""
    if status != HighsStatus.kOk:
        raise RuntimeError(f"HiGHS refused a call: {status}")


class Minimum(NamedTuple):
    """Minimiser x (m) of a linear program, its value, and the multipliers of the bounds on the rows and on x."""

    x: np.ndarray
    value: float
    row_duals: np.ndarray  # (r)
    column_duals: np.ndarray  # (m), positive at a lower bound, negative at an upper one


_SOLVERS = local()
"""The solvers of each thread: creating one takes as long as solving a small program with it."""


def entries_of(rows: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Dense or sparse rows (r, m) in compressed form: the index (r + 1) at which each row starts, and the columns and
    values of the entries that HiGHS accepts."""
    if issparse(rows):
        matrix = csr_array(rows, copy=True)
        matrix.data = np.where(np.abs(matrix.data) > SMALLEST, matrix.data, 0.0)
        matrix.eliminate_zeros()
        return matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32), matrix.data
    large = np.abs(rows) > SMALLEST
    row, column = np.nonzero(large)
    return np.searchsorted(row, np.arange(len(rows) + 1)).astype(np.int32), column.astype(np.int32), rows[large]


def minimise(cost: np.ndarray, rows: Any, low: Any, high: Any, bounds: np.ndarray, *, large: bool = False) -> Minimum:
    """Minimises cost (m) @ x subject to low (r) <= rows (r, m) @ x <= high (r), with x within `bounds` (m, 2).

    `rows` are dense or sparse; a scalar `low` or `high` holds for all rows. With `large`, presolve and interior points
    come first. Raises Infeasible, Unbounded, or ArithmeticError where no attempt decides.
    """
    name, entries = "large" if large else "plain", entries_of(rows)
    solver = vars(_SOLVERS).get(name) or vars(_SOLVERS).setdefault(name, Solver(**(LARGE if large else {})))
    model = highspy.HighsLp()
    model.num_row_, model.num_col_ = rows.shape[0], len(cost)
    model.col_cost_, model.col_lower_, model.col_upper_ = cost, *np.transpose(bounds)
    model.row_lower_, model.row_upper_ = (np.broadcast_to(side, model.num_row_) for side in (low, high))
    model.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    model.a_matrix_.start_, model.a_matrix_.index_, model.a_matrix_.value_ = entries
    succeeds(solver.highs.passModel(model))  # this discards the previous model
    solution = solver.decide(LARGE_ATTEMPTS if large else ATTEMPTS)
    x = np.array(solution.col_value)
    return Minimum(x, float(np.dot(cost, x)), np.array(solution.row_dual), np.array(solution.col_dual))
