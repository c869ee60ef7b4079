"""A step of sequential linear programming (Griffith and Stewart 1961) for a yield.

The area and all limits on the shape are linear in the free cam's coefficients z. What a drawn train uses of a limit is
not, but it has an exact slope by z. The step is the linear program that takes these slopes for the truth within a
reach: the largest area whose expected shortfall stays within a budget. Other than the margins of a no-jump program, of
which every cam suits the train as designed, it moves each coefficient for itself.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from camopt.optimizer.program.kinematic import TYPICAL, area_ratio_row, reached_in_the_middle
from camopt.optimizer.program.no_jump import NoJumpProgram

EXCESS = 10.0
"""Area ratio that a unit of shortfall beyond the budget costs: more than any cam gains by it."""


@dataclass(frozen=True)
class YieldCam:
    """A free cam of a search for yield: its coefficients z (m) and its area ratio."""

    program: NoJumpProgram
    z: np.ndarray
    area_ratio: float

    @property
    def lift(self):
        """The cam's lift law."""
        return self.program.cam.lift(self.z)

    def moved(self, z: np.ndarray) -> "YieldCam":
        """The cam with other coefficients."""
        row, constant = area_ratio_row(self.program.design, self.program.cam)
        return YieldCam(self.program, z, float(row @ z + constant))

    def moved_towards(self, other: "YieldCam", share: float) -> "YieldCam":
        """The cam between this one and another one: at share zero this one, at one the other."""
        return self.moved((1.0 - share) * self.z + share * other.z)


@dataclass(frozen=True)
class UsedSlopes:
    """What trains use of a limit at a speed by its value and slope at some cam: `level` (r) + `slope` (r, m) @ z.

    `train` (r) is the number of each row's train; one may have several rows.
    """

    train: np.ndarray
    level: np.ndarray
    slope: np.ndarray

    def joined(self, other: "UsedSlopes") -> "UsedSlopes":
        """These rows and those found at another cam."""
        pairs = (self.train, other.train), (self.level, other.level), (self.slope, other.slope)
        return UsedSlopes(*[np.concatenate(pair) for pair in pairs])


def stepped(cam: YieldCam, found: UsedSlopes, aim: float, budget: float, reach: float) -> YieldCam:
    """The cam of largest area within `reach` of `cam`, in typical coefficients, by these slopes.

    Each train falls short by what the largest of its rows exceeds `aim` by; `budget` is for the sum over trains. It is
    exceeded only where no cam within reach keeps it.
    """
    program, z = cam.program, cam.z
    limits, size = program.limits, len(z)
    trains, short = np.unique(found.train, return_inverse=True)
    rows, bound = reached_in_the_middle(program.cam, program.design, limits.matrix, limits.bound)
    rows = rows * TYPICAL
    norm = np.maximum(np.abs(rows).max(axis=1), np.finfo(float).tiny)
    more = len(trains) + 1  # each train's shortfall, and what their sum exceeds the budget by
    used = np.hstack([found.slope * TYPICAL, np.zeros((len(short), more))])
    used[np.arange(len(short)), size + short] = -1.0
    total = np.concatenate([np.zeros(size), np.ones(len(trains)), [-1.0]])
    shape = np.hstack([rows / norm[:, None], np.zeros((len(rows), more))])
    area, _ = area_ratio_row(program.design, program.cam)
    answer = linprog(
        np.concatenate([-area * TYPICAL, np.zeros(len(trains)), [EXCESS]]),
        A_ub=np.vstack([shape, used, total]),
        b_ub=np.concatenate([bound / norm, aim - found.level, [budget]]),
        bounds=[*((v - reach, v + reach) for v in z / TYPICAL), *[(0.0, None)] * more],
        method="highs",
    )
    return cam if answer.x is None else cam.moved(answer.x[:size] * TYPICAL)
