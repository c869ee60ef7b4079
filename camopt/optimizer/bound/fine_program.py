"""The fine linear program that supplies the multipliers of a certificate: the continuous problem on equal intervals.

A limit of the drawing has the form sum_k w_k lift^(k) <= level. Its multipliers are masses >= 0, each spread evenly
over a cell of angles, so that each multiplies the limit's mean over the cell; every cam that keeps the limit keeps this
mean too. As lift^(k)(t) = start^(k)(t) + integral over s < t of (t - s)^n / n! control(s) ds, the mean over a cell from
a to b has the kernel ((b - s)_+^(n+1) - (a - s)_+^(n+1)) / ((n + 1)! (b - a)). The cell of a single angle is that
angle.
"""

from itertools import pairwise
from math import factorial

import numpy as np
from scipy.interpolate import PPoly
from scipy.sparse import coo_array, vstack

from camopt.cam.families.free import free_cam
from camopt.cam.linear_limits import LinearLimit, linear_limits, radii_held_near
from camopt.cam.polynomials import PiecewiseLevel
from camopt.cam.ramps import Ramp, scene_ramps
from camopt.highs import Infeasible, minimise
from camopt.optimizer.program.kinematic import conflict
from camopt.scene.design import Design
from camopt.scene.errors import InputError
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3


def bounded_limits(design: Design) -> list[LinearLimit]:
    """The limits of the drawing that a bound may use: all except those that are one of several ways to hold a key."""
    return [limit for limit in linear_limits(design) if not limit.chosen]


def left_out(design: Design) -> list[str]:
    """The keys of the limits on the shape that the bound does not use: it holds with them too, but is less tight."""
    shape = [key for key in ("snap_max_mm_per_deg4", "waves_max") if getattr(design, key)]
    chosen = [limit.key for limit in linear_limits(design) if limit.chosen]
    return list(dict.fromkeys([*shape, *chosen, *radii_held_near(design)]))


def cells(limit: LinearLimit, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Start and end (k) [rad] of the cell of every mass: one angle, or half an interval to both sides of each angle."""
    low, high = limit.level.low, limit.level.high
    if low == high:
        return np.array([low]), np.array([low])
    middles = 0.5 * (grid[1:] + grid[:-1])
    low, high = max(low, grid[0]), min(high, grid[-1])
    starts = np.clip(np.concatenate([grid[:1], middles]), low, high)
    return starts, np.clip(np.concatenate([middles, grid[-1:]]), low, high)


def limit_terms(
    design: Design, grid: np.ndarray, masses: tuple[np.ndarray, ...], opening: Ramp, power: int
) -> tuple[float, PPoly]:
    """Constant and kernel of the sum of mass times (level - weighted sum); the control is lift^(power)."""
    terms, edges, constant = [], [grid], 0.0
    for limit, mass in zip(bounded_limits(design), masses, strict=True):
        begin, end = cells(limit, grid)
        used = (mass > 0) & ((end > begin) | (limit.level.low == limit.level.high))
        begin, end, mass = begin[used], end[used], mass[used]
        constant += float(mass @ (_mean_level(limit.level, begin, end) + limit.level.error))
        middle = 0.5 * (begin + end) - grid[0]
        start = [opening.height + opening.velocity * middle, np.full(len(middle), opening.velocity)]
        for order, weight in enumerate(limit.weights):
            if weight and order < 2:
                constant -= weight * float(mass @ start[order])
            if weight:
                terms.append((begin, end, weight * mass, power - 1 - order))
        edges += [begin, end]
    borders = np.unique(np.clip(np.concatenate(edges), grid[0], grid[-1]))
    taylor = np.zeros((power + 1, len(borders) - 1))
    for begin, end, mass, n in terms:
        _subtract_means(taylor, borders, begin, end, mass, n)
    return constant, PPoly(taylor[::-1], borders)


def _subtract_means(taylor, borders, begin, end, mass, n: int) -> None:
    """Subtracts mass times the mean of (t - s)_+^n / n! over every cell from the Taylor coefficients of the pieces."""
    left, right = borders[:-1], borders[1:]
    for a, b, m in zip(begin, end, mass, strict=True):
        before = right <= a + 1e-15  # s lies wholly before the cell
        inside = ~before & (right <= b + 1e-15)
        x, y = b - left, a - left
        for j in range(n + 2):
            q, sign = n + 1 - j, (-1) ** j / factorial(j)
            if a == b:
                if j <= n:
                    taylor[j, before] -= m * sign * x[before] ** (n - j) / factorial(n - j)
                continue
            if q > 0:  # (x^q - y^q) / (x - y), without cancellation
                mean = sum(x[before] ** i * y[before] ** (q - 1 - i) for i in range(q))
                taylor[j, before] -= m * sign * mean / factorial(q)
            taylor[j, inside] -= m * sign * x[inside] ** q / factorial(q) / (b - a)


def _mean_level(level: PiecewiseLevel, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The mean of the level's pieces over every cell."""
    if len(level.coefficients) == 1:
        return np.full(len(begin), level.coefficients[0, 0])
    total = PPoly(level.coefficients[:, ::-1].T, level.borders).antiderivative()
    return (total(end) - total(begin)) / (end - begin)


def duration_grid(design: Design, intervals: int) -> np.ndarray:
    """Grid of nearly equal intervals over the duration [rad], with the borders of the nose among its angles."""
    half, nose = design.duration_deg / 2, design.nose_deg or 0.0
    step = 2 * half / intervals
    marks = [-half, -nose, nose, half] if nose else [-half, 0.0, half]
    parts = [np.linspace(a, b, int(np.ceil((b - a) / step - 1e-9)) + 1) for a, b in pairwise(marks)]
    return np.unique(np.concatenate(parts)) * DEG


class DiscretisedControlProblem:
    """The continuous problem with a control that is constant on every interval, in units of half the duration and the
    maximum lift. Its columns are lift, velocity and, under a jerk limit, acceleration at every grid angle, then the
    control on every interval."""

    def __init__(self, design: Design, grid: np.ndarray):
        self.design, self.grid, self.half = design, grid, grid[-1]
        self.jerk = design.jerk_max_mm_per_deg3
        self.order = 2 if self.jerk is None else 3  # integrations from the control to the lift
        self.unit = design.max_lift_mm * MM / self.half ** np.arange(4)  # of lift, velocity, acceleration, jerk
        self.nodes = len(grid)
        width = np.diff(grid) / self.half
        self.steps = [width**k / factorial(k) for k in range(self.order + 2)]
        acceleration = [design.acceleration_min_mm_per_deg2, design.acceleration_max_mm_per_deg2]
        self.acceleration = [None if a is None else a * MM_PER_DEG2 / self.unit[2] for a in acceleration]
        self.on_nose = np.abs(grid) <= (design.nose_deg or -1.0) * DEG + 1e-12

    def column(self, state: int, node):
        """Columns of a state at nodes (0 is the lift, 1 the velocity, ...) or, for `order`, of the control."""
        return state * self.nodes + node

    def motion(self) -> coo_array:
        """Rows that are zero if the states at every grid angle follow from those before by their Taylor series."""
        n, interval = self.nodes - 1, np.arange(self.nodes - 1)
        rows, columns, values = [], [], []
        for state in range(self.order):
            row = state * n + interval
            rows.append(row)
            columns.append(self.column(state, interval + 1))
            values.append(-np.ones(n))
            for higher in range(state, self.order + 1):
                rows.append(row)
                columns.append(self.column(higher, interval))
                values.append(self.steps[higher - state])
        shape = (self.order * n, self.order * self.nodes + n)
        return coo_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)

    def bounds(self) -> np.ndarray:
        """Lower and upper bound of every column."""
        n, last = self.nodes, self.nodes - 1
        box = np.full((self.order * n + last, 2), [-np.inf, np.inf])
        box[self.column(0, np.arange(n)), 1] = 1.0
        low, high = (np.inf if a is None else abs(a) for a in self.acceleration)
        points = self.on_nose if self.order == 3 else self.on_nose[1:] & self.on_nose[:-1]
        limited = self.column(2, np.arange(len(points)))
        box[limited, 0], box[limited, 1] = -low, np.where(points, 0.0, high)
        if self.jerk is not None:
            jerk = self.jerk * MM_PER_DEG3 / self.unit[3]
            box[self.column(3, np.arange(last))] = [-jerk, jerk]
        opening, closing = scene_ramps(self.design)
        ends = [(opening.height, closing.height), (opening.velocity, -closing.velocity), (0.0, 0.0)]
        for state in range(self.order):
            for node, value in zip((0, last), ends[state], strict=True):
                box[self.column(state, node)] = value / self.unit[state]
        return box

    def _limit_rows(self, limit: LinearLimit) -> tuple[coo_array, np.ndarray, float]:
        """Rows, right-hand sides and the rows' factor for a limit of the drawing, at the grid angles that it covers."""
        level, at_one_angle = limit.level, limit.level.low == limit.level.high
        at = np.array([level.low]) if at_one_angle else self.grid
        held = np.flatnonzero((at >= level.low - 1e-12) & (at <= level.high + 1e-12))
        node = np.clip(np.searchsorted(self.grid, at[held] + 1e-12) - 1, 0, self.nodes - 2)
        ahead = (at[held] - self.grid[node]) / self.half
        factor = 1 / max(abs(w) * u for w, u in zip(limit.weights, self.unit, strict=False))
        rows, columns, values = [], [], []
        for order, weight in enumerate(limit.weights):
            for state in range(order, self.order + 1 if weight else 0):
                rows.append(np.arange(len(held)))
                columns.append(self.column(state, node))
                power = ahead ** (state - order) / factorial(state - order)
                values.append(factor * weight * self.unit[order] * power)
        shape = (len(held), self.order * self.nodes + self.nodes - 1)
        matrix = coo_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
        upper = level.taylor(at[held], np.clip(at[held], level.low, level.high))[:, 0]
        return matrix, factor * upper, factor

    def _masses(self, drawing: list[tuple[coo_array, np.ndarray, float]], duals: np.ndarray) -> tuple[np.ndarray, ...]:
        """Multipliers in SI: for each limit one at every angle of the grid, or only one if the limit has one angle."""
        masses, first = [], 0
        for limit, (_, level, factor) in zip(bounded_limits(self.design), drawing, strict=True):
            mass = np.maximum(duals[first : first + len(level)], 0.0) * factor * self.unit[0] * self.half
            first += len(level)
            if limit.level.low < limit.level.high:
                inside = (self.grid >= limit.level.low - 1e-12) & (self.grid <= limit.level.high + 1e-12)
                masses.append(np.zeros(self.nodes))
                masses[-1][inside] = mass
            else:
                masses.append(mass)
        return tuple(masses)

    def multipliers(self, control_worth: np.ndarray | None = None):
        """Multipliers in SI: of lift cap, acceleration maximum and minimum and nose (k each), of the closing (3), and a
        tuple of those of every limit of `bounded_limits`.

        `control_worth` (k - 1) [m rad] is what a unit of control over each interval adds beside the area. Raises
        InputError if no cam holds all limits.
        """
        n = self.nodes
        motion, drawing = self.motion(), [self._limit_rows(limit) for limit in bounded_limits(self.design)]
        columns = self.order * n + n - 1
        cost = np.zeros(columns)
        for state in range(self.order + 1):
            cost[self.column(state, np.arange(n - 1))] = -self.steps[state + 1]
        if control_worth is not None:
            full = self.unit[0] * self.half
            cost[self.column(self.order, np.arange(n - 1))] -= control_worth * self.unit[self.order] / full
        zero, limits = np.zeros(self.order * (n - 1)), np.concatenate([[], *(level for _, level, _ in drawing)])
        rows = vstack([motion, *(rows for rows, _, _ in drawing)])
        low = np.append(zero, np.full(len(limits), -np.inf))
        try:
            optimum = minimise(cost, rows, low, np.append(zero, limits), self.bounds(), large=True)
        except Infeasible:
            raise InputError(conflict(self.design, free_cam(self.design))) from None
        masses = self._masses(drawing, -optimum.row_duals[len(zero) :])
        upper, lower = np.maximum(-optimum.column_duals, 0.0), np.maximum(optimum.column_duals, 0.0)
        nodes = np.arange(n)
        inner = (nodes > 0) & (nodes < n - 1)  # both ends are fixed by the ramps
        lift_cap = np.where(inner, upper[nodes], 0.0) * self.half
        closing = np.zeros(3)
        for state in range(self.order):
            last = self.column(state, n - 1)
            closing[state] = optimum.column_duals[last] * self.half ** (state + 1)
        if self.order == 2:
            return lift_cap, np.zeros(n), np.zeros(n), np.zeros(n), closing, masses
        acceleration = self.column(2, nodes)
        push = np.where(inner, upper[acceleration], 0.0) * self.half**3
        pull = np.where(inner, lower[acceleration], 0.0) * self.half**3
        return lift_cap, np.where(self.on_nose, 0.0, push), pull, np.where(self.on_nose, push, 0.0), closing, masses
