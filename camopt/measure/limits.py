"""The limits of a scene's design: those on the cam's shape and those on the motion.

Limits on the shape are judged from the exact extremes of the cam's polynomial pieces. Limits on the motion are judged
by whoever computes a motion; here stands what each of them limits, and when a value keeps or breaks it.
"""

from typing import NamedTuple

import numpy as np

from camopt.cam.geometry import crossing, sign_changes, smallest_radii
from camopt.cam.lift import Lift
from camopt.cam.linear_limits import linear_limits, radii_held_near
from camopt.measure.rounded import RAMP_VELOCITY, rows_of, violated_beyond_rounding
from camopt.scene.design import RADII, REACH, ROUNDING, Design
from camopt.scene.errors import InputError
from camopt.scene.quantities import QUANTITIES
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG2, MM_PER_DEG3, MM_PER_DEG4

SAMPLED = 1e-6
"""Relative slack of radii under a roller or pad, whose extremes are looked for between samples."""
STEP_ROUNDING = 1e-6
"""A jump at a border that is no larger than this share of the largest value counts as rounding. Solving for the
coefficients of high powers loses a few digits more than evaluating them, and a designed step is orders larger."""
RAMP_LIFT = 1e-6
"""Lift above the ramp's height that counts as none [m]. One micrometre is what an ordinary ramp rises in a tenth of a
degree, and about what a lift table is measured to."""
MOTION_LIMITS = {q.limit: q.name for q in QUANTITIES.values() if q.limit is not None}
"""The metric that each limit on the motion limits, by the limit's key in the design."""
LEAST_LIMIT = 1e-6
"""The least divisor of a share, in the metric's unit. It stands in for a limit of zero, and is a nanometre in mm."""


class MotionLimit(NamedTuple):
    """The largest value that a metric may have or, where less is worse, the smallest one.

    Limit, values and errors are all in the metric's own unit, which its name states.
    """

    metric: str
    value: float

    @property
    def least(self) -> bool:
        """Whether this is the smallest value that the metric may have."""
        return QUANTITIES[self.metric].less_is_worse

    def keeps(self, found: float, error: float = 0.0) -> bool:
        """Whether the value `found` keeps the limit even if it is wrong by `error` to the bad side. NaN keeps none."""
        return bool(found - error >= self.value if self.least else found + error <= self.value)

    def breaks(self, found: float, error: float = 0.0) -> bool:
        """Whether the value `found` breaks the limit even if it is wrong by `error` to the good side. NaN breaks it."""
        return not self.keeps(found, -error)

    def share(self, found: np.ndarray) -> np.ndarray:
        """How much of the limit each of the values `found` uses, as an array of their shape.

        A share is one at the limit and more beyond it. It is the value over the limit or, where less is worse, two less
        that ratio and at least zero, so that in both cases a fifth of the limit is left at 0.8. NaN uses infinitely
        much.
        """
        used = found / max(self.value, LEAST_LIMIT)
        return np.nan_to_num(np.maximum(2.0 - used, 0.0) if self.least else used, nan=np.inf)

    @property
    def share_slope(self) -> float:
        """Derivative of the share by the value, per unit of the metric."""
        return (-1.0 if self.least else 1.0) / max(self.value, LEAST_LIMIT)


def motion_limits(design: Design | None) -> dict[str, MotionLimit]:
    """The limits on the motion that a design sets, by their keys in it; none where there is no design."""
    if design is None:
        return {}
    given = {key: getattr(design, key) for key in MOTION_LIMITS}
    return {key: MotionLimit(MOTION_LIMITS[key], value) for key, value in given.items() if value is not None}


def limited_metrics(design: Design | None) -> tuple[str, ...]:
    """The names of bounce, which always counts, and of the other metrics that a design limits."""
    return tuple(dict.fromkeys(["bounce_mm", *(limit.metric for limit in motion_limits(design).values())]))


def broken_by_shape(lift: Lift, design: Design | None) -> list[str]:
    """The names of the limits that the cam's shape breaks; none where there is no design.

    They are keys of the design, and "continuous_lift" and "continuous_velocity", which no scene has to ask for. Every
    limit holds at every angle, as the exact extremes of the cam's pieces show. A step in velocity breaks the limits on
    the acceleration too, and a step in acceleration that on the jerk. The one exception is the outer end of a ramp to
    which the scene gives no foot. The limit on the snap counts between the ramps, at whose ends every cam's jerk steps.
    `_outside` says what is asked of the duration and the ramps. Of a cam that a rounded table gives, those limits are
    named that no cam within the rounding keeps (`camopt.measure.rounded`).
    """
    return [] if design is None else list(shape_excess(lift, design))


def shape_excess(lift: Lift, design: Design) -> dict[str, float]:
    """By how much a cam breaks the limits of `broken_by_shape`, relative to each; 1 for a step and for a limit without
    a size."""
    over = dict.fromkeys(_outside(lift, design), 1.0)

    def note(name: str, value: float, limit: float, stepped: bool = False, rounding: float = ROUNDING) -> None:
        relative = value / limit - 1
        if stepped or relative > rounding:
            over[name] = relative if relative > 0 else 1.0

    top, (lowest, highest) = design.max_lift_mm * MM, lift.extremes(2)
    note("max_lift_mm", lift.max_lift, top)
    if design.reach_max_lift:
        note("reach_max_lift", 2 * top - lift.max_lift, top, rounding=REACH)
    torn, kink, bend = (_has_step(lift, design, order) for order in range(3))
    kink = kink or torn
    over |= dict.fromkeys(["continuous_lift"] * torn + ["continuous_velocity"] * kink, 1.0)
    if (upper := design.acceleration_max_mm_per_deg2) is not None:
        note("acceleration_max_mm_per_deg2", highest, upper * MM_PER_DEG2, kink)
    if (lower := design.acceleration_min_mm_per_deg2) is not None:
        note("acceleration_min_mm_per_deg2", lowest, lower * MM_PER_DEG2, kink)
    if (jerk := design.jerk_max_mm_per_deg3) is not None:
        note("jerk_max_mm_per_deg3", float(np.abs(lift.extremes(3)).max()), jerk * MM_PER_DEG3, kink or bend)
    if (snap := design.snap_max_mm_per_deg4) is not None:
        half = lift.half_duration
        stepped = kink or bend or _has_step(lift, design, 3, within=half)
        note("snap_max_mm_per_deg4", float(np.abs(lift.extremes(4, -half, half)).max()), snap * MM_PER_DEG4, stepped)
    if design.nose_deg:
        nose = design.nose_deg * DEG
        if lift.extremes(2, -nose, nose)[1] > ROUNDING * max(-lowest, highest):
            over["nose_deg"] = 1.0
    if design.waves_max is not None:
        note("waves_max", len(sign_changes(lift)), design.waves_max)
    over |= {key: excess for key, excess in drawing_excess(lift, design).items() if excess > ROUNDING}
    rows = rows_of(lift)
    return over if rows is None else {key: over[key] for key in violated_beyond_rounding([*over], rows, design)}


def drawing_excess(lift: Lift, design: Design) -> dict[str, float]:
    """By how much a cam exceeds each limit of `linear_limits`, by key and relative to the limit's size.

    It is negative where the limit is kept. A duration at a lift lies between the outermost angles at which the cam has
    that lift, and is zero where it never does; its excess is relative to the scene's duration.
    """
    found: dict[str, float] = {}
    for limit in linear_limits(design):
        if not limit.chosen:
            over = limit.excess(lift) / limit.size
            found[limit.key] = max(over, found.get(limit.key, -np.inf))
    for height, least, most in design.duration_at:
        opening, closing = crossing(lift, height * MM) if height * MM < lift.max_lift else (0.0, 0.0)
        long = (closing - opening) / DEG
        over = max(least - long, long - most) / design.duration_deg
        found["duration_at"] = max(over, found.get("duration_at", -np.inf))
    return found | _of_a_circle(lift, design)


def _of_a_circle(lift: Lift, design: Design) -> dict[str, float]:
    """By how much the cam's radii under a roller or pad are too small, relative to the limits.

    Infinite for a cam that the follower cannot follow.
    """
    asked, geometry = radii_held_near(design), design.geometry
    if not asked or geometry is None:
        return {}
    try:
        radii: dict[str, float | None] = dict(zip(RADII, smallest_radii(lift, geometry), strict=True))
    except InputError:
        return dict.fromkeys(asked, np.inf)
    sizes = {key: np.inf if (size := radii[key]) is None else size for key in asked}
    return {key: 1 - size / (getattr(design, key) * MM) - SAMPLED for key, size in sizes.items()}


def duration_words(lift: Lift, design: Design) -> str:
    """A sentence on a cam whose duration differs from the scene's, or an empty text where the two agree.

    A shorter cam is legal, and its area ratio is judged with the scene's duration. A longer one breaks "duration_deg";
    where its lift shows that, the sentence names the angle and the lift there.
    """
    asked, own = design.duration_deg, 2 * lift.half_duration / DEG
    half = min(asked, own) / 2 * DEG
    sides = zip((-1, 1), design.ramps(), strict=True)
    found = [(sign * half / DEG, _above(lift, sign, half) / MM, height) for sign, (height, _, _) in sides]
    angle, above, height = max(found, key=lambda row: row[1] - row[2])
    if above > height + RAMP_LIFT / MM:
        return (
            f"the cam is longer than the {asked:g} deg of the scene: the lift beyond {angle:g} deg reaches "
            f"{above:.4g} mm, and {height:g} mm is the ramp's height, which it may exceed by {RAMP_LIFT / MM:g} mm"
        )
    if own > asked * (1 + ROUNDING):
        return f"the cam's stated duration of {own:.6g} deg is longer than the {asked:g} deg of the scene"
    if own < asked * (1 - ROUNDING):
        return (
            f"the cam's duration of {own:.6g} deg is shorter than the {asked:g} deg of the scene, with which its area "
            f"ratio is judged"
        )
    return ""


def _outside(lift: Lift, design: Design) -> list[str]:
    """The names of the limits that the cam breaks where the ramps lie.

    It breaks "duration_deg" where it says itself that it is longer than the scene asks, or where its lift exceeds the
    ramp's height by more than RAMP_LIFT outside the shorter one of its own duration and the scene's. It breaks
    "ramp_velocity_mm_per_deg", or the closing side's key, where its velocity exceeds the ramp's by more than
    RAMP_VELOCITY outside the scene's duration. Lower, shorter and slower ramps are legal, because the motion answers
    for them.
    """
    broken, asked = [], design.duration_deg / 2 * DEG
    inner = min(asked, lift.half_duration)
    longer = lift.half_duration > asked * (1 + ROUNDING)
    for sign, (height, velocity, side) in zip((-1, 1), design.ramps(), strict=True):
        longer |= _above(lift, sign, inner) > height * MM + RAMP_LIFT
        rate = np.abs(lift.extremes(1, *sorted((sign * asked, sign * np.pi)))).max()
        key = "closing_" * (side == "closing" and design.closing_ramp_velocity_mm_per_deg is not None)
        if rate > velocity * MM_PER_DEG * (1 + RAMP_VELOCITY):
            broken.append(f"{key}ramp_velocity_mm_per_deg")
    return list(dict.fromkeys(["duration_deg"] * longer + broken))


def _above(lift: Lift, sign: int, half: float) -> float:
    """The largest lift [m] at the angles from sign * half [rad] outwards, to the end of the revolution."""
    return lift.extremes(0, *sorted((sign * half, sign * np.pi)))[1]


def _has_step(lift: Lift, design: Design, order: int, within: float = np.inf) -> bool:
    """Whether the derivative `order` jumps anywhere, as `steps_at` says."""
    return len(steps_at(lift, design, order, within)) > 0


def steps_at(lift: Lift, design: Design, order: int, within: float = np.inf) -> Float[np.ndarray, " k"]:
    """The angles [rad] of the borders of pieces, nearer to the nose than `within`, at which a derivative jumps.

    Without such a limit the ends of the revolution are included.

    Where the scene's ramps have no foot, the velocity may jump by that of the ramp as the lift leaves and meets zero.
    """
    ends = np.stack([lift.borders[:-1], lift.borders[1:]])
    after, before = lift.of_piece(np.arange(len(lift.coefficients)), ends, order)
    steps = np.abs(after - np.roll(before, 1))  # at the start of every piece
    allowed = np.full(len(steps), STEP_ROUNDING * np.abs(lift.extremes(order)).max())
    if order == 1 and design.ramp_foot_deg == 0:
        flat = np.all(lift.coefficients == 0, axis=1)
        fastest = max(velocity for _, velocity, _ in design.ramps()) * MM_PER_DEG
        allowed += np.where(flat != np.roll(flat, 1), fastest * (1 + RAMP_VELOCITY), 0.0)
    inner = np.abs(lift.borders[:-1]) < within * (1 - ROUNDING)
    return lift.borders[:-1][inner & (steps > allowed)]


def steepest_jerk(lift: Lift, design: Design) -> float:
    """The largest jerk [m/rad^3] of a cam; infinite where velocity or acceleration jumps, but by a table's rounding."""
    stepped = rows_of(lift) is None and any(_has_step(lift, design, order) for order in (1, 2))
    return np.inf if stepped else float(np.abs(lift.extremes(3)).max())
