"""By how much could the peak acceleration of the classical dwell-rise-dwell laws be lowered at their own peak jerk?

Each law rises by one in unit time. Its peak acceleration is compared with the least one that its own peak jerk allows,
from a linear program, and with a lower bound for every motion. The result also has the least peak jerk of a motion
through all numbers of Table 5.4 of Rothbart's Cam Design Handbook (2004), a rise, a fall and a dwell.
"""

from collections.abc import Sequence
from math import factorial, pi, radians

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import PPoly

from camopt.highs import minimise
from camopt.optimizer.bound.certificate import absolute_integral
from camopt.study.rise import DwellRise, least_acceleration, least_peak
from experiments.support.panels import DASHED, POINTS, Panel, panels
from experiments.support.record import RESULTS, run_script, write_result

INTERVALS = {"small": 500, "full": 4000}
SAMPLES = 200_001
"""Odd, so that the middle is among them."""
ORDERS = (2, 3, 4, 5)
TABLE_5_4 = (
    (45, 0, 1.02), (90, 0, 2.0), (90, 1, 0.0), (90, 2, 0.0), (135, 0, 1.81), (135, 2, -1.17), (150, 0, 1.61),
    (180, 0, 1.0), (180, 1, -1.2), (180, 2, 0.0), (210, 0, 0.39), (225, 0, 0.2), (225, 2, 1.2),
    (270, 0, 0.0), (270, 1, 0.0), (270, 2, 0.0),
)  # fmt: skip
"""Cam angle [deg], order of the derivative, value [cm/rad^order]; at 0 deg all three are zero."""
TABLE_INTERVALS = {"small": 540, "full": 2160}


def modified_trapezoid(t: np.ndarray) -> np.ndarray:
    """Acceleration of quarter sines, each an eighth of the rise long, and flats of a quarter (Neklutin 1952)."""
    peak = 8 * pi / (2 + pi)
    first = np.where(t < 0.5, t, 1.0 - t)
    falling = np.where(first < 3 / 8, 1.0, np.sin(4 * pi * (first - 1 / 4)))
    shape = np.where(first < 1 / 8, np.sin(4 * pi * first), falling)
    return peak * shape * np.where(t < 0.5, 1.0, -1.0)


def modified_sine(t: np.ndarray) -> np.ndarray:
    """Acceleration of sine waves of periods 1/2 at the ends and 3/2 between them (Schmidt 1960)."""
    peak = 4 * pi**2 / (pi + 4)
    first = np.where(t < 0.5, t, 1.0 - t)
    shape = np.where(first < 1 / 8, np.sin(4 * pi * first), np.sin(pi / 3 + 4 * pi / 3 * first))
    return peak * shape * np.where(t < 0.5, 1.0, -1.0)


def polynomial(*coefficients: float):
    """Acceleration of the lift sum_k c_k t^k."""
    return np.polynomial.Polynomial(coefficients).deriv(2)


LAWS = {
    "modified trapezoid": modified_trapezoid,
    "modified sine": modified_sine,
    "3-4-5": polynomial(0, 0, 0, 10, -15, 6),
    "cycloidal": lambda t: 2 * pi * np.sin(2 * pi * t),
    "4-5-6-7": polynomial(0, 0, 0, 0, 35, -84, 70, -20),
}


def main(size: str, folder=RESULTS) -> dict:
    """The laws, and the least peaks of derivatives two to five."""
    t = np.linspace(0.0, 1.0, SAMPLES)
    rows, best = [], {}
    for name, law in LAWS.items():
        row, best[name] = law_row(name, law(t), t, INTERVALS[size])
        rows.append(row)
    peaks = [{"order": m, "peak": one.peak, "bound": one.bound} for m in ORDERS for one in [least_peak(m)]]
    conditions = [(radians(angle), order, value) for angle, order, value in TABLE_5_4]
    table = least_peak_through(conditions, 3, TABLE_INTERVALS[size])
    handbook = {"least_jerk_cm_per_rad3": table.peak, "bound_cm_per_rad3": table.bound}
    content = {"laws": rows, "least_peaks": peaks, "table_5_4": handbook}
    figures = {"acceleration": draw(t, best), "table-5-4": draw_table(table)}
    return write_result("classical_laws", size, content, figures, folder)


def least_peak_through(conditions: Sequence[tuple[float, int, float]], order: int, intervals: int) -> DwellRise:
    """The motion from rest through `conditions` whose derivative of `order` m has the least peak.

    Each condition (x, k, value) says that s^(k)(x) = integral of (x - t)_+^(m-1-k) / (m-1-k)! u(t) is the value, with k
    < m and x > 0; the control u = s^(m) is constant on equal intervals up to the last x. For any multipliers, the sum
    of multiplier times value is at most the peak times the integral of |p|, where p is the sum of multiplier times
    kernel: this is the bound.
    """
    at, orders, values = (np.array(column, float) for column in zip(*conditions, strict=True))
    edges = np.linspace(0.0, at.max(), intervals + 1)
    powers = order - orders.astype(int)
    size = np.array([factorial(q) for q in powers], float)
    reach = np.maximum(at[:, None] - edges, 0.0) ** powers[:, None] / size[:, None]
    rows = reach[:, :-1] - reach[:, 1:]
    scale = np.abs(rows).sum(axis=1)
    both = [np.column_stack([sign * np.eye(intervals), -np.ones(intervals)]) for sign in (1, -1)]
    through = np.column_stack([rows / scale[:, None], np.zeros(len(rows))])
    level = np.append(values / scale, np.zeros(2 * intervals))
    low = np.append(values / scale, np.full(2 * intervals, -np.inf))
    bounds = np.array([(-np.inf, np.inf)] * intervals + [(0.0, np.inf)])
    optimum = minimise(np.append(np.zeros(intervals), 1.0), np.vstack([through, *both]), low, level, bounds)
    multipliers = optimum.row_duals[: len(rows)] / scale
    borders = np.unique(np.append(0.0, at))
    p = np.zeros((order, len(borders) - 1))  # ascending powers about each left border
    for x, q, multiplier in zip(at, powers, multipliers, strict=True):
        before = borders[1:] <= x + 1e-12
        for j in range(q):
            term = (x - borders[:-1][before]) ** (q - 1 - j) * (-1) ** j / factorial(j) / factorial(q - 1 - j)
            p[j, before] += multiplier * term
    bound = float(multipliers @ values) / absolute_integral(PPoly(p[::-1], borders))
    return DwellRise(optimum.value, bound, optimum.x[:-1])


def law_row(name: str, acceleration: np.ndarray, t: np.ndarray, intervals: int) -> tuple[dict, DwellRise]:
    """A law's peaks, the rise that it makes, and the least peak acceleration at its jerk with the bound."""
    jerk = float(np.abs(np.gradient(acceleration, t, edge_order=2)).max())
    best = least_acceleration(jerk, intervals)
    peak = float(np.abs(acceleration).max())
    row = {
        "law": name,
        "rise": float(np.trapezoid((1 - t) * acceleration, t)),
        "peak_acceleration": peak,
        "peak_jerk": jerk,
        "least_acceleration": best.peak,
        "bound": best.bound,
        "possible_gain_percent": 100 * (1 - best.peak / peak),
    }
    return row, best


def draw(t: np.ndarray, best: dict[str, DwellRise]) -> Figure:
    """Acceleration of each law, and that of the least peak at the same jerk."""
    rows = []
    for name, law in LAWS.items():
        least = best[name].derivative
        curves = [(name, t, law(t)), ("least at this jerk", np.linspace(0, 1, len(least)), least)]
        rows.append([Panel("acceleration", curves)])
    return panels(rows, "time over that of the rise", width=7.0, look={"least at this jerk": DASHED})


def draw_table(table: DwellRise) -> Figure:
    """Lift, velocity and acceleration of the motion through Table 5.4, and the numbers of the table."""
    angle = np.linspace(0.0, TABLE_5_4[-1][0], len(table.derivative) + 1)
    jerk, rows = PPoly(table.derivative[None], np.radians(angle)), []
    for order, name in enumerate(("lift [cm]", "velocity [cm/rad]", "acceleration [cm/rad²]")):
        numbers = zip(*[(at, value) for at, of, value in TABLE_5_4 if of == order], strict=True)
        motion = jerk.antiderivative(3 - order)(np.radians(angle))
        rows.append([Panel(name, [("motion of least peak jerk", angle, motion), ("numbers of the table", *numbers)])])
    return panels(rows, "cam angle [deg]", width=7.0, row_height=1.8, look={"numbers of the table": POINTS})


if __name__ == "__main__":
    run_script(main, __doc__)
