"""The limits of a design on a free cam, as rows on its coefficients that hold at every angle.

Each limit is imposed on Bernstein control points, between which a polynomial lies (Farin, Curves and Surfaces for CAGD,
2002, ch. 5).
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from camopt.cam.bernstein import from_powers
from camopt.cam.families.radius_rows import NearRows, Neighbourhood, near_rows, radii_held_near
from camopt.cam.linear_limits import LinearLimit, linear_limits
from camopt.cam.waves import sign_rows
from camopt.scene.design import ROUNDING, Design
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3, MM_PER_DEG4

if TYPE_CHECKING:
    from camopt.cam.families.free import FreeCam

CAP_INTERVAL = 0.5 * DEG
"""Longest interval between lift control nets: control points then exceed the lift by less than 1e-4 mm."""
INTERVALS = (CAP_INTERVAL, 1.0 * DEG, np.inf)
"""Longest interval between control nets by the highest derivative that is limited, infinite for a knot interval: where
the lift's second derivative counts, closer nets nearly repeat each other, on which a linear program may founder."""
HUGE = 1.0
"""A free coefficient [mm/deg^2] that no cam has: a hundred times a usual acceleration."""


SIGNS = {"nose_deg": "smaller", "waves_max": "larger"}
"""Limits on a sign: of the acceleration, of the jerk; and which numbers of them allow more."""
NEAR = "neighbourhood"
"""Name of the rows that keep a cam near another one, of which no number of the design speaks."""


@dataclass(frozen=True)
class About:
    """Where limits that are not linear in the lift are taken.

    `centres` [rad] are those of the design's durations, in order; at `switches` [rad] the jerk may change its sign.
    Without switches the number of its changes is not limited. Radii under a roller or pad are held `near` a cam.
    Without one only those of a roller are limited, by the linear limits that are stricter everywhere.
    """

    centres: tuple[float, ...] = ()
    switches: tuple[float, ...] = ()
    near: Neighbourhood | None = None


@dataclass(frozen=True)
class Limits:
    """Linear limits `matrix @ z <= bound` on a free cam; row r comes from the limit `names[group[r]]`.

    `value` (per name) is the number that the scene states, in the unit `unit` [SI], and it grows by `sign` times as
    much as the bound; `size` is its magnitude in SI and `slope[r]` is d bound[r] / d size. Size and slope are zero for
    the limits of `SIGNS`, whose rows bound a sign and no value, and for `NEAR`.
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
        """Indices of the rows of one limit; empty where the design does not set it."""
        return np.flatnonzero(self.group == self.names.index(name)) if name in self.names else np.zeros(0, int)


def free_limits(cam: "FreeCam", design: Design) -> Limits:
    """The limits of a design on acceleration, jerk, snap, lift and nose, and those that `linear_limits` declares."""
    parts = _LimitRows(cam, design)
    ends = cam.breaks[[0, -1]]
    if design.acceleration_max_mm_per_deg2 is not None:
        parts.add("acceleration_max_mm_per_deg2", MM_PER_DEG2, 2, ends, (1,))
    if design.acceleration_min_mm_per_deg2 is not None:
        parts.add("acceleration_min_mm_per_deg2", MM_PER_DEG2, 2, ends, (-1,))
    if design.jerk_max_mm_per_deg3 is not None:
        parts.add("jerk_max_mm_per_deg3", MM_PER_DEG3, 3, ends, (1, -1))
    if design.snap_max_mm_per_deg4 is not None:
        parts.add("snap_max_mm_per_deg4", MM_PER_DEG4, 4, ends, (1, -1))
    if design.nose_deg:
        nose = np.array([-1.0, 1.0]) * design.nose_deg * DEG
        parts.add("nose_deg", DEG, 2, nose, (1,))
    count = int(np.ceil((cam.breaks[1] - cam.breaks[0]) / CAP_INTERVAL))
    fine = np.linspace(ends[0], ends[1], count * (len(cam.breaks) - 1) + 1)
    parts.add("max_lift_mm", MM, 0, fine, (1,))
    if design.waves_max is not None and cam.about.switches:
        parts.add_signs(design.waves_max)
    for limit in linear_limits(design, cam.about.centres):
        if cam.about.near is None or limit.key not in radii_held_near(design):
            parts.add_linear(limit)
    for rows in near_rows(cam, design, cam.about.near) if cam.about.near else ():
        parts.add_near(rows)
    return parts.limits()


class _LimitRows:
    """The rows of `Limits`, collected one limit at a time."""

    def __init__(self, cam: "FreeCam", design: Design):
        self.cam, self.design = cam, design
        self.parts: list[tuple] = []

    def add(self, name: str, unit: float, order: int, edges, signs) -> None:
        """Adds the rows sign * lift^(order) <= sign * limit on control points; jerk and snap bind both signs."""
        matrix, offset = self.cam.control_points(order, np.asarray(edges))
        value = getattr(self.design, name)
        limit = value * unit
        nose = name == "nose_deg"
        if order in (2, 3) and not nose:  # the ramps are given: they hold it or no cam does
            matrix = np.vstack([matrix, np.zeros((2, matrix.shape[1]))])
            offset = np.append(offset, self.cam.ramp_extremes(order))
        for sign in signs:
            level = 0.0 if nose else abs(limit)
            tight = ROUNDING * (MM_PER_DEG2 * 0.01 if nose else level)  # the nose has no level: a usual acceleration
            slope = 0.0 if nose else 1.0
            bound = level - tight - sign * offset
            self._keep(sign * matrix, bound, slope, name, (level, unit, value, np.sign(value)))

    def add_linear(self, limit: LinearLimit) -> None:
        """Adds the rows of a limit that is linear in the lift."""
        matrix, bound = linear_rows(self.cam, limit)
        bound = bound - ROUNDING * limit.size
        per_value = 1 / limit.rate  # of the bound, per unit of the scene's number
        self._keep(
            matrix, bound, 1.0, limit.name, (limit.value * per_value, abs(per_value), limit.value, np.sign(limit.rate))
        )

    def add_signs(self, most: int) -> None:
        """Adds the rows that let the jerk change its sign at the cam's switches alone."""
        matrix, bound = sign_rows(self.cam, self.cam.about.switches)
        self._keep(matrix, bound, 0.0, "waves_max", (0.0, MM_PER_DEG3, most, 1.0))

    def add_near(self, rows: NearRows) -> None:
        """Adds rows of a limit that is held near a cam, or of the neighbourhood."""
        matrix, bound, kept = _without_given(rows.matrix, rows.bound - ROUNDING * np.abs(rows.bound).max())
        value = getattr(self.design, rows.key) if rows.key else 0.0
        self._keep(matrix, bound, rows.slope[kept], rows.key or NEAR, (value * MM, MM, value, -1.0))

    def _keep(self, matrix, bound, slope: float | np.ndarray, name: str, stated: tuple) -> None:
        self.parts.append((matrix, bound, np.broadcast_to(slope, len(bound)), name, stated))

    def limits(self) -> Limits:
        names = tuple(dict.fromkeys(p[3] for p in self.parts))
        first = {p[3]: p for p in reversed(self.parts)}
        size, unit, value, sign = np.array([first[n][4] for n in names], dtype=float).T
        return Limits(
            matrix=np.concatenate([p[0] for p in self.parts]),
            bound=np.concatenate([p[1] for p in self.parts]),
            slope=np.concatenate([p[2] for p in self.parts]),
            group=np.concatenate([np.full(len(p[1]), names.index(p[3])) for p in self.parts]),
            names=names,
            size=size,
            unit=unit,
            value=value,
            sign=sign,
        )


def linear_rows(cam: "FreeCam", limit: LinearLimit) -> tuple[np.ndarray, np.ndarray]:
    """Rows (r, m) and bounds (r) that hold a limit at every angle of its level, on the ramps as between them."""
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
    upper = _level_points(limit, start, width)
    matrix, bound = matrix.reshape(-1, matrix.shape[2]), (upper - offset).ravel() - level.error
    if level.low < first and level.high > last:  # the ramps are given: they hold it or no cam does
        outside = [limit.excess(cam.without_spline, *ends) for ends in ((level.low, first), (last, level.high))]
        matrix, bound = np.vstack([matrix, np.zeros(matrix.shape[1])]), np.append(bound, -max(outside))
    return _without_given(matrix, bound)[:2]


def _without_given(matrix: np.ndarray, bound: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The rows and bounds without those that the ramps beside them keep, and which rows these are: where hardly
    anything moves, the ramps keep a limit or no cam does."""
    given = np.abs(bound) > np.abs(matrix).sum(axis=1) * HUGE
    kept = ~given | (bound < 0)
    return np.where(given[:, None], 0.0, matrix)[kept], bound[kept], kept


def _level_points(limit: LinearLimit, start: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Control points (k, 6) of the level from `start` (k) [rad] over `width` (k)."""
    taylor = limit.level.taylor(start, start + 0.5 * width)
    powers = np.zeros((len(start), 6))
    powers[:, : taylor.shape[1]] = taylor * width[:, None] ** np.arange(taylor.shape[1])
    return powers @ from_powers(5).T
