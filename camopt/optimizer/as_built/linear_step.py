"""A step of sequential linear programming (Griffith and Stewart 1961) for a yield, on margins of the no-jump program.

What a drawn train uses of a limit has an exact slope by the cam's coefficients, and these have one by the margins. The
step is the linear program that takes both for the truth within a reach: the margins of largest area whose expected
shortfall stays within a budget. Every cam is the optimum of the no-jump program, so that all limits on its shape hold.
There are fewer margins than coefficients: steps on these suit the trains that a search knows better still than others.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from camopt.optimizer.program.no_jump import NoJumpOptimum

EXCESS = 10.0
"""Area ratio that a unit of shortfall beyond the budget costs: more than any cam gains by it."""


@dataclass(frozen=True)
class UsedSlopes:
    """What trains use of a limit at a speed by its value and slope at some cam: `level` (r) + `slope` (r, m) @ z.

    `train` (r) is the number of each row's train; one may have several rows.
    """

    train: np.ndarray
    level: np.ndarray
    slope: np.ndarray


def stepped(cam: NoJumpOptimum, found: UsedSlopes, aim: float, budget: float, reach_N: float) -> np.ndarray:
    """The margins (3, s) [N] of largest area within `reach_N` of the cam's own ones, by the slopes `found` there.

    Each train falls short by what the largest of its rows exceeds `aim` by; `budget` is for the sum over trains. It is
    exceeded only where no margins within reach keep it.
    """
    by_margin = cam.jacobian().reshape(len(cam.z), -1)
    trains, short = np.unique(found.train, return_inverse=True)
    size, more = by_margin.shape[1], len(trains) + 1  # each train's shortfall, and what their sum exceeds the budget by
    used = np.hstack([found.slope @ by_margin, np.zeros((len(short), more))])
    used[np.arange(len(short)), size + short] = -1.0
    total = np.concatenate([np.zeros(size), np.ones(len(trains)), [-1.0]])
    answer = linprog(
        np.concatenate([-cam.margin_prices.ravel(), np.zeros(len(trains)), [EXCESS]]),
        A_ub=np.vstack([used, total]),
        b_ub=np.concatenate([aim - found.level - found.slope @ cam.z, [budget]]),
        bounds=[(-reach_N, reach_N)] * size + [(0.0, None)] * more,
        method="highs",
    )
    return cam.margins + answer.x[:size].reshape(cam.margins.shape)
