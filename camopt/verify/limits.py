"""The limits of a scene's design: those on the cam's shape, judged exactly, and those on the motion."""

from typing import NamedTuple

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.quantities import QUANTITIES
from camopt.scene.schema import Design
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3

ROUNDING = 1e-9
"""Relative slack of a limit on the shape: the rounding of a cam designed to touch its limit."""
STEP_ROUNDING = 1e-6
"""Jump at a border, relative to the largest value, that counts as rounding: solving for the coefficients of high powers
loses a few digits more than evaluating them, and a designed step is orders larger."""

MOTION_LIMITS = {q.limit: q.name for q in QUANTITIES.values() if q.limit is not None}
"""Design key of each limit on the motion -> the metric it limits."""


LEAST_LIMIT = 1e-6
"""Stands in for a limit of zero in its share: a nanometre, in metrics counted in mm."""


class MotionLimit(NamedTuple):
    """The largest value that a metric may have, or the smallest one where less is worse, in the metric's unit."""

    metric: str
    value: float

    @property
    def least(self) -> bool:
        """Whether the metric must not fall below the limit."""
        return QUANTITIES[self.metric].less_is_worse

    def keeps(self, found: float, error: float = 0.0) -> bool:
        """Whether a value keeps the limit even if it is wrong by `error` to the bad side; NaN keeps none."""
        return bool(found - error >= self.value if self.least else found + error <= self.value)

    def breaks(self, found: float, error: float = 0.0) -> bool:
        """Whether a value breaks the limit even if it is wrong by `error` to the good side."""
        return not self.keeps(found, -error)

    def share(self, found: np.ndarray) -> np.ndarray:
        """How much of the limit values use, in their shape: one at the limit, more beyond it, infinite for NaN.

        Value over limit; where less is worse the same distance on the other side, 2 - value over limit, and not below
        zero: in both cases a fifth of the limit is left at 0.8.
        """
        used = found / max(self.value, LEAST_LIMIT)
        return np.nan_to_num(np.maximum(2.0 - used, 0.0) if self.least else used, nan=np.inf)

    @property
    def share_slope(self) -> float:
        """Derivative of the share by the value, in one over the metric's unit."""
        return (-1.0 if self.least else 1.0) / max(self.value, LEAST_LIMIT)


def motion_limits(design: Design | None) -> dict[str, MotionLimit]:
    """Limits on the motion that a scene sets, by design key."""
    if design is None:
        return {}
    given = {key: getattr(design, key) for key in MOTION_LIMITS}
    return {key: MotionLimit(MOTION_LIMITS[key], value) for key, value in given.items() if value is not None}


def limited_metrics(design: Design | None) -> tuple[str, ...]:
    """Bounce, which always counts, and the metrics that a scene limits."""
    return tuple(dict.fromkeys(["bounce_mm", *(limit.metric for limit in motion_limits(design).values())]))


def broken_by_shape(lift: Lift, design: Design | None) -> list[str]:
    """Design keys of the limits that the cam's shape breaks, from the exact extremes of its pieces.

    Limits hold at every angle. A step in velocity breaks the acceleration limits and a step in acceleration the jerk
    limit, from ramp top to ramp top; outside, the ramps are a design condition of their own.
    """
    if design is None:
        return []
    top = design.max_lift_mm * MM
    broken = []
    if lift.max_lift > top * (1 + ROUNDING):
        broken.append("max_lift_mm")
    if design.reach_max_lift and lift.max_lift < top * (1 - ROUNDING):
        broken.append("reach_max_lift")
    lowest, highest = lift.extremes(2)
    kink = _has_step(lift, 1)
    upper, lower, jerk = (
        design.acceleration_max_mm_per_deg2,
        design.acceleration_min_mm_per_deg2,
        design.jerk_max_mm_per_deg3,
    )
    if upper is not None and (kink or highest > upper * MM_PER_DEG2 * (1 + ROUNDING)):
        broken.append("acceleration_max_mm_per_deg2")
    if lower is not None and (kink or lowest < lower * MM_PER_DEG2 * (1 + ROUNDING)):
        broken.append("acceleration_min_mm_per_deg2")
    if jerk is not None:
        steepest = np.abs(lift.extremes(3)).max()
        if kink or _has_step(lift, 2) or steepest > jerk * MM_PER_DEG3 * (1 + ROUNDING):
            broken.append("jerk_max_mm_per_deg3")
    if design.nose_deg:
        nose = design.nose_deg * DEG
        if lift.extremes(2, -nose, nose)[1] > ROUNDING * max(-lowest, highest):
            broken.append("nose_deg")
    return broken


def _has_step(lift: Lift, order: int) -> bool:
    """Whether the derivative `order` jumps at a border of the event, both ramp tops included."""
    largest = np.abs(lift.extremes(order)).max()
    half = lift.half_duration * (1 + 1e-12)
    falling = np.array([np.prod(np.arange(k, k - order, -1)) for k in range(lift.coefficients.shape[1])])
    for i in range(1, len(lift.borders) - 1):
        if abs(lift.borders[i]) > half:
            continue
        powers = np.arange(len(falling)) - order
        width = lift.borders[i] - lift.borders[i - 1]
        before = np.sum((falling * lift.coefficients[i - 1])[order:] * width ** powers[order:])
        after = falling[order] * lift.coefficients[i, order]
        if abs(after - before) > STEP_ROUNDING * largest:
            return True
    return False
