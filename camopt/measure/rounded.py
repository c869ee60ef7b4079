"""Limits on the shape of a cam that a rounded table gives: broken where no cam within the rounding keeps them.

A row with an error of up to q may stand for any lift within q of it, and derivatives of the law through the rows carry
q / step^k. Differences over wider steps do not: the k-th difference of a lift over steps H, by H^k, is a mean of its
k-th derivative over k H (de Boor, A Practical Guide to Splines, 1978, ch. 1), so that it keeps what the derivative
keeps, and it is wrong by at most 2^k q / H^k. Nor has it more changes of sign (Schoenberg's variation diminution).
"""

from collections.abc import Iterator
from math import comb

import numpy as np

from camopt.cam.lift import Lift
from camopt.cam.linear_limits import linear_limits
from camopt.cam.tables.interpolation import centred, spline_pieces
from camopt.scene.design import RADII, REACH, Design
from camopt.scene.quantities import is_number
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG2, MM_PER_DEG3, MM_PER_DEG4

WIDEST = 2.0 * DEG
"""Widest step of a difference [rad]: its mean then spans a few degrees, and the rounding of 5 decimals is none."""
ORDERS = {
    "acceleration_max_mm_per_deg2": (2, MM_PER_DEG2, False, False),
    "acceleration_min_mm_per_deg2": (2, MM_PER_DEG2, False, False),
    "jerk_max_mm_per_deg3": (3, MM_PER_DEG3, True, False),
    "snap_max_mm_per_deg4": (4, MM_PER_DEG4, True, True),
}
"""By key: order, unit, whether both signs are limited, whether between the ramps alone."""
RAMP_VELOCITY = 0.01
"""Relative excess over the ramp's velocity that counts as none: a micrometre over the ten degrees of a ramp."""
EVALUATED = 1e-12
"""Error of a lift's evaluation, over the largest."""


class RoundedRows:
    """The rows of a table, as the law's own values at equal steps, each within `error` [m] of the cam's lift."""

    def __init__(self, lift: Lift, error: float, step: float):
        self.lift, self.step = lift, step
        self.error = error + EVALUATED * lift.max_lift
        count = round(2 * np.pi / step)
        self.theta = np.linspace(-np.pi, np.pi, count + 1)[:-1]
        self.height = lift(self.theta)

    def means(self, order: int) -> Iterator[tuple[float, np.ndarray, float]]:
        """The angle that a mean spans [rad], the means from each row on, and their largest error, for steps that double
        up to `WIDEST`."""
        every = 1
        while every * self.step <= WIDEST * (1 + 1e-9):
            yield order * every * self.step, *self.mean(order, every)
            every *= 2

    def mean(self, order: int, every: int) -> tuple[np.ndarray, float]:
        """The mean of a derivative over `order` steps of `every` rows from each row on, and its largest error."""
        width = every * self.step
        terms = [(-1) ** (order - j) * comb(order, j) * np.roll(self.height, -j * every) for j in range(order + 1)]
        return np.sum(terms, axis=0) / width**order, 2**order * self.error / width**order

    def resolution(self, order: int) -> float:
        """The least error of the means of a derivative [m/rad^order]."""
        return min(error for *_, error in self.means(order))

    def exceeds(self, order: int, level: float, low: float = -np.pi, high: float = np.pi) -> bool:
        """Whether a derivative surely exceeds a level between two angles [rad]; for a negative one, is below it."""
        sign = -1.0 if level < 0 else 1.0
        for span, mean, error in self.means(order):
            inside = (self.theta >= low - 1e-12) & (self.theta + span <= high + 1e-12)
            if np.any(sign * mean[inside] > abs(level) + error):
                return True
        return False

    def told(self, how: str, acceleration: float, jerk: float) -> str:
        """A sentence on how exactly means tell the derivatives [m/rad^2, m/rad^3], which are taken so."""
        return (
            f"The table's rows are off by up to {self.error / MM:.1g} mm: {how}, which tell the acceleration to "
            f"{acceleration / MM_PER_DEG2:.1g} mm/deg^2 and the jerk to {jerk / MM_PER_DEG3:.1g} mm/deg^3"
        )

    def waves(self, half: float) -> int:
        """Sign changes of the jerk that the cam has at least, between -half and half [rad]."""
        most = 0
        for span, mean, error in self.means(3):
            inside = (self.theta >= -half) & (self.theta + span <= half) & (np.abs(mean) > error)
            most = max(most, int(np.count_nonzero(np.diff(np.sign(mean[inside])))))
        return most


def rows_of(lift: Lift) -> RoundedRows | None:
    """The rows of a cam whose parameters say that a table gives it with a row error; None for others."""
    error, step = lift.parameters.get("row_error_mm"), lift.parameters.get("step_deg")
    if lift.family != "table" or not is_number(error) or not is_number(step) or step <= 0:
        return None
    return RoundedRows(lift, error * MM, step * DEG)


def violated_beyond_rounding(broken: list[str], rows: RoundedRows, design: Design) -> list[str]:
    """Of the limits that the law through the rows breaks, those that no cam within the rows' error keeps."""
    half = design.duration_deg / 2 * DEG
    drawn = {limit.key for limit in linear_limits(design)} | set(RADII)
    drawn -= {"duration_at"}
    return [
        key
        for key in broken
        if (_drawing_broken(rows, design, key) if key in drawn else _broken(rows, design, key, half))
    ]


def _broken(rows: RoundedRows, design: Design, key: str, half: float) -> bool:
    """Whether one limit is surely broken; true for those that the rounding of a table does not touch."""
    value = getattr(design, key, None)
    if key in ORDERS and value is not None:
        order, unit, both, within = ORDERS[key]
        levels = (value * unit, -value * unit) if both else (value * unit,)
        ends = (-half, half) if within else (-np.pi, np.pi)
        return any(rows.exceeds(order, level, *ends) for level in levels)
    if key == "max_lift_mm":
        return rows.lift.max_lift > design.max_lift_mm * MM + rows.error
    if key == "reach_max_lift":
        return rows.lift.max_lift < design.max_lift_mm * MM * (1 - REACH) - 2 * rows.error
    if key == "nose_deg":
        return rows.exceeds(2, 0.0, -(design.nose_deg or 0.0) * DEG, (design.nose_deg or 0.0) * DEG)
    if key == "waves_max":
        return rows.waves(half) > (design.waves_max or 0)
    if key.endswith("ramp_velocity_mm_per_deg"):
        sides = [(np.array([-np.pi, -half]), design.ramps()[0][1]), (np.array([half, np.pi]), design.ramps()[1][1])]
        return any(
            rows.exceeds(1, sign * velocity * (1 + RAMP_VELOCITY) * MM_PER_DEG, *ends)
            for ends, velocity in sides
            for sign in (-1, 1)
        )
    return True


def _drawing_broken(rows: RoundedRows, design: Design, key: str) -> bool:
    """Whether a limit that is linear in the lift is surely broken: the mean of its sum is more than the level."""
    *_, (_, bends, _) = rows.means(2)
    bend = 2 * float(np.abs(bends).max())  # the largest acceleration may be more than the means
    for limit in linear_limits(design):
        order, lifts = len(limit.weights) - 1, limit.weights[0]
        if limit.key != key or limit.chosen:
            continue
        if order == 0 and limit.excess(rows.lift) > rows.error * abs(lifts):
            return True
        most = float(limit.level.coefficients[:, 0].max()) + limit.level.error
        for span, mean, error in rows.means(order) if order else ():
            inside = (rows.theta >= limit.level.low) & (rows.theta + span <= limit.level.high)
            middle = rows.theta[inside] + span / 2  # of a mean whose variance is span^2 / (12 order)
            slack = abs(limit.weights[order]) * error + abs(lifts) * (rows.error + bend * span**2 / (24 * order))
            if np.any(limit.weights[order] * mean[inside] + lifts * rows.lift(middle) > most + slack):
                return True
    return False


def rounding_sentence(lift: Lift) -> str:
    """How exactly a table tells its derivatives, empty for a cam that is no rounded table."""
    rows = rows_of(lift)
    if rows is None:
        return ""
    how = "the limits on the shape are judged by means over a few degrees"
    return f"{rows.told(how, *map(rows.resolution, (2, 3)))}; what a table does between its rows, no table tells"


MEANS = 4
"""Times that the mean is taken: once for every derivative that a scene limits."""
TOLD = 0.05
"""Largest share of the largest jerk that the rows' error may make up in the average."""


def moving_average(lift: Lift) -> tuple[Lift, str]:
    """The moving average of a cam, and a sentence on how exact its derivatives are.

    The mean of the lift over a window, taken four times, has for its k-th derivative, k up to 4, means of the cam's
    own, so that it keeps whatever limit the cam keeps. An error q of the rows shows in them as 2^k q / H^k at most,
    with the window's width H; the lift itself differs from the cam's by H^2 / 6 times its acceleration. The cam itself
    and an empty sentence where no table gives it, or one whose rows are exact enough without averages.
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
    how = f"acceleration, jerk, waves and contact are given by means over {MEANS * width / DEG:.2g} deg"
    return law, rows.told(how, rows.mean(2, window)[1], rows.mean(3, window)[1])


def _window(rows: RoundedRows) -> int:
    """The least odd number of rows over which the jerk of the average is accurate enough, up to `WIDEST`."""
    window = 1
    for window in range(1, int(WIDEST / rows.step) + 1, 2):
        jerk, error = rows.mean(3, window)
        if error <= TOLD * np.abs(jerk).max():
            break
    return window
