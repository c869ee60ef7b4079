"""A step of sequential linear programming (Griffith and Stewart 1961) for a yield, on margins of the no-jump program.

What a drawn train uses of a limit has an exact slope by the cam's coefficients, and these have one by the margins. The
step is the linear program that takes both for the truth within a reach: the margins with which the trains fall least
short and no area is lost. Every cam is the optimum of the no-jump program, so that all limits on its shape hold. There
are fewer margins than coefficients: steps on these suit the trains that a search knows better still than others.
"""

from dataclasses import dataclass

import numpy as np

from camopt.highs import minimise
from camopt.optimizer.program.no_jump import NoJumpOptimum


@dataclass(frozen=True)
class UsedSlopes:
    """What trains use of a limit at a speed by its value and slope at some cam: `level` (r) + `slope` (r, m) @ z.

    `train` (r) is the number of each row's train; one may have several rows.
    """

    train: np.ndarray
    level: np.ndarray
    slope: np.ndarray


def stepped(cam: NoJumpOptimum, found: UsedSlopes, aim: float, reach_N: float) -> np.ndarray:
    """The margins (3, s) [N] of least shortfall within `reach_N` of the cam's own ones, by the slopes `found` there.

    Each train falls short by what the largest of its rows exceeds `aim` by. By the prices of the margins the area is
    at least the cam's.
    """
    by_margin = cam.jacobian().reshape(len(cam.z), -1)
    trains, short = np.unique(found.train, return_inverse=True)
    size = by_margin.shape[1]
    used = np.hstack([found.slope @ by_margin, np.zeros((len(short), len(trains)))])
    used[np.arange(len(short)), size + short] = -1.0
    lost = np.concatenate([-cam.margin_prices.ravel(), np.zeros(len(trains))])
    step = minimise(
        np.concatenate([np.zeros(size), np.ones(len(trains))]),
        np.vstack([used, lost]),
        -np.inf,
        np.append(aim - found.level - found.slope @ cam.z, 0.0),
        np.array([(-reach_N, reach_N)] * size + [(0.0, np.inf)] * len(trains)),
    )
    return cam.margins + step.x[:size].reshape(cam.margins.shape)
