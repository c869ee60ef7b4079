"""A fit that finds its way: the beginning of the motion first, then more of it, and from several starts.

Where a valve bounces, the sum of squares has many minima: a parameter a tenth off moves the hops by more than their
length. Up to its closing the motion is smooth in every parameter, and what is fitted there is near enough for the next
part: a homotopy in the data (Voss, Timmer and Kurths 2004, Int. J. Bifurcation Chaos 14, on fits by initial values).
"""

import numpy as np

from camopt.scene.errors import InputError, MotionRefused
from camopt.study.identify.lift_fit import Fitted, LiftFit, descend

SHARES = np.arange(3, 12) / 12
"""Shares of the samples that are fitted one after another before all are."""
STAGE_STEPS = 12
"""Steps within one of these, which need not come to a stand."""
CERTAIN = 20.0
"""In these a direction moves only where it is known to a twentieth: less would lead away from a better start."""
BOX = 0.2
"""Half-width of the box around the start values, in the logarithms, from which other starts are drawn."""
FEWEST_STARTS, MOST_STARTS = 2, 4
"""Starts that are compared, and that are tried while no fit is as good as the noise allows."""


def homotopy(fit: LiftFit, logs: np.ndarray) -> Fitted:
    """The fit of all samples, led there over growing shares of them. Raises MotionRefused or InputError where there is
    no motion at the start."""
    steps = 0
    for share in SHARES:
        part = fit.until(share)
        if sum(len(s.angle) for s in part.series) > 2 * len(logs):
            found = descend(part, logs, STAGE_STEPS, CERTAIN)
            logs, steps = found.logs, steps + found.steps
    found = descend(fit, logs)
    return Fitted(found.logs, found.residual, found.motions, steps + found.steps, found.converged)


def fits_from_starts(fit: LiftFit, good_enough: float) -> list[Fitted]:
    """Fits from the start values and from drawn ones, the best first, until two of them have been compared and the best
    stands with squares [m^2] of at most `good_enough`, or all starts are used up.

    From each start all samples are fitted at once, which is the cheaper way where there is one minimum, and by the
    homotopy where that is not good enough. Raises MotionRefused or InputError where the start values have no motion.
    """
    random, count = np.random.default_rng(0), len(fit.parameters.tied)
    found: list[Fitted] = []

    def good() -> bool:
        return bool(found) and found[0].converged and found[0].squares <= good_enough

    def keep(one: Fitted) -> None:
        found.append(one)
        found.sort(key=lambda f: f.squares)

    for tried in range(MOST_STARTS):
        logs = random.uniform(-BOX, BOX, count) if tried else np.zeros(count)
        try:
            keep(descend(fit, logs))
            if not good():
                keep(homotopy(fit, logs))
        except (MotionRefused, InputError):  # a drawn start without a motion is none
            if not tried:
                raise
        if tried + 1 >= FEWEST_STARTS and good():
            break
    return found
