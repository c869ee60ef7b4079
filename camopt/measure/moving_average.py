"""The moving average of a cam that a rounded table gives, for its acceleration, jerk and curvature.

The mean of the lift over a window, taken four times, has for its k-th derivative, k up to 4, means of the cam's own,
so that it keeps whatever limit the cam keeps. An error q of the rows shows in them as 2^k q / H^k at most, with the
window's width H; the lift itself differs from the cam's by H^2 / 6 times its acceleration.
"""

import numpy as np

from camopt.cam.lift import Lift
from camopt.cam.tables.interpolation import centred, spline_pieces
from camopt.measure.rounded import WIDEST, RoundedRows, rows_of
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3

MEANS = 4
"""Times that the mean is taken: once for every derivative that a scene limits."""
TOLD = 0.05
"""Largest share of the largest jerk that the rows' error may make up in the average: the narrowest such window is
taken."""


def moving_average(lift: Lift) -> tuple[Lift, str]:
    """The moving average of a cam, and a sentence on how exact its derivatives are.

    The cam itself and an empty sentence where no table gives it, or one whose rows are exact enough without averages.
    """
    rows = rows_of(lift)
    window = 1 if rows is None else _window(rows)
    if rows is None or window == 1:
        return lift, ""
    mean = rows.height
    for _ in range(MEANS):
        mean = np.mean([np.roll(mean, k) for k in range(-(window // 2), window // 2 + 1)], axis=0)
    name = str(lift.parameters.get("file", "lift table"))
    pieces = spline_pieces(name, np.append(rows.theta, np.pi), np.append(mean, mean[0]))
    law = Lift(*centred(pieces, 0.0), lift.half_duration, lift.family, lift.parameters)
    width = window * rows.step
    acceleration, jerk = rows.mean(2, window)[1] / MM_PER_DEG2, rows.mean(3, window)[1] / MM_PER_DEG3
    return law, (
        f"The table's rows are off by up to {rows.error / MM:.1g} mm: acceleration, jerk, waves and contact are given "
        f"by means over {MEANS * width / DEG:.2g} deg, which tell the acceleration to {acceleration:.1g} mm/deg^2 and "
        f"the jerk to {jerk:.1g} mm/deg^3"
    )


def _window(rows: RoundedRows) -> int:
    """The least odd number of rows over which the jerk of the average is accurate enough, up to `WIDEST`."""
    window = 1
    for window in range(1, int(WIDEST / rows.step) + 1, 2):
        jerk, error = rows.mean(3, window)
        if error <= TOLD * np.abs(jerk).max():
            break
    return window
