"""The scene's limits against what the run folder says was reached: held, broken, or not known, and the share used."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from camopt.cam.geometry import crossing, smallest_radii
from camopt.cam.lift import Lift
from camopt.cam.linear_limits import linear_limits, radii_held_near
from camopt.measure.limits import broken_by_shape
from camopt.plots.style import DESIGN, family_of
from camopt.report.folder import RunFolder
from camopt.report.wording import as_number, label_and_unit, shown
from camopt.scene.design import RADII, ROUNDING, Design
from camopt.scene.quantities import LESS_IS_WORSE, QUANTITIES, is_number
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG2, MM_PER_DEG3, MM_PER_DEG4
from camopt.verifier.record import worst_case_value
from camopt.verifier.verdict import ORDER

STATED = "verification.json"
CAM_LIMITS = ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3")
BROKEN = "verification.json broken"
OF_MOTION = {quantity.limit: quantity for quantity in QUANTITIES.values() if quantity.limit}
"""The quantities that a design may limit, by the limit's key."""
EVERYWHERE = "the cam, at every angle"

LABELS = {
    "max_lift_mm": ("largest lift", "mm"),
    "reach_max_lift": ("lift to be reached", "mm"),
    "duration_deg": ("duration", "deg"),
    "acceleration_max_mm_per_deg2": ("acceleration max", "mm/deg²"),
    "acceleration_min_mm_per_deg2": ("acceleration min", "mm/deg²"),
    "jerk_max_mm_per_deg3": ("jerk max", "mm/deg³"),
    "snap_max_mm_per_deg4": ("snap max", "mm/deg⁴"),
    "nose_deg": ("acceleration at the nose", "mm/deg²"),
    "piston": ("clearance to the piston", "mm"),
    "face_width_mm": ("face width needed", "mm"),
    "lift_at": ("lift at an angle", "mm"),
    "nose_radius_min_mm": ("smallest convex radius", "mm"),
    "concave_radius_min_mm": ("smallest concave radius", "mm"),
    "entrainment_min_m_per_s": ("entrainment velocity", "m/s"),
}
"""Label and unit of what a cam's shape reaches, by the limits' keys."""
DIGITS = 9
"""Decimals of what would be zero but for rounding, and a plus."""


def reached_by_shape(lift: Lift, design: Design) -> Iterator[dict[str, Any]]:
    """What a cam reaches of every limit on its shape that a design sets: `key`, `label` and `unit`, `value` and `limit`
    in that unit, whether less is worse (`least`), and `where` on the cam."""

    def reached(key: str, value: float, limit: float, least: bool = False, where: str = EVERYWHERE) -> dict[str, Any]:
        words = {} if key not in LABELS else dict(zip(("label", "unit"), LABELS[key], strict=True))
        return words | {"key": key, "value": value, "limit": limit, "least": least, "where": where}

    top, half, outside = lift.max_lift / MM, lift.half_duration, design.duration_deg / 2 * DEG
    yield reached("max_lift_mm", top, design.max_lift_mm, where="the nose")
    if design.reach_max_lift:
        yield reached("reach_max_lift", top, design.max_lift_mm, True, "the nose")
    yield reached("duration_deg", 2 * half / DEG, design.duration_deg, where="between the ramps")
    for sign, (_, velocity, side) in zip((-1, 1), design.ramps(), strict=True):
        own = side == "closing" and design.closing_ramp_velocity_mm_per_deg is not None
        rate = float(np.abs(lift.extremes(1, *sorted((sign * outside, sign * np.pi)))).max()) / MM_PER_DEG
        row = reached("closing_" * own + "ramp_velocity_mm_per_deg", rate, velocity, where=f"the {side} ramp")
        yield row | {"label": f"{side} ramp velocity", "unit": "mm/deg"}
    lowest, highest = (value / MM_PER_DEG2 for value in lift.extremes(2))
    jerk = float(np.abs(lift.extremes(3)).max()) / MM_PER_DEG3
    snap = float(np.abs(lift.extremes(4, -half, half)).max()) / MM_PER_DEG4
    for key, value, where in (
        ("acceleration_max_mm_per_deg2", highest, EVERYWHERE),
        ("acceleration_min_mm_per_deg2", lowest, EVERYWHERE),
        ("jerk_max_mm_per_deg3", jerk, EVERYWHERE),
        ("snap_max_mm_per_deg4", snap, "between the ramps"),
    ):
        if (limit := getattr(design, key)) is not None:
            yield reached(key, value, limit, key == "acceleration_min_mm_per_deg2", where)
    if nose := (design.nose_deg or 0.0) * DEG:
        most = round(lift.extremes(2, -nose, nose)[1] / MM_PER_DEG2, DIGITS) + 0.0
        yield reached("nose_deg", most, 0.0, where=f"within {design.nose_deg:g} deg of the nose")
    yield from _linear(lift, design, reached)
    for height, least_deg, most_deg in design.duration_at:
        opening, closing = crossing(lift, height * MM) if height * MM < lift.max_lift else (0.0, 0.0)
        for limit, least in ((least_deg, True), (most_deg, False)):
            row = reached("duration_at", (closing - opening) / DEG, limit, least, "the crossings")
            yield row | {"label": f"duration at {height:g} mm", "unit": "deg"}
    radii, geometry = radii_held_near(design), design.geometry
    if radii and geometry is not None:
        for key, size in zip(RADII, smallest_radii(lift, geometry), strict=True):
            if key in radii and size is not None:
                yield reached(key, size / MM, getattr(design, key), True)


def _linear(lift: Lift, design: Design, reached: Callable[..., dict[str, Any]]) -> Iterable[dict[str, Any]]:
    """The limits of a drawing that are linear in the lift, each at the flank where it is worse."""
    by_name: dict[str, dict[str, Any]] = {}
    for linear in linear_limits(design):
        if linear.chosen:
            continue
        value, least = linear.value + linear.rate * linear.excess(lift), linear.rate < 0
        at = linear.name.partition(" at ")[2]
        one = reached(
            linear.key, value, linear.value, least, f"at {at}" if linear.key == "lift_at" and at else EVERYWHERE
        )
        before = by_name.get(linear.name)
        if before is None or (value < before["value"] if least else value > before["value"]):
            by_name[linear.name] = one
    return by_name.values()


def limit_rows(run: RunFolder, shape: tuple[Lift, Design] | None = None) -> list[dict]:
    """A row per limit of the scene's design, and per other condition that the verdict found broken: what was reached,
    where, whether that holds (`held`, None where it is not known), and where it is recorded.

    `shape` is the run's cam with the design that it is held to: with it every limit on the shape has a row, too.
    """
    design, named = run.demands, _broken(run)
    rows = [_cam_row(run, key, design[key]) for key in CAM_LIMITS if is_number(design.get(key))]
    if shape is not None:
        rows = [row for row in rows if row["held"] is not None]
        recorded, broken = {row["key"] for row in rows}, {*broken_by_shape(*shape), *named}
        for one in (one for one in reached_by_shape(*shape) if one["key"] not in recorded):
            row = _row(one["key"], one["limit"], one["least"], one["value"], one["where"], "design.json pieces")
            # every row of a limit that is broken is: it holds at both flanks and in every window, or it does not hold
            rows.append(row | {"label": one["label"], "unit": one["unit"], "held": one["key"] not in broken})
    for key, quantity in OF_MOTION.items():
        if is_number(limit := design.get(key)):
            worst, value, where, source = run.verification.worst(quantity.name), None, "not verified", STATED
            if worst is not None:
                value, source = worst.value, f"{STATED} {worst.source}"
                where = worst.where if value is not None else f"no figure {worst.where}"
            rows.append(_row(key, limit, quantity.less_is_worse, value, where, source, quantity.name))
    listed = {row["key"] for row in rows}
    unlisted = {"limit": "–", "reached": "–", "source": BROKEN, "share": None, "held": False}
    for key in (key for key in named if key not in listed):
        label, unit = label_and_unit(key)
        rows.append(unlisted | {"key": key, "label": label, "unit": unit, "where": named[key]})
    return rows


def demanded(design: dict, name: str) -> str:
    """The limit on a metric in words, "" where the design sets none."""
    limit = design.get(QUANTITIES[name].limit or "")
    return f"at {'least' if name in LESS_IS_WORSE else 'most'} {shown(limit)}" if is_number(limit) else ""


def _broken(run: RunFolder) -> dict[str, str]:
    """What the verdict names as broken: key of the design -> the first place, "" for the cam's shape."""
    named: dict[str, str] = {}
    for entry in run.verification.get("broken") or []:
        key, _, where = str(entry).partition(" at ")
        named.setdefault(key, f"at {where}" if where else "")
    return named


def _cam_row(run: RunFolder, key: str, limit: float) -> dict:
    mine = [r for r in run.comparison if family_of(r["cam"]) == DESIGN]
    values = [v for v in (as_number(r.get(key, "")) for r in mine) if v is not None]
    worst = max(values, key=lambda v: v / limit) if values else None  # a negative limit is passed by a lower value
    row = _row(key, limit, limit < 0, worst, EVERYWHERE, f"comparison.csv {key}", slack=ROUNDING * abs(limit))
    if row["held"] is not False and key in _broken(run):  # broken at a step, which has no value
        row |= {"held": False, "where": "at a step of the cam's velocity or acceleration", "source": BROKEN}
    return row


def _row(
    key: str,
    limit: float,
    least: bool,
    value: float | None,
    where: str,
    source: str,
    name: str = "",
    slack: float = 0.0,
) -> dict:
    label, unit = label_and_unit(name or key)
    held = None if value is None else value >= limit - slack if least else value <= limit + slack
    demand, reached = f"at {'least' if least else 'most'} {shown(limit)}", shown(value)
    words = {"key": key, "label": label, "unit": unit, "limit": demand, "reached": reached, "where": where}
    return words | {"source": source, "share": share_of(limit, least, value), "held": held}


def share_of(limit: float, least: bool, value: float | None) -> float | None:
    """How much of a limit a value uses, one at the limit, as `camopt.measure.limits.MotionLimit.share` has it; None
    where nothing is known, or the limit is zero."""
    if value is None or not limit:
        return None
    return max(2 - value / limit, 0.0) if least and limit > 0 else value / limit


def disagreements(run: RunFolder, rows: Iterable[dict]) -> list[str]:
    """Sentences where the verdict and the figures beside it do not go together, whatever the verdict is."""
    rows, verification, named = list(rows), run.verification, _broken(run)
    verdict = verification.get("verdict")
    if verdict not in ORDER:
        return []
    passed = [row["label"] for row in rows if row["held"] is False]
    sentences = []
    if verdict == "confirmed" and passed:
        sentences.append(f"The verdict is confirmed, yet by the figures below it breaks: {', '.join(passed)}.")
    sentences += [
        f"The verdict is {verdict}, yet at {shown(s.get('speed_rpm'))} r/min it is {shown(s.get('verdict'))}."
        for s in verification.judged
        if s.get("verdict") not in ORDER or ORDER.index(s["verdict"]) > ORDER.index(verdict)
    ]
    sentences += [
        f"The verdict says that the limit on {row['label']} is broken, yet by the figures below it is held."
        for row in rows
        if row["key"] in named and row["held"] is True
    ]
    if verdict == "rejected" and not named:
        sentences.append("The verdict is rejected, yet it names no limit that is broken.")
    return list(dict.fromkeys(sentences))


def matrix(run: RunFolder, limits: list[dict]) -> dict:
    """`speeds`, and `rows`: a limit with its demand, its `price`, which is what one per cent more of it buys, and how
    much of it is used.

    A limit on the motion has `shares`, one for each speed and one for the band, None where nothing is known. One on the
    cam's shape holds at every speed: its `shares` are None, and its own row says what is used.
    """
    judged = run.verification.by_speed
    worst = (run.verification.get("band") or {}).get("worst") or {}
    motion, shape = [], []
    for row in limits:
        quantity, limit = OF_MOTION.get(row["key"]), run.demands.get(row["key"])
        words = row | {"demand": f"{row['limit']} {row['unit']}".strip(), "shares": None, "price": None}
        if quantity is None:
            shape.append(words | {"price": run.worth.get(row["key"])})
        elif is_number(limit):
            values = [worst_case_value(speed, quantity.name)[0] for speed in judged]
            stated = (worst.get(quantity.name) or {}).get("value")
            values += [stated if is_number(stated) else None] if worst else []
            motion.append(words | {"shares": [share_of(limit, quantity.less_is_worse, value) for value in values]})
    speeds = [shown(speed.get("speed_rpm")) for speed in judged] + ["band"] * bool(worst)
    return {"speeds": speeds, "rows": motion + shape, "priced": any(row["price"] is not None for row in shape)}
