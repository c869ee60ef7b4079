"""Linear program with penalised constraint violation (elastic mode), which always has a solution."""

from dataclasses import dataclass

import numpy as np

from camopt.highs import Infeasible
from camopt.optimizer.program.kinematic import spline_rows
from camopt.optimizer.program.linear_program import Optimum, Rows, maximise

SHORT_OF_FORCE = 1e-2
"""Area ratio that a newton costs which margins are short of: more than any cam gains by it."""
TYPICAL_FORCE = 100.0
"""A force of usual size [N], for the solver's scaling."""


@dataclass(frozen=True)
class ElasticProgram:
    """A program that always has a solution: rows of the group `give` (r) may be broken by s >= 0, which costs area.

    The last entry of a point is s.
    """

    rows: Rows
    objective: np.ndarray
    working: np.ndarray

    @classmethod
    def of(
        cls, matrix: np.ndarray, give: np.ndarray, row: np.ndarray, cost: float, size: float, working
    ) -> "ElasticProgram":
        """Of rows (r, m), what each gives for s = 1, the area's row (m), what s costs and its typical size."""
        last = np.append(np.zeros(matrix.shape[1]), -1.0)
        column = np.append(spline_rows(matrix).column, size)
        rows = Rows(np.vstack([np.column_stack([matrix, -give]), last]), column)
        return cls(rows, np.append(row, -cost), np.append(working, len(matrix)))

    def solve(self, bound: np.ndarray) -> Optimum:
        """The point of largest value with these right sides (r); raises Infeasible where the other rows contradict
        each other."""
        return maximise(self.objective, self.rows, np.append(bound, 0.0), self.working)

    def value(self, bound: np.ndarray) -> float:
        """Area ratio, less what breaking rows costs; minus infinity where the other rows contradict each other."""
        try:
            return self.solve(bound).value
        except (Infeasible, ArithmeticError):  # of a pattern that the solver does not decide, too
            return -np.inf
