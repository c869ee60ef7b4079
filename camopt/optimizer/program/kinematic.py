"""The kinematic problem on the free cam: largest area, sensitivities to the limits, conflicts, shortest duration."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from camopt.cam.families.free import FreeCam, free_cam
from camopt.cam.families.shape_rows import NEAR, SIGNS, Limits
from camopt.cam.lift import Lift
from camopt.cam.linear_limits import at_least
from camopt.highs import Infeasible
from camopt.optimizer.program.linear_program import ElasticProgram, Optimum, Rows, least_relaxation, maximise
from camopt.scene.design import REACH, ROUNDING, Design
from camopt.scene.errors import InputError
from camopt.scene.units import DEG, MM, MM_PER_DEG2

TYPICAL = 0.01
"""Typical free coefficient [mm/deg^2], for the solver's scaling: the size of the acceleration limits."""
SHORT_OF_FORCE = 1e-2
"""Penalty in area ratio per newton of missed margins: more than cams gain, except near the least shortfall."""
TYPICAL_FORCE = 100.0
"""A force of usual size [N], for the solver's scaling."""
PEAK_STEP = 1.5 * DEG
"""Step of the peak angles [rad] that are tried if the design requires that its maximum lift is reached."""
TRIED_KNOT_DEG = 3.0
"""Knot interval of the cams with which durations are tried; a third of it reduces the shortest duration by 0.2 deg."""
DURATION_STEP_DEG = 0.1
"""Step of the durations that are tried."""
LONGEST_SIDE_DEG = 179.0
"""Largest sum of half the duration, the ramp and its foot, which must end before 180 deg."""


@dataclass(frozen=True)
class KinematicOptimum:
    """The free cam of largest area: its coefficients z (m), area ratio, the program's solution and its limits."""

    cam: FreeCam
    z: np.ndarray
    area_ratio: float
    optimum: Optimum
    limits: Limits

    @property
    def lift(self) -> Lift:
        """The cam's lift law."""
        return self.cam.lift(self.z)

    @property
    def sensitivities(self) -> dict[str, float]:
        """Per cent more area by one per cent more of each limit, by the limit's name."""
        duals = self.optimum.duals
        return sensitivities(self.limits, duals, duals[len(self.limits.bound) :], self.area_ratio)


def kinematic_optimum(design: Design, cam: FreeCam, explain: bool = True) -> KinematicOptimum:
    """The largest area that the design's limits allow on the free cam `cam`.

    Where these contradict each other, raises InputError with what would resolve it, or Infeasible without `explain`.
    """
    limits = cam.limits(design)
    row, constant = area_ratio_row(design, cam)
    rows = spline_rows(limits.matrix)
    try:
        optimum = solve_over_peak_angles(cam, design, row, rows, limits.bound, first_working(limits))
    except Infeasible:
        if not explain:
            raise
        raise InputError(conflict(design, cam)) from None
    return KinematicOptimum(cam, optimum.z, optimum.value + constant, optimum, limits)


def area_ratio_row(design: Design, cam: FreeCam) -> tuple[np.ndarray, float]:
    """Row (m) and constant with area ratio = row @ z + constant."""
    row, constant = cam.area()
    full = design.max_lift_mm * MM * design.duration_deg * DEG
    return row / full, constant / full


def spline_rows(matrix: np.ndarray) -> Rows:
    """Rows (r, m) on free coefficients, scaled with the typical size of these."""
    return Rows(matrix, np.full(matrix.shape[1], TYPICAL))


def first_working(limits: Limits) -> np.ndarray:
    """Row indices of the first working set: every tenth row of the lift cap and of a drawing's limits, since these rows
    are nearly equal to their neighbours, and all other rows."""
    dense = limits.group >= limits.names.index("max_lift_mm")
    return np.union1d(np.flatnonzero(~dense), np.flatnonzero(dense)[::10])


def solve_over_peak_angles(cam: FreeCam, design: Design, objective, rows: Rows, bound, working) -> Optimum:
    """`maximise`, but if the design requires that its maximum lift is reached, the best optimum over peak angles within
    6 degrees of the middle: a last row then requires lift(peak) >= maximum lift, unless the optimum without this row
    reaches it. Raises Infeasible."""
    capped = maximise(objective, rows, bound, working)
    if not design.reach_max_lift or cam.lift(capped.z).max_lift >= lift_to_reach(design):
        return capped
    best, working = None, capped.working
    for peak in np.arange(-4, 5) * PEAK_STEP:
        matrix, levels = with_lift_reached(cam, design, rows.matrix, bound, peak)
        try:
            optimum = maximise(objective, spline_rows(matrix), levels, np.append(working, len(bound)))
        except Infeasible:
            continue
        if best is None or optimum.value > best.value:
            best = optimum
            working = optimum.working[optimum.working < len(bound)]
    if best is None:
        raise Infeasible("the maximum lift cannot be reached within 6 degrees of the middle")
    return best


def lift_to_reach(design: Design) -> float:
    """The lift [m] that the programs require if the design's maximum lift must be reached."""
    return design.max_lift_mm * MM * (1 - REACH + ROUNDING)


def sensitivities(limits: Limits, duals: np.ndarray, reaching: np.ndarray, area_ratio: float) -> dict[str, float]:
    """Per cent more area by one per cent more of each limit, from a program's duals, keyed by the limit's name.

    `duals` (r, ...) begin with those of the limits' rows; `reaching` are those of the row that requires the maximum
    lift to be reached, if there is one. The values are first-order, for this spline. Limits on a sign are left out.
    """
    sensitivity = {}
    for g, name in enumerate(limits.names):
        if name in SIGNS or name == NEAR:
            continue
        rows = limits.rows(name)
        gain = float(duals[rows] @ limits.slope[rows] * limits.size[g])
        if name == "max_lift_mm":  # area itself, not the ratio to a maximum lift that grows with it
            gain -= float(reaching.sum()) * limits.size[g]
        sensitivity[name] = float(gain / area_ratio)
    return sensitivity


def conflict(design: Design, cam: FreeCam) -> str:
    """One sentence on limits that contradict each other: the value of each limit that alone would resolve this."""
    limits = cam.limits(design)
    event = f"duration_deg = {design.duration_deg:g} with max_lift_mm = {design.max_lift_mm:g}"
    event += " to be reached" if design.reach_max_lift else ""
    lasting = {at_least(least): least for _, least, _ in design.duration_at}
    remedies = []
    shape, bound, working = _shape_program(cam, design, limits)
    for g, name in enumerate(limits.names):
        if name == NEAR:
            continue
        value, give, size = limits.value[g], np.zeros(len(bound)), abs(limits.value[g])
        lowered = name == "max_lift_mm" and design.reach_max_lift  # a lift that must be reached has to be lowered
        rows = limits.rows(name)
        if name in SIGNS:
            give[rows], size = 1.0, TYPICAL * MM_PER_DEG2
        elif lowered:
            give[-1] = limits.unit[g]
        else:
            give[rows] = limits.unit[g] * np.abs(limits.slope[rows])
        relaxed = least_relaxation(shape, bound, give, size, working)
        if relaxed is None:
            continue
        if name in SIGNS:
            remedies.append(f"{name} would have to be {SIGNS[name]} than {value:g} or be left out")
            continue
        needed = value + (-relaxed if lowered else limits.sign[g] * relaxed)
        if needed * value <= 0:
            continue  # no value of this limit resolves the conflict
        if name in lasting:
            high = f"{_rounded(needed, up=False)} mm, not {value:g} mm"
            remedies.append(f"the lift at +-{lasting[name] / 2:g} deg can reach only {high}")
            continue
        verb = "fall" if needed < value else "rise"
        remedies.append(f"{name} would have to {verb} from {value:g} to {_rounded(needed, up=needed > value)}")
    if not remedies:
        return (
            f"the limits of the design contradict each other: {event} and the ramps cannot be joined, and no single "
            f"limit can be relaxed to resolve it; relax several of {', '.join(limits.names)} or lengthen duration_deg"
        )
    shortest = shortest_duration_deg(design)
    if shortest is not None and shortest > design.duration_deg:
        remedies.insert(0, f"lengthen duration_deg to at least {shortest:g}")
    return (
        f"the limits of the design contradict each other for {event} and knots every {cam.knot_deg:g} deg: "
        + ", or ".join(remedies)
    )


@lru_cache(maxsize=16)
def shortest_duration_deg(design: Design) -> float | None:
    """The shortest duration_deg, rounded to `DURATION_STEP_DEG`, for which a cam with the durations of `duration_at`
    about the middle of the event exists, without `waves_max`. None where no duration between two ramps has such a cam,
    or where no row of `duration_at` has a least duration."""
    least = max((least for _, least, _ in design.duration_at), default=0.0)
    longest = round(longest_duration_deg(design) / DURATION_STEP_DEG)
    below = most = int(least / DURATION_STEP_DEG)  # in steps: a duration without a cam, one that may have a cam
    if not least:
        return None
    while not _has_a_cam(design, most * DURATION_STEP_DEG):
        if most >= longest:
            return None
        below, most = most, min(int(1.04 * most) + 1, longest)
    while most - below > 1:
        middle = (below + most) // 2
        below, most = (below, middle) if _has_a_cam(design, middle * DURATION_STEP_DEG) else (middle, most)
    return round(most * DURATION_STEP_DEG, 9)


def longest_duration_deg(design: Design) -> float:
    """The longest duration_deg, in whole degrees, that the design's ramps permit within a revolution."""
    sides = (height / velocity + design.ramp_foot_deg / 2 for height, velocity, _ in design.ramps())
    return float(int(2 * (LONGEST_SIDE_DEG - max(sides))))


def _has_a_cam(design: Design, duration_deg: float) -> bool:
    tried = design.model_copy(update={"duration_deg": duration_deg, "waves_max": None})
    try:
        kinematic_optimum(tried, free_cam(tried, TRIED_KNOT_DEG), explain=False)
    except Infeasible:
        return False
    return True


def with_lift_reached(cam: FreeCam, design: Design, matrix, bound, angle: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """The rows and right-hand sides; if the design's maximum lift must be reached, with a last row that requires it at
    an `angle` [rad], by default in the middle."""
    if not design.reach_max_lift:
        return matrix, bound
    row, offset = cam.basis(np.array([angle]))
    level = offset + row @ cam.x_p - lift_to_reach(design)
    return np.vstack([matrix, -row @ cam.Z]), np.append(bound, level)


def peak_angle(lift: Lift) -> float:
    """The angle [rad] of the largest lift, on a fine grid over the range of the peak angles that are tried."""
    angles = np.linspace(-4, 4, 401) * PEAK_STEP
    return float(angles[np.argmax(lift(angles))])


def elastic_shape(design: Design, cam: FreeCam, names: Iterable[str], cost: float, size: float) -> ElasticProgram:
    """The program of largest area whose limits `names` may be violated at a `cost`, by about `size`.

    A maximum lift that must be reached is reached in the middle.
    """
    limits, (row, _) = cam.limits(design), area_ratio_row(design, cam)
    rows, bound, working = _shape_program(cam, design, limits)
    give = np.zeros(len(bound))
    for name in names:
        give[limits.rows(name)] = 1.0
    return ElasticProgram(rows, bound, give, row, cost, size, working)


def _shape_program(cam: FreeCam, design: Design, limits: Limits) -> tuple[Rows, np.ndarray, np.ndarray]:
    """Rows, bounds (r) and first working set of the shape's limits, with any maximum lift reached in the middle."""
    matrix, bound = with_lift_reached(cam, design, limits.matrix, limits.bound)
    working = np.union1d(first_working(limits), np.arange(len(limits.bound), len(bound)))
    return spline_rows(matrix), bound, working


def _rounded(value: float, up: bool) -> str:
    """The value with three significant figures, rounded to the side on which the printed value is sufficient."""
    digits = 2 - int(np.floor(np.log10(abs(value))))
    return f"{(np.ceil if up else np.floor)(value * 10.0**digits) / 10.0**digits:g}"
