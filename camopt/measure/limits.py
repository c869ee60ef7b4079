"""The limits of a scene's design: those on the cam's shape and those on the motion.

Limits on the shape are judged from the exact extremes of the cam's polynomial pieces. For limits on the motion, this
file defines which metric each of them limits and when a value keeps or breaks it.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
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
"""Relative slack of radii under a roller or pad, whose extremes are searched for between samples."""
STEP_ROUNDING = 1e-6
"""Largest jump at a border that counts as rounding, relative to the largest value; designed steps are far larger."""
RAMP_LIFT = 1e-6
"""Lift [m] by which a cam may exceed the ramp's height: about the accuracy of a measured lift table."""
EVERYWHERE = "the cam, at every angle"
DECIMALS = 9
"""Decimals to which a value that is zero except for rounding is rounded."""
MOTION_LIMITS = {q.limit: q.name for q in QUANTITIES.values() if q.limit is not None}
"""Limited metric by the limit's key in the design, for limits on the motion."""
LEAST_LIMIT = 1e-6
"""Smallest divisor of a share, in the metric's unit, in place of a limit of zero; a nanometre for a length in mm."""


class MotionLimit(NamedTuple):
    """The largest value that a metric may have or, for a metric of which less is worse, the smallest one.

    Limit, values and errors are in the metric's unit, which is part of its name.
    """

    metric: str
    value: float

    @property
    def least(self) -> bool:
        """Whether this is the smallest value that the metric may have."""
        return QUANTITIES[self.metric].less_is_worse

    def keeps(self, value: float, error: float = 0.0) -> bool:
        """Whether a value, made worse by `error`, keeps the limit. NaN does not keep it."""
        return bool(value - error >= self.value if self.least else value + error <= self.value)

    def breaks(self, value: float, error: float = 0.0) -> bool:
        """Whether a value, made better by `error`, breaks the limit. NaN breaks it."""
        return not self.keeps(value, -error)

    def share(self, values: np.ndarray) -> np.ndarray:
        """Usage of the limit by each of the values, as an array of their shape: one at the limit.

        It is the value divided by the limit or, if less is worse, two minus that ratio and at least zero, so that in
        both cases 0.8 means a margin of a fifth of the limit. NaN has an infinite usage.
        """
        used = values / max(self.value, LEAST_LIMIT)
        return np.nan_to_num(np.maximum(2.0 - used, 0.0) if self.least else used, nan=np.inf)

    @property
    def share_slope(self) -> float:
        """Derivative of the share with respect to the value, per unit of the metric."""
        return (-1.0 if self.least else 1.0) / max(self.value, LEAST_LIMIT)


def motion_limits(design: Design | None) -> dict[str, MotionLimit]:
    """The limits on the motion that a design sets, by their keys in it; empty without a design."""
    if design is None:
        return {}
    values = {key: getattr(design, key) for key in MOTION_LIMITS}
    return {key: MotionLimit(MOTION_LIMITS[key], value) for key, value in values.items() if value is not None}


def limited_metrics(design: Design | None) -> tuple[str, ...]:
    """Names of the metrics that a design limits, bounce first, which is always included."""
    return tuple(dict.fromkeys(["bounce_mm", *(limit.metric for limit in motion_limits(design).values())]))


def broken_by_shape(lift: Lift, design: Design | None) -> list[str]:
    """The names of the limits that the cam's shape breaks; empty without a design.

    They are keys of the design, and "continuous_lift" and "continuous_velocity", which apply to every scene. A limit
    applies at every angle. A step in velocity also breaks the limits on the acceleration, and a step in acceleration
    breaks the limit on the jerk, except at the outer end of a ramp without a foot in the scene. The limit on the snap
    applies between the ramps only, because every cam's jerk steps at their ends. `_ramp_rows` defines the limits on the
    duration and the ramps. For a cam given by a rounded table, only those limits are named that no cam within the
    rounding keeps (`camopt.measure.rounded`).
    """
    return [] if design is None else list(shape_excess(lift, design))


def shape_excess(lift: Lift, design: Design) -> dict[str, float]:
    """Relative excess over each of the limits of `broken_by_shape`; 1 or more for a step, 1 if a limit is zero."""
    over = _largest(row for row in reached_by_shape(lift, design) if row.excess > row.slack)
    rows = rows_of(lift)
    return over if rows is None else {key: over[key] for key in violated_beyond_rounding([*over], rows, design)}


def drawing_excess(lift: Lift, design: Design) -> dict[str, float]:
    """Relative excess of a cam over each limit of the drawing, by key; negative if the limit is kept."""
    return _largest(_drawing_rows(lift, design))


def _largest(rows: Iterable["LimitRow"]) -> dict[str, float]:
    """The largest excess of the rows, by key."""
    largest: dict[str, float] = {}
    for row in rows:
        largest[row.key] = max(row.excess, largest.get(row.key, -np.inf))
    return largest


class LimitRow(NamedTuple):
    """The value that a cam reaches for one limit on its shape; it is not finite if there is no value to show."""

    key: str
    value: float  # in the key's unit, like the limit
    limit: float
    excess: float  # over the limit, relative to its size; the limit is broken if it is larger than the slack
    least: bool = False  # whether less is worse
    where: str = EVERYWHERE
    slack: float = ROUNDING
    label: str = ""  # if a key has several rows


def reached_by_shape(lift: Lift, design: Design) -> Iterator[LimitRow]:
    """The rows of all limits on its shape that a design sets, and one for every discontinuity of a cam."""

    def of(key: str, value: float, unit: float, where: str = EVERYWHERE, stepped: bool = False) -> Iterator[LimitRow]:
        """The row of a limit, if the design sets it, for a value in SI units."""
        if (limit := getattr(design, key)) is not None:
            excess = value / (limit * unit) - 1
            excess = max(excess, 1.0) if stepped else excess
            yield LimitRow(key, value / unit, limit, excess, limit < 0, where)

    half, top = lift.half_duration, design.max_lift_mm * MM
    yield from _ramp_rows(lift, design)
    yield from of("max_lift_mm", lift.max_lift, MM, "the nose")
    if design.reach_max_lift:
        short = (2 * top - lift.max_lift) / top - 1
        yield LimitRow("reach_max_lift", lift.max_lift / MM, design.max_lift_mm, short, True, "the nose", REACH)
    torn, kink, bend = (len(steps_at(lift, design, order)) > 0 for order in range(3))
    kink = kink or torn
    for key in ["continuous_lift"] * torn + ["continuous_velocity"] * kink:
        yield LimitRow(key, np.inf, 0.0, 1.0)
    lowest, highest = lift.extremes(2)
    yield from of("acceleration_max_mm_per_deg2", highest, MM_PER_DEG2, stepped=kink)
    yield from of("acceleration_min_mm_per_deg2", lowest, MM_PER_DEG2, stepped=kink)
    yield from of("jerk_max_mm_per_deg3", float(np.abs(lift.extremes(3)).max()), MM_PER_DEG3, stepped=kink or bend)
    if design.snap_max_mm_per_deg4 is not None:
        snap = float(np.abs(lift.extremes(4, -half, half)).max())
        stepped = kink or bend or len(steps_at(lift, design, 3, within=half)) > 0
        yield from of("snap_max_mm_per_deg4", snap, MM_PER_DEG4, "between the ramps", stepped)
    if nose := (design.nose_deg or 0.0) * DEG:
        most = lift.extremes(2, -nose, nose)[1]
        positive = 1.0 if most > ROUNDING * max(-lowest, highest) else 0.0
        shown, where = round(most / MM_PER_DEG2, DECIMALS) + 0.0, f"within {design.nose_deg:g} deg of the nose"
        yield LimitRow("nose_deg", shown, 0.0, positive, where=where)
    if design.waves_max is not None:
        yield from of("waves_max", float(len(sign_changes(lift))), 1.0, "between the ramps")
    yield from _drawing_rows(lift, design)


def _drawing_rows(lift: Lift, design: Design) -> Iterator[LimitRow]:
    """The rows of the limits of `linear_limits`, each at the worse flank, of durations at a lift, and of radii.

    A duration at a lift is the distance of the outermost angles at which the cam has that lift, and zero if there are
    none; its excess is relative to the scene's duration.
    """
    worst: dict[str, LimitRow] = {}
    for limit in (limit for limit in linear_limits(design) if not limit.chosen):
        over, least = limit.excess(lift), limit.rate < 0
        at = limit.name.partition(" at ")[2]
        where = f"at {at}" if limit.key == "lift_at" and at else EVERYWHERE
        row = LimitRow(limit.key, limit.value + limit.rate * over, limit.value, over / limit.size, least, where)
        if limit.name not in worst or row.excess > worst[limit.name].excess:
            worst[limit.name] = row
    yield from worst.values()
    for height, least_deg, most_deg in design.duration_at:
        opening, closing = crossing(lift, height * MM) if height * MM < lift.max_lift else (0.0, 0.0)
        long, label = (closing - opening) / DEG, f"duration at {height:g} mm"
        for limit, sign in ((least_deg, -1), (most_deg, 1)):
            excess = sign * (long - limit) / design.duration_deg
            yield LimitRow("duration_at", long, limit, excess, sign < 0, "the crossings", label=label)
    yield from _radius_rows(lift, design)


def _radius_rows(lift: Lift, design: Design) -> Iterator[LimitRow]:
    """The rows of the radii under a roller or pad; a radius is minus infinity if the follower cannot follow the cam."""
    keys, geometry = radii_held_near(design), design.geometry
    if not keys or geometry is None:
        return
    radii: dict[str, float | None] = dict.fromkeys(RADII, -np.inf)
    with suppress(InputError):
        radii = dict(zip(RADII, smallest_radii(lift, geometry), strict=True))
    for key in keys:
        limit, size = getattr(design, key), radii[key]
        size = np.inf if size is None else size
        yield LimitRow(key, size / MM, limit, 1 - size / (limit * MM) - SAMPLED, True)


def duration_words(lift: Lift, design: Design) -> str:
    """A sentence on a cam whose duration differs from the scene's, or an empty text if the two agree.

    A shorter cam is legal, and its area ratio is computed with the scene's duration. A longer one breaks
    "duration_deg"; if its lift shows that, the sentence names the angle and the lift there.
    """
    scene_deg, cam_deg = design.duration_deg, 2 * lift.half_duration / DEG
    angle, above, height = _lift_beyond(lift, design)
    if above > height + RAMP_LIFT / MM:
        return (
            f"the cam is longer than the {scene_deg:g} deg of the scene: the lift beyond {angle:g} deg reaches "
            f"{above:.4g} mm, and {height:g} mm is the ramp's height, which it may exceed by {RAMP_LIFT / MM:g} mm"
        )
    if cam_deg > scene_deg * (1 + ROUNDING):
        return f"the cam's stated duration of {cam_deg:.6g} deg is longer than the {scene_deg:g} deg of the scene"
    if cam_deg < scene_deg * (1 - ROUNDING):
        return (
            f"the cam's duration of {cam_deg:.6g} deg is shorter than the {scene_deg:g} deg of the scene, with which "
            f"its area ratio is judged"
        )
    return ""


def _ramp_rows(lift: Lift, design: Design) -> Iterator[LimitRow]:
    """The rows of the limits on the duration and on the velocity of the ramps.

    A cam breaks "duration_deg" if its stated duration is longer than the scene's, or if its lift exceeds the ramp's
    height by more than RAMP_LIFT outside the shorter one of both durations. It breaks "ramp_velocity_mm_per_deg", or
    the closing side's key, if its velocity exceeds the ramp's by more than RAMP_VELOCITY outside the scene's duration.
    Lower, shorter and slower ramps are legal.
    """
    sides, half = [], design.duration_deg / 2 * DEG
    _, above, height = _lift_beyond(lift, design)
    longer = lift.half_duration > half * (1 + ROUNDING) or above > height + RAMP_LIFT / MM
    for sign, (_, velocity, side) in zip((-1, 1), design.ramps(), strict=True):
        rate = float(np.abs(lift.extremes(1, *sorted((sign * half, sign * np.pi)))).max())
        key = "closing_" * (side == "closing" and design.closing_ramp_velocity_mm_per_deg is not None)
        over = 1.0 if rate > velocity * MM_PER_DEG * (1 + RAMP_VELOCITY) else 0.0
        row = LimitRow(f"{key}ramp_velocity_mm_per_deg", rate / MM_PER_DEG, velocity, over, where=f"the {side} ramp")
        sides.append(row._replace(label=f"{side} ramp velocity"))
    cam_deg = 2 * lift.half_duration / DEG
    yield LimitRow("duration_deg", cam_deg, design.duration_deg, 1.0 if longer else 0.0, where="between the ramps")
    yield from sides


def _lift_beyond(lift: Lift, design: Design) -> tuple[float, float, float]:
    """End of the shorter one of the cam's and the scene's duration [deg], largest lift beyond it [mm] and the ramp's
    height [mm], on the side where the lift exceeds this height more."""
    half, at_sides = min(design.duration_deg / 2 * DEG, lift.half_duration), []
    for sign, (height, _, _) in zip((-1, 1), design.ramps(), strict=True):
        highest = lift.extremes(0, *sorted((sign * half, sign * np.pi)))[1]
        at_sides.append((sign * half / DEG, highest / MM, height))
    return max(at_sides, key=lambda row: row[1] - row[2])


def steps_at(lift: Lift, design: Design, order: int, within: float = np.inf) -> Float[np.ndarray, " k"]:
    """The angles [rad] of the borders of pieces, nearer to the nose than `within`, at which a derivative jumps.

    If the scene's ramps have no foot, the velocity may jump by that of the ramp where the lift leaves and reaches zero.
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
    """The largest jerk [m/rad^3] of a cam; infinite if velocity or acceleration jumps, except in a rounded table."""
    stepped = rows_of(lift) is None and any(len(steps_at(lift, design, order)) for order in (1, 2))
    return np.inf if stepped else float(np.abs(lift.extremes(3)).max())
