"""Comparison of the scene's limits with the values of a run folder: held, broken or not known, and the share used."""

from itertools import compress

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.limits import EVERYWHERE, broken_by_shape, reached_by_shape
from camopt.plots.style import DESIGN, family_of
from camopt.report.folder import RunFolder
from camopt.report.wording import as_number, shown
from camopt.scene.design import ROUNDING, Design
from camopt.scene.quantities import QUANTITIES, is_number, label_and_unit
from camopt.verifier.record import Worst, worst_case_value
from camopt.verifier.verdict import ORDER

STATED = "verification.json"
CAM_LIMITS = ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3")
BROKEN = "verification.json broken"
OF_MOTION = {quantity.limit: quantity for quantity in QUANTITIES.values() if quantity.limit}
"""Quantities of the motion that a design may limit, by the key of the limit."""

LABELS = {
    "max_lift_mm": ("largest lift", "mm"),
    "reach_max_lift": ("lift to be reached", "mm"),
    "nose_deg": ("acceleration at the nose", "mm/deg²"),
    "piston": ("clearance to the piston", "mm"),
    "face_width_mm": ("face width needed", "mm"),
    "lift_at": ("lift at an angle", "mm"),
    "duration_at": ("duration at a lift", "deg"),
    "waves_max": ("sign changes of the jerk", ""),
    "nose_radius_min_mm": ("smallest convex radius", "mm"),
    "concave_radius_min_mm": ("smallest concave radius", "mm"),
    "entrainment_min_m_per_s": ("entrainment velocity", "m/s"),
}
"""Label and unit of a limit on the cam's shape, by its key, where they cannot be derived from the key."""


def limit_rows(run: RunFolder, shape: tuple[Lift, Design] | None = None) -> list[dict]:
    """One row per limit of the scene's design, and per other condition that the verdict lists as broken: the value
    reached, where it occurs, whether the limit holds (`held`, None where it is not known), and where the value is
    recorded. With `shape`, which is the run's cam and its design, every limit on the shape also has a row."""
    design = run.demands
    rows = [_cam_row(run, key, design[key]) for key in CAM_LIMITS if is_number(design.get(key))]
    if shape is not None:
        rows = [row for row in rows if row["held"] is not None]
        recorded, broken = {row["key"] for row in rows}, {*broken_by_shape(*shape), *run.broken}
        for reached in reached_by_shape(*shape):
            if reached.key in recorded or not np.isfinite(reached.value):
                continue
            row = _row(reached.key, reached.limit, reached.least, reached.value, reached.where, "design.json pieces")
            label, unit = LABELS.get(reached.key, (row["label"], row["unit"]))
            # a limit holds at both flanks and in every window or not at all: if it is broken, all of its rows are
            rows.append(row | {"label": reached.label or label, "unit": unit, "held": reached.key not in broken})
    for key, quantity in OF_MOTION.items():
        if is_number(limit := design.get(key)):
            worst = run.verification.worst(quantity.name)
            where, source = ("not verified", STATED) if worst is None else where_and_source(worst)
            rows.append(_row(key, limit, quantity.less_is_worse, worst and worst.value, where, source))
    listed = {row["key"] for row in rows}
    unlisted = {"limit": "–", "reached": "–", "source": BROKEN, "share": None, "held": False}
    for key, (first, *_) in run.broken.items():
        if key not in listed:
            label, unit = label_and_unit(key)
            where = f"at {first}" if first else ""
            rows.append(unlisted | {"key": key, "label": label, "unit": unit, "where": where})
    return rows


def limit_in_words(limit: float | None, least: bool) -> str:
    """A limit in words; empty where it is not a number."""
    return f"at {'least' if least else 'most'} {shown(limit)}" if is_number(limit) else ""


def where_and_source(worst: Worst) -> tuple[str, str]:
    """Where a worst value occurs, and the key of verification.json from which it is read."""
    where = worst.where if worst.value is not None else f"no figure {worst.where}"
    return where, f"{STATED} {worst.source}"


def _cam_row(run: RunFolder, key: str, limit: float) -> dict:
    of_design = [r for r in run.comparison if family_of(r["cam"]) == DESIGN]
    values = [v for v in (as_number(r.get(key, "")) for r in of_design) if v is not None]
    worst = max(values, key=lambda v: v / limit) if values else None  # the quotient is also right for a negative limit
    row = _row(key, limit, limit < 0, worst, EVERYWHERE, f"comparison.csv {key}", slack=ROUNDING * abs(limit))
    if row["held"] is not False and key in run.broken:  # broken at a discontinuity, where there is no value
        row |= {"held": False, "where": "at a step of the cam's velocity or acceleration", "source": BROKEN}
    return row


def _row(key: str, limit: float, least: bool, value: float | None, where: str, source: str, slack: float = 0.0) -> dict:
    label, unit = label_and_unit(OF_MOTION[key].name if key in OF_MOTION else key)
    held = None if value is None else value >= limit - slack if least else value <= limit + slack
    words = {"key": key, "label": label, "unit": unit, "limit": limit_in_words(limit, least), "reached": shown(value)}
    return words | {"where": where, "source": source, "share": share_of(limit, least, value), "held": held}


def share_of(limit: float, least: bool, value: float | None) -> float | None:
    """Share of a limit that a value uses, 1 at the limit, defined as in `camopt.measure.limits.MotionLimit.share`; None
    where the value is not known or the limit is zero."""
    if value is None or not limit:
        return None
    return max(2 - value / limit, 0.0) if least and limit > 0 else value / limit


def disagreements(run: RunFolder, rows: list[dict]) -> list[str]:
    """Sentences on every contradiction between the verdict and the values that are shown beside it."""
    verdict = run.verdict
    if verdict not in ORDER:
        return []
    exceeded = [row["label"] for row in rows if row["held"] is False]
    sentences = []
    if verdict == "confirmed" and exceeded:
        sentences.append(f"The verdict is confirmed, but the values below exceed these limits: {', '.join(exceeded)}.")
    sentences += [
        f"The verdict is {verdict}, yet at {shown(s.get('speed_rpm'))} r/min it is {shown(s.get('verdict'))}."
        for s in run.verification.judged
        if s.get("verdict") not in ORDER or ORDER.index(s["verdict"]) > ORDER.index(verdict)
    ]
    sentences += [
        f"The verdict says that the limit on {row['label']} is broken, yet by the figures below it is held."
        for row in rows
        if row["key"] in run.broken and row["held"] is True
    ]
    if verdict == "rejected" and not run.broken:
        sentences.append("The verdict is rejected, yet it names no limit that is broken.")
    return list(dict.fromkeys(sentences))


def matrix(run: RunFolder, limits: list[dict]) -> dict:
    """The table of used shares: `speeds`, `rows` (one per limit), and `priced`, whether any row has a price.

    A row has the limit in words (`demand`) and its `price`: the percentage gain of area for one per cent more of the
    limit. A limit on the motion has `shares`: one per verified speed, None where it is not known, and the largest of
    the band. The latter combines the sweep with the verdict at the speeds inside the band, because the verdict's
    methods compute more revolutions where the motion does not settle. A limit on the cam's shape does not depend on
    the speed: its `shares` are None, and the row's `share` applies.
    """
    judged, band = run.verification.by_speed, run.verification.get("band") or {}
    low, high = band.get("from_rpm"), band.get("to_rpm")
    speeds = [speed.get("speed_rpm") for speed in judged]
    inside = [is_number(low) and is_number(high) and is_number(speed) and low <= speed <= high for speed in speeds]
    motion, shape = [], []
    for row in limits:
        quantity, limit = OF_MOTION.get(row["key"]), run.demands.get(row["key"])
        row = row | {"demand": f"{row['limit']} {row['unit']}".strip(), "shares": None, "price": None}
        if quantity is None:
            shape.append(row | {"price": run.worth.get(row["key"])})
        elif is_number(limit):
            values = [worst_case_value(speed, quantity.name)[0] for speed in judged]
            shares = [share_of(limit, quantity.less_is_worse, value) for value in values]
            swept = ((band.get("worst") or {}).get(quantity.name) or {}).get("value")
            of_sweep = share_of(limit, quantity.less_is_worse, swept if is_number(swept) else None)
            in_band = [share for share in (of_sweep, *compress(shares, inside)) if share is not None]
            motion.append(row | {"shares": [*shares, *([max(in_band, default=None)] if band else [])]})
    return {
        "speeds": [*map(shown, speeds), *(["band"] if band else [])],
        "rows": motion + shape,
        "priced": any(row["price"] is not None for row in shape),
    }
