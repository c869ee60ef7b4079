"""The limits of a design on a spline cam, as rows on its free coefficients that hold at every angle.

Each limit is imposed on Bernstein control points, between which a polynomial lies (Farin, Curves and Surfaces for CAGD,
2002, ch. 5): bounds on a derivative, a sign pattern of the jerk, sums of the lift and its derivatives
(`camopt.cam.linear_limits`), and planes that replace a radius near a given cam (`camopt.cam.families.radius_planes`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from camopt.cam.families.radius_planes import SIDES, Neighbourhood, planes
from camopt.cam.families.spline import SplineCam, merged
from camopt.cam.linear_limits import LinearLimit, linear_limits, radii_held_near
from camopt.cam.polynomials import from_powers
from camopt.scene.design import ROUNDING, Design
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3, MM_PER_DEG4

CAP_INTERVAL = 0.5 * DEG
"""Longest interval [rad] between control nets of the lift; control points then exceed the lift by less than 1e-4 mm."""
INTERVALS = (CAP_INTERVAL, 1.0 * DEG, np.inf)
"""Longest interval [rad] between control nets, by the highest derivative in the limit; infinite means a knot interval.
With a second derivative, closer nets give almost equal rows, on which a linear program may fail."""
PLANE_INTERVAL, FEWEST_PLANES = 0.5 * DEG, 240
"""Longest interval [rad] over which one plane replaces a radius, and least number of intervals in a duration."""
HUGE = 1.0
"""A free coefficient [mm/deg^2] larger than that of any cam: a hundred times a usual acceleration."""
CELL = 1.0 * DEG
"""Least distance [rad] between two sign changes of the jerk that a program distinguishes."""
FREE = 100 * MM_PER_DEG3
"""A jerk [m/rad^3] larger than that of any cam, as the bound of rows for the sign that is permitted."""
SIGNS = {"nose_deg": "smaller", "waves_max": "larger"}
"""Limits on the sign of the acceleration and of the jerk, with the kind of number that permits more."""
NEAR = "neighbourhood"
"""Name of the rows that keep a cam near another one; they belong to no number of the design."""


@dataclass(frozen=True)
class LinearisationPoint:
    """The point at which limits that are not linear in the lift are linearised.

    `centres` [rad] are the middles of the design's durations, in order; at `switches` [rad] the jerk may change its
    sign. Without switches the number of sign changes is not limited. Radii under a roller or pad are linearised `near`
    a cam. Without one only those of a roller are limited, by the linear limits that are stricter everywhere.
    """

    centres: tuple[float, ...] = ()
    switches: tuple[float, ...] = ()
    near: Neighbourhood | None = None


@dataclass(frozen=True)
class LimitRows:
    """The rows matrix (r, m) @ z <= bound (r) of the limit `name`, which `Limits` collects.

    `stated` has its size, unit, value and sign; `slope` is one number, or one per row.
    """

    name: str
    matrix: np.ndarray
    bound: np.ndarray
    slope: float | np.ndarray
    stated: tuple[float, float, float, float]


@dataclass(frozen=True)
class Limits:
    """Linear limits `matrix @ z <= bound` on a free cam; row r comes from the limit `names[group[r]]`.

    `value` (per name) is the number that the scene states, in the unit `unit` [SI]; it changes by `sign` times the
    change of the bound. `size` is its magnitude in SI, and `slope[r]` is d bound[r] / d size. Size and slope are zero
    for the limits of `SIGNS`, whose rows bound a sign and not a value, and for `NEAR`.
    """

    matrix: np.ndarray  # (r, m)
    bound: np.ndarray  # (r)
    slope: np.ndarray  # (r)
    group: np.ndarray  # (r) int
    names: tuple[str, ...]
    size: np.ndarray  # (g)
    unit: np.ndarray  # (g)
    value: np.ndarray  # (g)
    sign: np.ndarray  # (g)

    def rows(self, name: str) -> np.ndarray:
        """Indices of the rows of one limit; empty if the design does not set it."""
        return np.flatnonzero(self.group == self.names.index(name)) if name in self.names else np.zeros(0, int)


def shape_rows(cam: SplineCam, design: Design, about: LinearisationPoint) -> Limits:
    """All limits of a design on the shape of a cam; those that are not linear are linearised `about` a cam. Raises
    InputError if the neighbourhood of that cam has lifts that the follower cannot follow."""
    groups = [*_bounds(cam, design)]
    if design.waves_max is not None and about.switches:
        stated = 0.0, MM_PER_DEG3, design.waves_max, 1.0
        groups.append(LimitRows("waves_max", *sign_rows(cam, about.switches), 0.0, stated))
    groups += _sums(cam, design, about)
    groups += near_rows(cam, design, about.near) if about.near else ()
    first = {rows.name: rows.stated for rows in reversed(groups)}
    names = tuple(dict.fromkeys(rows.name for rows in groups))
    size, unit, value, sign = np.array([first[name] for name in names], dtype=float).T
    return Limits(
        matrix=np.concatenate([rows.matrix for rows in groups]),
        bound=np.concatenate([rows.bound for rows in groups]),
        slope=np.concatenate([np.broadcast_to(rows.slope, len(rows.bound)) for rows in groups]),
        group=np.concatenate([np.full(len(rows.bound), names.index(rows.name)) for rows in groups]),
        names=names,
        size=size,
        unit=unit,
        value=value,
        sign=sign,
    )


def _bounds(cam: SplineCam, design: Design) -> Iterator[LimitRows]:
    """The limits on one derivative: sign * lift^(order) <= sign * limit; jerk and snap are bounded on both sides."""
    ends = cam.breaks[[0, -1]]
    nose = np.array([-1.0, 1.0]) * (design.nose_deg or 0.0) * DEG
    count = int(np.ceil((cam.breaks[1] - cam.breaks[0]) / CAP_INTERVAL))
    fine = np.linspace(ends[0], ends[1], count * (len(cam.breaks) - 1) + 1)
    for name, unit, order, edges, signs in (
        ("acceleration_max_mm_per_deg2", MM_PER_DEG2, 2, ends, (1,)),
        ("acceleration_min_mm_per_deg2", MM_PER_DEG2, 2, ends, (-1,)),
        ("jerk_max_mm_per_deg3", MM_PER_DEG3, 3, ends, (1, -1)),
        ("snap_max_mm_per_deg4", MM_PER_DEG4, 4, ends, (1, -1)),
        ("nose_deg", DEG, 2, nose, (1,)),
        ("max_lift_mm", MM, 0, fine, (1,)),
    ):
        value, on_sign = getattr(design, name), name in SIGNS
        if value is None or (on_sign and not value):
            continue
        matrix, offset = cam.control_points(order, edges)
        if order in (2, 3) and not on_sign:  # the ramps are fixed: they satisfy it or no cam does
            matrix = np.vstack([matrix, np.zeros((2, matrix.shape[1]))])
            offset = np.append(offset, cam.ramp_extremes(order))
        level = 0.0 if on_sign else abs(value * unit)
        tight = ROUNDING * (MM_PER_DEG2 * 0.01 if on_sign else level)  # relative to a usual acceleration at the nose
        for sign in signs:
            bound = level - tight - sign * offset
            yield LimitRows(name, sign * matrix, bound, 0.0 if on_sign else 1.0, (level, unit, value, np.sign(value)))


def cells(cam: SplineCam) -> Float[np.ndarray, " k"]:
    """The angles [rad] at which a program may change the sign of the jerk, from end to end of the duration."""
    low, high = cam.breaks[[0, -1]]
    return np.linspace(low, high, round((high - low) / CELL) + 1)


def sign_rows(cam: SplineCam, switches: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Rows (r, m) and bounds (r) that require a jerk of one sign between neighbouring `switches` [rad], positive first.
    The left-hand sides are the same for all switches at `cells`; rows for the permitted sign are not active."""
    edges = merged(np.concatenate([cells(cam), cam.breaks]))
    matrix, offset = cam.control_points(3, edges)
    positive = np.searchsorted(switches, 0.5 * (edges[1:] + edges[:-1])) % 2 == 0
    width = (len(offset) - 1) // len(positive)
    permitted = []
    for sign in (positive, ~positive):
        within = np.append(np.repeat(sign, width), sign[-1])
        within[width:-1:width] &= sign[:-1]  # a control point that two intervals share
        permitted.append(within)
    bound = np.concatenate([np.where(permitted[0], FREE, 0.0) - offset, np.where(permitted[1], FREE, 0.0) + offset])
    return np.vstack([matrix, -matrix]), bound


def _sums(cam: SplineCam, design: Design, about: LinearisationPoint) -> Iterator[LimitRows]:
    """The limits on sums of the lift and its derivatives, without the radii that are linearised near a cam."""
    for limit in linear_limits(design, about.centres):
        if about.near is None or limit.key not in radii_held_near(design):
            matrix, bound = _sum_rows(cam, limit)
            per_value = 1 / limit.rate  # change of the bound per unit of the scene's number
            stated = limit.value * per_value, abs(per_value), limit.value, float(np.sign(limit.rate))
            yield LimitRows(limit.name, matrix, bound - ROUNDING * limit.size, 1.0, stated)


def _sum_rows(cam: SplineCam, limit: LinearLimit) -> tuple[np.ndarray, np.ndarray]:
    """Rows (r, m) and bounds (r) that impose a limit at every angle of its level, on the ramps and between them."""
    level, (first, last) = limit.level, cam.breaks[[0, -1]]
    if level.low == level.high:
        assert len(limit.weights) == 1, "only the lift itself is limited at one angle"
        row, offset = cam.basis(np.array([min(level.low, last - 1e-12)]))
        matrix = limit.weights[0] * (row @ cam.Z)
        return matrix, level.coefficients[0] - limit.weights[0] * (offset + row @ cam.x_p)
    low, high = max(level.low, first), min(level.high, last)
    marks = np.concatenate([[low, high], cam.breaks, level.borders])
    marks = np.unique(np.clip(marks, low, high))
    marks = marks[np.append(np.diff(marks) > 1e-9, True)]
    longest = INTERVALS[len(limit.weights) - 1]
    shares = [np.linspace(a, b, max(1, int(np.ceil((b - a) / longest))) + 1)[:-1] for a, b in pairwise(marks)]
    start = np.concatenate(shares)
    width = np.diff(np.append(start, marks[-1]))
    matrix, offset = cam.weighted_points(limit.weights, start, width)
    taylor, powers = level.taylor(start, start + 0.5 * width), np.zeros((len(start), 6))
    powers[:, : taylor.shape[1]] = taylor * width[:, None] ** np.arange(taylor.shape[1])
    upper = powers @ from_powers(5).T
    matrix, bound = matrix.reshape(-1, matrix.shape[2]), (upper - offset).ravel() - level.error
    if level.low < first and level.high > last:  # the ramps are fixed: they satisfy it or no cam does
        outside = [limit.excess(cam.without_spline, *ends) for ends in ((level.low, first), (last, level.high))]
        matrix, bound = np.vstack([matrix, np.zeros(matrix.shape[1])]), np.append(bound, -max(outside))
    return _without_fixed(matrix, bound)[:2]


def near_rows(cam: SplineCam, design: Design, near: Neighbourhood) -> Iterator[LimitRows]:
    """The planes of all radii, then the rows that keep the cam in the neighbourhood; errors are as for `shape_rows`."""
    assert design.geometry is not None, "the scene asks for it"
    count = int(np.ceil(max((cam.breaks[1] - cam.breaks[0]) / PLANE_INTERVAL, FEWEST_PLANES / (len(cam.breaks) - 1))))
    edges = np.linspace(cam.breaks[0], cam.breaks[-1], count * (len(cam.breaks) - 1) + 1)
    start, width = edges[:-1], np.diff(edges)
    low, high = near.box(edges, design.max_lift_mm * MM)

    def bounding(name: str, value: float, matrix: np.ndarray, bound: np.ndarray, slope: np.ndarray) -> LimitRows:
        """The rows of the control points of all intervals."""
        matrix, bound, slope = matrix.reshape(-1, matrix.shape[2]), bound.ravel(), np.repeat(slope, matrix.shape[1])
        matrix, bound, remaining = _without_fixed(matrix, bound - ROUNDING * np.abs(bound).max())
        return LimitRows(name, matrix, bound, slope[remaining], (value * MM, MM, value, -1.0))

    for key in radii_held_near(design):
        value = getattr(design, key)
        weights, level, slope = planes(design.geometry, key, value * MM, low, high)
        matrix, offset = cam.weighted_points((*weights, np.full(len(start), SIDES[key])), start, width)
        yield bounding(key, value, matrix, level[:, None] - offset, slope)
    for order in (0, 1):
        matrix, offset = cam.weighted_points((0.0,) * order + (1.0,), start, width)
        for sign, most in ((1.0, high[order]), (-1.0, -low[order])):
            yield bounding(NEAR, 0.0, sign * matrix, most[:, None] - sign * offset, np.zeros(len(start)))


def _without_fixed(matrix: np.ndarray, bound: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The rows and bounds that are kept, and their mask. Where the free coefficients have almost no effect, either the
    ramps satisfy a limit, and its row is dropped, or no cam does, and its row is zero with a negative bound."""
    fixed = np.abs(bound) > np.abs(matrix).sum(axis=1) * HUGE
    remaining = ~fixed | (bound < 0)
    return np.where(fixed[:, None], 0.0, matrix)[remaining], bound[remaining], remaining
