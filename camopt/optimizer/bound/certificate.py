"""A certified upper bound on the area of every cam under a design's limits, spline or not, symmetric or not.

The bound comes from weak duality against the continuous problem. Let the angle run from -h to h, and let the jerk j be
the control, so that

    lift(t) = start(t) + integral over s < t of (t - s)^2 / 2 j(s) ds,      start(t) = height + velocity (t + h).

Add to the area every limit times a multiplier >= 0 (a measure over the angle), and every condition at the closing ramp
top times a multiplier of any sign. For a cam within the limits the sum is at least its area, and it is affine in j:

    area <= constant + integral p(s) j(s) ds <= constant + J integral |p(s)| ds.

Here J is the jerk limit, and p is a piecewise cubic that follows from the multipliers. Whatever these are, the right
side bounds the area of every cam whose acceleration is Lipschitz. Good multipliers come from a fine linear
program; an error in them makes the bound less tight, never wrong. Without a jerk limit the acceleration a is the
control, p is a piecewise quadratic, and the second step takes the largest p(s) a(s) within the acceleration limits.
Luenberger (Optimization by Vector Space Methods, 1969, ch. 8) treats weak duality in function spaces.
"""

from dataclasses import dataclass
from functools import cached_property
from math import comb, factorial

import numpy as np
from scipy.interpolate import PPoly

from camopt.cam.lift import Lift
from camopt.cam.ramps import scene_ramps
from camopt.measure.limits import broken_by_shape, duration_words
from camopt.optimizer.bound.fine_program import DiscretisedControlProblem, duration_grid, limit_terms
from camopt.scene.design import Design
from camopt.scene.errors import InputError
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3

INTERVALS = 1440
"""Least number of intervals of the program that supplies the multipliers."""
ROUNDING = 1e-12
"""Added to every bound on the area ratio: well above the round-off of its evaluation."""


Terms = tuple[float, PPoly]
"""Further conditions times their multipliers: constant + integral kernel(s) control(s) ds [m rad], which is >= 0 if the
conditions are met."""


@dataclass(frozen=True)
class Certificate:
    """Multipliers of the design's limits at the angles `grid` (k) [rad], and the bound that follows from them alone.

    `lift_cap` (k) are point masses at the grid. `acceleration_max`, `acceleration_min` and `nose` (k) are masses that
    are spread evenly over half an interval to either side of their angle (within the duration and the nose), which
    makes p continuous. `closing` (3) belongs to the conditions on lift, velocity and acceleration at the closing ramp
    top. The multipliers of a limit that the design does not set are zero. `drawing` has an array of masses for every
    limit of `bounded_limits`. All multiply SI quantities and give an area in m rad.
    """

    design: Design
    grid: np.ndarray
    lift_cap: np.ndarray
    acceleration_max: np.ndarray
    acceleration_min: np.ndarray
    nose: np.ndarray
    closing: np.ndarray
    drawing: tuple[np.ndarray, ...] = ()

    @cached_property
    def bound(self) -> float:
        """Upper bound on the area ratio of every cam under the design's limits."""
        return self.evaluate()

    def evaluate(self, further: Terms | None = None) -> float:
        """The bound from the stored multipliers alone, with those of `further` conditions if there are any.

        Raises ValueError if a multiplier that must be >= 0 is negative.
        """
        _check_signs(self)
        jerk = self.design.jerk_max_mm_per_deg3
        constant = _constant(self, jerk is not None)
        p = _switching_function(self, jerk is not None)
        terms = [] if further is None else [further]
        if self.drawing:
            opening, power = scene_ramps(self.design)[0], 2 if jerk is None else 3
            terms.insert(0, limit_terms(self.design, self.grid, self.drawing, opening, power))
        for more, kernel in terms:
            constant += more
            p = piecewise_sum(p, kernel)
        free = _largest_by_acceleration(self.design, p) if jerk is None else jerk * MM_PER_DEG3 * absolute_integral(p)
        full = self.design.max_lift_mm * MM * (self.grid[-1] - self.grid[0])
        return min(1.0, (constant + free) / full + ROUNDING)  # the lift cap alone allows no more than 1


def _check_signs(c: Certificate) -> None:
    for name in ("lift_cap", "acceleration_max", "acceleration_min", "nose"):
        values = getattr(c, name)
        if not np.all(values >= 0):  # also refuses NaN
            raise ValueError(f"the multipliers {name} of a certificate must be >= 0")
        limit = {"lift_cap": "max_lift_mm", "nose": "nose_deg"}.get(name, name + "_mm_per_deg2")
        if getattr(c.design, limit) is None and np.any(values != 0):
            raise ValueError(f"the multipliers {name} of a certificate belong to a limit that the design does not set")
    if not all(np.all(masses >= 0) for masses in c.drawing):
        raise ValueError("the multipliers drawing of a certificate must be >= 0")
    if c.design.nose_deg and np.any(c.nose[np.abs(c.grid) > c.design.nose_deg * DEG + 1e-12] != 0):
        raise ValueError("the multipliers nose of a certificate must vanish outside the nose")


def _constant(c: Certificate, by_jerk: bool) -> float:
    """The terms of the bound that do not depend on the control [m rad]."""
    opening, closing = scene_ramps(c.design)
    half = c.grid[-1]
    start = opening.height + opening.velocity * (c.grid + half)
    total = 2 * half * opening.height + opening.velocity * (2 * half) ** 2 / 2
    total += float(np.sum(c.lift_cap * (c.design.max_lift_mm * MM - start)))
    total += c.closing[0] * (start[-1] - closing.height) + c.closing[1] * (opening.velocity + closing.velocity)
    if by_jerk:
        total += float(c.acceleration_max.sum()) * (c.design.acceleration_max_mm_per_deg2 or 0.0) * MM_PER_DEG2
        total -= float(c.acceleration_min.sum()) * (c.design.acceleration_min_mm_per_deg2 or 0.0) * MM_PER_DEG2
    return float(total)


def _switching_function(c: Certificate, by_jerk: bool) -> PPoly:
    """p(s), a piecewise polynomial: what a unit of control at s adds to the area and the multiplier terms."""
    half = c.grid[-1]
    power = 3 if by_jerk else 2  # integrations from the control to the lift
    middles = 0.5 * (c.grid[1:] + c.grid[:-1])
    nose = [-c.design.nose_deg * DEG, c.design.nose_deg * DEG] if c.design.nose_deg else []
    edges = np.unique(np.concatenate([c.grid, middles, nose]))
    left, right = edges[:-1], edges[1:]
    taylor = np.zeros((power + 1, len(left)))  # about the left edge, ascending powers
    _add_power(taylor, left, half, power, 1.0)  # the area itself
    _add_power(taylor, left, half, power - 1, c.closing[0])
    _add_power(taylor, left, half, power - 2, c.closing[1])
    ahead = np.searchsorted(c.grid, right)  # grid angles from the right edge on
    _add_masses(taylor, left, c.grid, c.lift_cap, ahead, power - 1)
    if by_jerk:
        taylor[0] += c.closing[2]
        density = _spread(c.acceleration_min - c.acceleration_max, c.grid, edges, -half, half)
        if nose:
            density -= _spread(c.nose, c.grid, edges, *nose)
        mass = density * (right - left)
        taylor[0] += np.cumsum(mass[::-1])[::-1]
        taylor[1] -= density
    return PPoly(taylor[::-1], edges)


def _add_power(taylor: np.ndarray, left: np.ndarray, end: float, power: int, weight: float) -> None:
    """Adds weight * (end - s)^power / power! on every piece."""
    for k in range(power + 1):
        taylor[k] += weight * (-1) ** k * (end - left) ** (power - k) / factorial(power - k) / factorial(k)


def _add_masses(taylor, left, grid, masses, ahead, power) -> None:
    """Subtracts on every piece the sum of mass * (t - s)^power / power! over the grid angles t from its right edge on.

    The sums run from the right over (t - s) themselves, which are all positive, so that nothing cancels.
    """
    for k in range(power + 1):
        total = np.zeros(len(left))
        order = power - k
        for i in np.flatnonzero(masses):
            reach = ahead <= i
            total[reach] += masses[i] * (grid[i] - left[reach]) ** order
        taylor[k] -= (-1) ** k * total / factorial(order) / factorial(k)


def _spread(masses, grid, edges, low, high) -> np.ndarray:
    """Density on every piece of masses that are spread evenly over the half intervals beside their angle.

    The masses stay within [low, high].
    """
    middles = 0.5 * (grid[1:] + grid[:-1])
    starts = np.clip(np.concatenate([grid[:1], middles]), low, high)
    ends = np.clip(np.concatenate([middles, grid[-1:]]), low, high)
    width = ends - starts
    owner = np.searchsorted(middles, 0.5 * (edges[1:] + edges[:-1]))
    centre = 0.5 * (edges[1:] + edges[:-1])
    density = np.divide(masses, width, out=np.zeros(len(grid)), where=width > 0)
    return np.where((centre > low) & (centre < high), density[owner], 0.0)


def _parts(p: PPoly, breaks=()) -> tuple[np.ndarray, np.ndarray]:
    """Integrals of p between consecutive sign changes, edges and `breaks`, and the middles of those intervals."""
    roots = p.roots(discontinuity=False, extrapolate=False)  # NaN marks a piece that is zero everywhere
    cuts = np.unique(np.concatenate([p.x, roots[np.isfinite(roots)], np.asarray(breaks)]))
    return np.diff(p.antiderivative()(cuts)), 0.5 * (cuts[1:] + cuts[:-1])


def absolute_integral(p: PPoly) -> float:
    """Integral of |p| over the angles of its pieces."""
    return float(np.abs(_parts(p)[0]).sum())


def piecewise_sum(p: PPoly, q: PPoly) -> PPoly:
    """The sum of two piecewise polynomials over the same angles."""
    edges = np.union1d(p.x, q.x)
    edges = edges[np.append(True, np.diff(edges) > 1e-13)]
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    degree = max(len(p.c), len(q.c)) - 1
    taylor = np.stack([(p(middle, k) + q(middle, k)) / factorial(k) for k in range(degree + 1)])
    shifted = np.zeros_like(taylor)  # from the middles, where neither is ambiguous, to the left edges
    for k in range(degree + 1):
        for m in range(k, degree + 1):
            shifted[k] += comb(m, k) * taylor[m] * (-half) ** (m - k)
    return PPoly(shifted[::-1], edges)


def _largest_by_acceleration(design: Design, p: PPoly) -> float:
    """Integral of the largest p(s) a(s) for accelerations within the limits; infinite where one is missing."""
    parts, middle = _parts(p)
    most = np.inf if design.acceleration_max_mm_per_deg2 is None else design.acceleration_max_mm_per_deg2 * MM_PER_DEG2
    least = (
        -np.inf if design.acceleration_min_mm_per_deg2 is None else design.acceleration_min_mm_per_deg2 * MM_PER_DEG2
    )
    upper = np.where(np.abs(middle) < (design.nose_deg or 0.0) * DEG, 0.0, most)
    push, pull = np.maximum(parts, 0.0), np.minimum(parts, 0.0)
    with np.errstate(invalid="ignore"):  # infinity times zero counts as zero
        return float(np.sum(np.where(push > 0, push * upper, 0.0) + np.where(pull < 0, pull * least, 0.0)))


def area_ratio_bound(design: Design, intervals: int = INTERVALS) -> Certificate:
    """The certificate of a design; its multipliers come from the continuous problem on `intervals` intervals.

    The program's control (jerk, or acceleration without a jerk limit) is constant on each interval, and its limits hold
    at the ends. Raises InputError if even that program has no solution.
    """
    grid = duration_grid(design, intervals)
    if not control_is_limited(design):
        zero = np.zeros(len(grid))
        return Certificate(design, grid, zero, zero, zero, zero, np.zeros(3))  # only the lift cap limits: ratio 1
    return Certificate(design, grid, *DiscretisedControlProblem(design, grid).multipliers())


def control_is_limited(design: Design) -> bool:
    """Whether the jerk is limited or, without a jerk limit, the acceleration in both directions."""
    accelerations = (design.acceleration_max_mm_per_deg2, design.acceleration_min_mm_per_deg2)
    return design.jerk_max_mm_per_deg3 is not None or None not in accelerations


def area_words(lift: Lift, design: Design) -> list[str]:
    """Sentences on a cam's duration, if it is not the design's, and on an area ratio above one or above the bound.

    The ratio is that of the design's duration. The certified bound holds for cams that keep the limits and join the
    ramps exactly, without acceleration; a cam that keeps the limits can only exceed it if it joins the ramps otherwise.
    """
    ratio, words = lift.area_ratio_in(design), []
    if duration := duration_words(lift, design):
        words.append(duration)
    if ratio > 1:
        words.append(
            f"the area ratio of {ratio:.4f} exceeds one: the lift exceeds max_lift_mm = {design.max_lift_mm:g}"
        )
    try:
        bound = area_ratio_bound(design).bound
    except InputError:
        return words  # contradictory limits give no bound
    if bound < ratio <= 1:
        broken = broken_by_shape(lift, design)
        because = (
            f"it breaks {', '.join(broken)}"
            if broken
            else "it keeps the limits, but does not join the ramps as the bound assumes: at their height and velocity "
            "and without acceleration"
        )
        words.append(f"the area ratio of {ratio:.4f} exceeds the certified bound of {bound:.4f}: {because}")
    return words
