"""Limits on the shape of a cam given by a rounded table; a limit is broken if no cam within the rounding keeps it.

A row with an error of up to q represents any lift within q of it, and the k-th derivative of the law through the rows
has errors of the order q / step^k. Differences over wider steps have smaller ones: the k-th difference of a lift over
steps H, divided by H^k, is a mean of its k-th derivative over k H (de Boor, A Practical Guide to Splines, 1978, ch. 1).
It therefore keeps every limit that the derivative keeps, and its error is at most 2^k q / H^k. It has no more sign
changes than the derivative either (Schoenberg's variation diminution).
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
"""Widest step of a difference [rad]: the mean then spans a few degrees, and rounding to 5 decimals is negligible."""
ORDERS = {
    "acceleration_max_mm_per_deg2": (2, MM_PER_DEG2, False, False),
    "acceleration_min_mm_per_deg2": (2, MM_PER_DEG2, False, False),
    "jerk_max_mm_per_deg3": (3, MM_PER_DEG3, True, False),
    "snap_max_mm_per_deg4": (4, MM_PER_DEG4, True, True),
}
"""By key: order, unit, whether both signs are limited, and whether the limit applies only between the ramps."""
RAMP_VELOCITY = 0.01
"""Allowed relative excess over the ramp's velocity: a micrometre over the ten degrees of a ramp."""
EVALUATED = 1e-12
"""Error of a lift's evaluation, relative to the largest lift."""


class RoundedRows:
    """The rows of a table, as values of the lift law at equal steps; each is within `error` [m] of the cam's lift."""

    def __init__(self, lift: Lift, error: float, step: float):
        self.lift, self.step = lift, step
        self.error = error + EVALUATED * lift.max_lift
        count = round(2 * np.pi / step)
        self.theta = np.linspace(-np.pi, np.pi, count + 1)[:-1]
        self.height = lift(self.theta)

    def means(self, order: int) -> Iterator[tuple[float, np.ndarray, float]]:
        """For steps that double to WIDEST: span of a mean [rad], the mean from each row on, and its largest error."""
        stride = 1
        while stride * self.step <= WIDEST * (1 + 1e-9):
            yield order * stride * self.step, *self.mean(order, stride)
            stride *= 2

    def mean(self, order: int, stride: int) -> tuple[np.ndarray, float]:
        """The mean of a derivative over `order` steps of `stride` rows, starting at each row, and its largest error."""
        width = stride * self.step
        terms = [(-1) ** (order - j) * comb(order, j) * np.roll(self.height, -j * stride) for j in range(order + 1)]
        return np.sum(terms, axis=0) / width**order, 2**order * self.error / width**order

    def resolution(self, order: int) -> float:
        """The smallest error of the means of a derivative [m/rad^order]."""
        return min(error for *_, error in self.means(order))

    def exceeds(self, order: int, level: float, low: float = -np.pi, high: float = np.pi) -> bool:
        """Whether a derivative certainly exceeds a level, or is below a negative one, between two angles [rad]."""
        sign = -1.0 if level < 0 else 1.0
        for span, mean, error in self.means(order):
            inside = (self.theta >= low - 1e-12) & (self.theta + span <= high + 1e-12)
            if np.any(sign * mean[inside] > abs(level) + error):
                return True
        return False

    def precision(self, how: str, acceleration: float, jerk: float) -> str:
        """A sentence with the errors of acceleration [m/rad^2] and jerk [m/rad^3] as means, used as stated in `how`."""
        return (
            f"The table's rows are off by up to {self.error / MM:.1g} mm: {how}, which tell the acceleration to "
            f"{acceleration / MM_PER_DEG2:.1g} mm/deg^2 and the jerk to {jerk / MM_PER_DEG3:.1g} mm/deg^3"
        )

    def waves(self, half: float) -> int:
        """Lower bound of the number of sign changes of the cam's jerk between -half and half [rad]."""
        most = 0
        for span, mean, error in self.means(3):
            inside = (self.theta >= -half) & (self.theta + span <= half) & (np.abs(mean) > error)
            most = max(most, int(np.count_nonzero(np.diff(np.sign(mean[inside])))))
        return most


def rows_of(lift: Lift) -> RoundedRows | None:
    """The rows of a cam whose parameters state a lift table with a row error; None for other cams."""
    error, step = lift.parameters.get("row_error_mm"), lift.parameters.get("step_deg")
    if lift.family != "table" or not is_number(error) or not is_number(step) or step <= 0:
        return None
    return RoundedRows(lift, error * MM, step * DEG)


def violated_beyond_rounding(broken: list[str], rows: RoundedRows, design: Design) -> list[str]:
    """Those of the `broken` limits, which the law through the rows breaks, that no cam within the rows' error keeps."""
    half = design.duration_deg / 2 * DEG
    drawn = {limit.key for limit in linear_limits(design)} | set(RADII)
    drawn -= {"duration_at"}
    return [
        key
        for key in broken
        if (_linear_limit_violated(rows, design, key) if key in drawn else _violated(rows, design, key, half))
    ]


def _violated(rows: RoundedRows, design: Design, key: str, half: float) -> bool:
    """Whether a limit is certainly broken; true for limits that the rounding of a table does not affect."""
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


def _linear_limit_violated(rows: RoundedRows, design: Design, key: str) -> bool:
    """Whether a limit linear in the lift is certainly broken: the mean of its weighted sum exceeds the level."""
    *_, (_, bends, _) = rows.means(2)
    bend = 2 * float(np.abs(bends).max())  # a factor of 2, since the largest acceleration may exceed the means
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
    """A sentence on how exactly a table determines its derivatives; empty for a cam that is not a rounded table."""
    rows = rows_of(lift)
    if rows is None:
        return ""
    how = "the limits on the shape are judged by means over a few degrees"
    return f"{rows.precision(how, *map(rows.resolution, (2, 3)))}; the lift between its rows is unknown"


MEANS = 4
"""Number of times that the moving average is applied: once for every derivative that a scene can limit."""
LARGEST_JERK_ERROR = 0.05
"""Largest error of the averaged jerk caused by the rows' error, relative to the largest jerk."""


def moving_average(lift: Lift) -> tuple[Lift, str]:
    """The moving average of a cam, and a sentence on how exact its derivatives are.

    If the mean of the lift over a window is taken four times, the k-th derivative of the result, k up to 4, is a mean
    of the cam's own, so that it keeps every limit that the cam keeps. An error q of the rows changes it by at most
    2^k q / H^k, where H is the width of the window; the lift itself changes by H^2 / 6 times its acceleration. A cam
    that is not a lift table, or whose rows are exact enough, is returned itself with an empty sentence.
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
    return law, rows.precision(how, rows.mean(2, window)[1], rows.mean(3, window)[1])


def _window(rows: RoundedRows) -> int:
    """The smallest odd number of rows, up to `WIDEST`, over which the averaged jerk is accurate enough."""
    window = 1
    for window in range(1, int(WIDEST / rows.step) + 1, 2):
        jerk, error = rows.mean(3, window)
        if error <= LARGEST_JERK_ERROR * np.abs(jerk).max():
            break
    return window
