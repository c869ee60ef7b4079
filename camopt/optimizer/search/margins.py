"""Margins of the no-jump program moved by Adam along gradients of the metrics, before the free steps of `gradient`.

Every iterate is the optimum of a linear program, so all limits on the cam's shape hold exactly. The area's slope by the
margins is the program's dual; a metric's slope is its gradient by z times the program's own slope dz / d margins
at its active rows. Shares of limits enter by a barrier, so that gradients are only taken where contacts barely part; a
cam that the judge refuses sends the search back to the best one with half the step.
"""

import numpy as np

from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.no_jump import NoCamHoldsContact, NoJumpOptimum, NoJumpProgram
from camopt.optimizer.search.judge import USABLE_SHARE
from camopt.optimizer.search.no_jump_stage import RESOLUTION, Search
from camopt.optimizer.search.sensitivity import Sensitivity

FIRST_STEP_N = 4.0
"""Adam's first step on a margin: a fifth of the first step of the common margin."""
BARRIER = 2e-5
"""Area ratio that one e-fold of the room left under a limit is worth: a tenth of what the stage may gain."""
TINY = 1e-8
"""Adam's guard against a slope of zero."""
USED = 0.3
"""Share of a limit from which its slope is taken."""


class Adam:
    """Steps against a slope, each coordinate by its own running mean and size (Kingma and Ba, arXiv 1412.6980)."""

    def __init__(self, rate: float, mean: float = 0.5, size: float = 0.9):
        self.rate, self.mean, self.size = rate, mean, size
        self._count, self._mean, self._size = 0, 0.0, 0.0

    def __call__(self, slope: np.ndarray) -> np.ndarray:
        """The step at a slope, in the unit of `rate`."""
        self._count += 1
        self._mean = self.mean * self._mean + (1 - self.mean) * slope
        self._size = self.size * self._size + (1 - self.size) * slope**2
        mean, size = self._mean / (1 - self.mean**self._count), self._size / (1 - self.size**self._count)
        return -self.rate * mean / (np.sqrt(size) + TINY)


def margin_stage(search: Search, program: NoJumpProgram, sensitivity: Sensitivity, steps: int) -> str:
    """Improve `search.best` by at most `steps` steps of Adam on the margins (3 kinds by speeds) of `program`.

    Returns why it ended. It stops once the steps left would gain less than RESOLUTION together, to first order.
    """
    assert search.best is not None and search.best_judged is not None, "the no-jump stage comes first"
    best, scale = search.best, 1.0
    margins, adam = best.margins, Adam(FIRST_STEP_N)
    slope = loss_slope(best, search, sensitivity)
    for taken in range(steps):
        update = scale * adam(slope)
        promised = (steps - taken) * max(0.0, -float(np.sum(slope * update)))
        if promised < RESOLUTION:
            return f"after {taken} of {steps} steps on the margins, where the steps left promised {promised:.2g}"
        moved = margins + update
        try:
            found = program.solve(Margins(*moved))
        except NoCamHoldsContact:
            scale *= 0.5
            continue
        search.consider("margins by gradient", found, briefly=True)
        if search.best is best:
            scale *= 0.5
            continue
        best, margins = found, moved
        slope = loss_slope(best, search, sensitivity)
    return f"after all {steps} steps on the margins"


def loss_slope(best: NoJumpOptimum, search: Search, sensitivity: Sensitivity) -> np.ndarray:
    """d (barrier - area ratio) / d margins [1/N] at the best cam, shape (3, speeds)."""
    judged = search.best_judged
    assert judged is not None
    largest = judged.share.max(axis=0)
    rows = np.argsort(-largest)[: sensitivity.width]
    rows = rows[largest[rows] > USED]
    if len(rows) == 0:
        return -best.margin_prices
    _, gradients = sensitivity(best.z, judged, rows)  # (r, l, m)
    room = np.maximum(USABLE_SHARE - judged.share[:, rows].T, 0.01)
    weight = np.where(judged.share[:, rows].T > USED, BARRIER / room, 0.0) * judged.share_slopes
    by_z = np.einsum("rl,rlm->m", weight, np.nan_to_num(gradients))
    return np.einsum("m,mks->ks", by_z, best.jacobian()) - best.margin_prices
