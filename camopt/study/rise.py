"""Design of a dwell-rise-dwell motion with the least acceleration, jerk or higher derivative.

The unit problem, a rise of one in unit time that begins and ends at rest, has closed forms. The least peak of the
derivative of order m is 2^(2(m-1)) (m-1)!; a control of this magnitude that changes sign at (1 - cos(j pi / m)) / 2
attains it. The least peak acceleration under a jerk J >= 32 is (J/4) (1 - sqrt(1 - 32/J)).
"""

from dataclasses import dataclass
from math import factorial

import numpy as np
from scipy.interpolate import PPoly
from scipy.sparse import csr_array, eye_array, hstack, vstack

from camopt.highs import minimise
from camopt.optimizer.bound.certificate import absolute_integral
from camopt.scene.errors import InputError

PEAK_INTERVALS, JERK_INTERVALS = 8000, 4000
"""Numbers of intervals with which program and bound agree with the closed forms within 1e-6."""
LEAST_JERK = 32.0
"""Below this jerk there is no motion that makes the unit rise in unit time."""


@dataclass(frozen=True)
class DwellRise:
    """A rise of one in unit time: its peak, and a lower bound on the peak of any such motion.

    `derivative` (k) is the limited one: that of order m on every interval, or the acceleration at the interval ends.
    """

    peak: float
    bound: float
    derivative: np.ndarray


def least_peak(order: int) -> DwellRise:
    """The rise whose derivative of `order` m, 2 or more, has the least peak, with all lower ones zero at both ends.

    The program maximises the rise under a control u = s^(m) of size one: s^(k) at the end is the integral of
    (1 - t)^(m-1-k) / (m-1-k)! u(t), zero for 0 < k < m. With any multipliers of these, no control rises higher than
    the integral of |p|, where p(t) = (1 - t)^(m-1) / (m-1)! - sum_k multiplier_k (1 - t)^(m-1-k) / (m-1-k)!.
    """
    if order < 2:
        raise InputError(f"order {order}: 2, which is the acceleration, or more is needed")
    remaining = 1.0 - np.linspace(0.0, 1.0, PEAK_INTERVALS + 1)
    ends = np.stack([-np.diff(remaining ** (order - k)) / factorial(order - k) for k in range(order)])
    size = ends.max(axis=1)
    rows = ends[1:] / size[1:, None]
    optimum = minimise(-ends[0] / size[0], rows, 0.0, 0.0, np.tile([-1.0, 1.0], (PEAK_INTERVALS, 1)))
    multipliers = np.append(1.0, optimum.row_duals * size[0] / size[1:])
    remaining = np.polynomial.Polynomial([1.0, -1.0])
    terms = (m * remaining ** (order - 1 - k) / factorial(order - 1 - k) for k, m in enumerate(multipliers))
    p = sum(terms, start=np.polynomial.Polynomial([0.0]))
    highest = absolute_integral(PPoly(p.coef[::-1, None], [0.0, 1.0]))
    rise = -optimum.value * size[0]
    return DwellRise(1 / rise, 1 / highest, optimum.x / rise)


def least_acceleration(jerk: float, intervals: int = JERK_INTERVALS) -> DwellRise:
    """The rise with the least peak acceleration A under a largest jerk J, acceleration zero at both ends.

    The acceleration a is linear on every interval. Let l and m be the multipliers of rise and end velocity, r a density
    that multiplies the acceleration, g(t) = l (1 - t) + m, and Q' = g - r. Integration by parts gives
    l = integral (g - r) a + integral r a <= J integral |Q| + A integral |r| for every motion, which bounds A.
    """
    if jerk <= LEAST_JERK:
        raise InputError(f"jerk {jerk:g}: a rise of one in unit time needs more than {LEAST_JERK:g}")
    n, h = intervals, 1.0 / intervals
    t = np.linspace(0.0, 1.0, n + 1)
    weight = np.full(n + 1, h)
    weight[[0, -1]] = h / 2
    rise = weight * (1 - t)
    rise[0], rise[-1] = h / 2 - h**2 / 6, h**2 / 6
    identity = eye_array(n + 1)
    slope = eye_array(n, n + 1, k=1) - eye_array(n, n + 1)
    peak, none = csr_array(-np.ones((n + 1, 1))), csr_array((n, 1))
    ends = np.column_stack([np.stack([rise, weight]), np.zeros(2)])
    sides = [hstack([sign * m, c]) for m, c in ((identity, peak), (slope, none)) for sign in (1, -1)]
    level = np.concatenate([[1.0, 0.0], np.zeros(2 * (n + 1)), np.full(2 * n, jerk * h)])
    low = np.append(level[:2], np.full(len(level) - 2, -np.inf))
    bounds = np.array([(0.0, 0.0), *[(-np.inf, np.inf)] * (n - 1), (0.0, 0.0), (0.0, np.inf)])
    rows, cost = vstack([csr_array(ends), *sides]), np.append(np.zeros(n + 1), 1.0)
    optimum = minimise(cost, rows, low, level, bounds, large=True)
    masses = -optimum.row_duals[2:][: 2 * (n + 1)]
    bound = _acceleration_bound(jerk, optimum.row_duals[:2], masses[: n + 1] - masses[n + 1 :], t)
    return DwellRise(optimum.value, bound, optimum.x[:-1])


def _acceleration_bound(jerk: float, ends: np.ndarray, mass: np.ndarray, t: np.ndarray) -> float:
    """The bound of `least_acceleration` from multipliers alone; each mass is spread half an interval to both sides."""
    edges = np.concatenate([[0.0], 0.5 * (t[1:] + t[:-1]), [1.0]])
    width = np.diff(edges)
    density = mass / width
    left = edges[:-1]
    first, second = ends[0] * (1 - left) + ends[1] - density, np.full(len(left), -ends[0] / 2)
    gained = np.cumsum(first * width + second * width**2)
    level = np.concatenate([[0.0], gained[:-1]])
    q = PPoly(np.stack([second, first, level - np.median(level)]), edges)
    return float((ends[0] - jerk * absolute_integral(q)) / np.abs(mass).sum())


ORDERS = {"acceleration": 2, "jerk": 3, "snap": 4, "crackle": 5}
"""Derivatives whose peak can be minimised, with their orders."""
COLUMNS = ("lift_mm", "velocity_mm_per_deg", "acceleration_mm_per_deg2", "jerk_mm_per_deg3")
MOST_ROWS = 360_000


@dataclass(frozen=True)
class Rise:
    """A rise of `rise_mm` over `over_deg` cam degrees between two dwells, with least peak of the derivative `order`.

    With `jerk_max_mm_per_deg3` the derivative is the acceleration, which is then zero at both ends.
    """

    rise_mm: float
    over_deg: float
    order: int
    jerk_max_mm_per_deg3: float | None
    peak: float  # mm/deg^order
    bound: float  # lower bound on the peak of any such motion
    lift: PPoly  # mm, from 0 to `over_deg`

    @property
    def least(self) -> str:
        """The name of the minimised derivative."""
        return next(name for name, order in ORDERS.items() if order == self.order)

    def table(self, step_deg: float) -> dict[str, np.ndarray]:
        """Columns at every step [deg] and at the end: cam angle, lift, and derivatives up to the limited one.

        Raises InputError for a step that gives too many rows.
        """
        if self.over_deg / step_deg > MOST_ROWS:
            raise InputError(f"--step-deg {step_deg:g}: a table has at most {MOST_ROWS} rows: take a larger step")
        angle = np.append(np.arange(0.0, self.over_deg * (1 - 1e-9), step_deg), self.over_deg)
        highest = self.order if self.jerk_max_mm_per_deg3 is None else self.order + 1
        columns = {name: self.lift(angle, k) for k, name in enumerate(COLUMNS[: highest + 1])}
        return {"cam_angle_deg": angle, **columns}

    def as_dict(self) -> dict:
        """The content of `rise --json`."""
        limits = {"rise_mm": self.rise_mm, "over_deg": self.over_deg, "jerk_max_mm_per_deg3": self.jerk_max_mm_per_deg3}
        limited = f"{self.least}_mm_per_deg{self.order}"
        return limits | {"least": self.least, f"{limited}_peak": self.peak, f"{limited}_bound": self.bound}

    def __str__(self) -> str:
        unit, jerk = f"mm/deg^{self.order}", self.jerk_max_mm_per_deg3
        under = "" if jerk is None else f", the jerk at most {jerk:g} mm/deg^3"
        return (
            f"A rise of {self.rise_mm:g} mm over {self.over_deg:g} deg between two dwells{under}:\n"
            f"  a motion has a peak {self.least} of        {self.peak:.6g} {unit}\n"
            f"  no motion has less (certified)     {self.bound:.6g} {unit}"
        )


def rise(rise_mm: float, over_deg: float, order: int = 3, jerk_max_mm_per_deg3: float | None = None) -> Rise:
    """The rise between two dwells whose derivative of `order` has the least peak, or the least acceleration under a
    jerk limit. Raises InputError where no motion keeps the jerk limit."""
    if jerk_max_mm_per_deg3 is None:
        unit, scale = least_peak(order), rise_mm / over_deg**order
        edges = np.linspace(0.0, over_deg, len(unit.derivative) + 1)
        lift = PPoly(unit.derivative[None] * scale, edges).antiderivative(order)
        return Rise(rise_mm, over_deg, order, None, unit.peak * scale, unit.bound * scale, lift)
    least = LEAST_JERK * rise_mm / over_deg**3
    if jerk_max_mm_per_deg3 <= least:
        raise InputError(
            f"--jerk-max-mm-per-deg3 {jerk_max_mm_per_deg3:g}: a rise of {rise_mm:g} mm over {over_deg:g} deg needs "
            f"more than {least:.6g}: allow more jerk or more degrees"
        )
    unit, scale = least_acceleration(jerk_max_mm_per_deg3 * over_deg**3 / rise_mm), rise_mm / over_deg**2
    values, edges = unit.derivative * scale, np.linspace(0.0, over_deg, len(unit.derivative))
    lift = PPoly(np.stack([np.diff(values) / np.diff(edges), values[:-1]]), edges).antiderivative(2)
    return Rise(rise_mm, over_deg, 2, jerk_max_mm_per_deg3, unit.peak * scale, unit.bound * scale, lift)
