"""What the cam itself reaches of every limit on its shape, those of the drawing included, whether they hold or not."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from camopt.cam.geometry import crossing, smallest_radii
from camopt.cam.lift import Lift
from camopt.cam.linear_limits import linear_limits, radii_held_near
from camopt.scene.design import RADII, Design
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG2, MM_PER_DEG3, MM_PER_DEG4

LABELS = {
    "piston": ("clearance to the piston", "mm"),
    "face_width_mm": ("face width needed", "mm"),
    "lift_at": ("lift at an angle", "mm"),
    "nose_radius_min_mm": ("smallest convex radius", "mm"),
    "concave_radius_min_mm": ("smallest concave radius", "mm"),
    "entrainment_min_m_per_s": ("entrainment velocity", "m/s"),
}
"""Label and unit of a drawing's limits, by their keys."""
DIGITS = 9
"""Decimals of what would be zero but for rounding, and a plus."""
EVERYWHERE = "the cam, at every angle"


def _reached(
    key: str, label: str, unit: str, value: float, limit: float, least: bool = False, where: str = EVERYWHERE
) -> dict[str, Any]:
    keys = "key", "label", "unit", "value", "limit", "least", "where"
    return dict(zip(keys, (key, label, unit, value, limit, least, where), strict=True))


def reached_by_shape(lift: Lift, design: Design) -> Iterator[dict[str, Any]]:
    """What a cam reaches of every limit on its shape that a design sets: `key`, `label` and `unit`, `value` and `limit`
    in that unit, whether less is worse (`least`), and `where` on the cam."""
    yield from _lift_and_ramps(lift, design)
    lowest, highest = (value / MM_PER_DEG2 for value in lift.extremes(2))
    half, nose = lift.half_duration, (design.nose_deg or 0.0) * DEG
    if (most := design.acceleration_max_mm_per_deg2) is not None:
        yield _reached("acceleration_max_mm_per_deg2", "acceleration max", "mm/deg²", highest, most)
    if (least := design.acceleration_min_mm_per_deg2) is not None:
        yield _reached("acceleration_min_mm_per_deg2", "acceleration min", "mm/deg²", lowest, least, least=True)
    if (most := design.jerk_max_mm_per_deg3) is not None:
        jerk = float(np.abs(lift.extremes(3)).max()) / MM_PER_DEG3
        yield _reached("jerk_max_mm_per_deg3", "jerk max", "mm/deg³", jerk, most)
    if (most := design.snap_max_mm_per_deg4) is not None:
        snap = float(np.abs(lift.extremes(4, -half, half)).max()) / MM_PER_DEG4
        yield _reached("snap_max_mm_per_deg4", "snap max", "mm/deg⁴", snap, most, where="between the ramps")
    if nose:
        most = round(lift.extremes(2, -nose, nose)[1] / MM_PER_DEG2, DIGITS) + 0.0
        label, where = "acceleration at the nose", f"within {design.nose_deg:g} deg of the nose"
        yield _reached("nose_deg", label, "mm/deg²", most, 0.0, where=where)
    yield from _drawn(lift, design)


def _lift_and_ramps(lift: Lift, design: Design) -> Iterator[dict[str, Any]]:
    top, half = lift.max_lift / MM, design.duration_deg / 2 * DEG
    yield _reached("max_lift_mm", "largest lift", "mm", top, design.max_lift_mm, where="the nose")
    if design.reach_max_lift:
        yield _reached("reach_max_lift", "lift to be reached", "mm", top, design.max_lift_mm, True, "the nose")
    duration = 2 * lift.half_duration / DEG
    yield _reached("duration_deg", "duration", "deg", duration, design.duration_deg, where="between the ramps")
    for sign, (_, velocity, side) in zip((-1, 1), design.ramps(), strict=True):
        own = side == "closing" and design.closing_ramp_velocity_mm_per_deg is not None
        rate = float(np.abs(lift.extremes(1, *sorted((sign * half, sign * np.pi)))).max()) / MM_PER_DEG
        key = "closing_" * own + "ramp_velocity_mm_per_deg"
        yield _reached(key, f"{side} ramp velocity", "mm/deg", rate, velocity, where=f"the {side} ramp")


def _drawn(lift: Lift, design: Design) -> Iterator[dict[str, Any]]:
    """The limits of a drawing: those that are linear, the durations at a lift, the radii under a roller or pad."""
    by_name: dict[str, dict[str, Any]] = {}
    for linear in linear_limits(design):
        if linear.chosen:
            continue
        label, unit = LABELS[linear.key]
        value, least = linear.value + linear.rate * linear.excess(lift), linear.rate < 0
        one = _reached(linear.key, label, unit, value, linear.value, least, _where(linear.key, linear.name))
        before = by_name.get(linear.name)
        worse = before is None or (value < before["value"] if least else value > before["value"])
        by_name |= {linear.name: one} if worse else {}  # the two flanks need a face of one width
    yield from by_name.values()
    for height, least_deg, most_deg in design.duration_at:
        opening, closing = crossing(lift, height * MM) if height * MM < lift.max_lift else (0.0, 0.0)
        long = (closing - opening) / DEG
        for bound, is_least in ((least_deg, True), (most_deg, False)):
            yield _reached("duration_at", f"duration at {height:g} mm", "deg", long, bound, is_least, "the crossings")
    radii, geometry = radii_held_near(design), design.geometry
    if radii and geometry is not None:
        for key, size in zip(RADII, smallest_radii(lift, geometry), strict=True):
            if key in radii and size is not None:
                yield _reached(key, *LABELS[key], size / MM, getattr(design, key), least=True)


def _where(key: str, name: str) -> str:
    return name.partition(" at ")[2] and f"at {name.partition(' at ')[2]}" if key == "lift_at" else EVERYWHERE
