"""The scene's limits against what the run folder says was reached: held, broken, or not known."""

from collections.abc import Iterable

from camopt.plots.style import DESIGN, family_of
from camopt.report.folder import RunFolder
from camopt.report.wording import as_number, is_number, label_and_unit, shown
from camopt.scene.quantities import QUANTITIES

ROUND_OFF = 1e-6
"""Share of a limit by which a cam may pass it: the linear programs hold their rows to 1e-7."""
CAM_LIMITS = ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3")
STATES = {True: ("good", "✓ held"), False: ("bad", "✗ broken"), None: ("doubt", "? not known")}


def upper_end(speed: dict, name: str) -> float | None:
    """The figure that a limit judges: the range's upper end, the value plus its error, or the value."""
    spread = speed.get(name.replace("_mm", "_range_mm"))
    if name == "bounce_mm" and isinstance(spread, list) and spread and all(map(is_number, spread)):
        return max(spread)
    value, error = speed.get(name), speed.get(name.replace("_mm", "_error_mm"))
    if not is_number(value):
        return None
    return value + error if name == "bounce_mm" and is_number(error) else value


def limit_rows(run: RunFolder) -> list[dict]:
    """A row per limit of the scene's design: what was reached, where, and whether that holds."""
    design = run.scene.get("design")
    design = design if isinstance(design, dict) else {}
    rows = [_cam_row(run, key, design[key]) for key in CAM_LIMITS if is_number(design.get(key))]
    for quantity in QUANTITIES.values():
        limit = design.get(quantity.limit or "")
        if is_number(limit):
            rows.append(_motion_row(run, quantity.name, limit))
    return rows


def _cam_row(run: RunFolder, key: str, limit: float) -> dict:
    mine = [r for r in run.comparison if family_of(r["cam"]) == DESIGN and r.get("limits", "all") == "all"]
    values = [v for v in (as_number(r.get(key, "")) for r in mine) if v is not None]
    worst = max(values, key=lambda v: v / limit) if values else None  # a negative limit is passed by a lower value
    return _row(key, limit, worst, "the cam, at every angle")


def _motion_row(run: RunFolder, name: str, limit: float) -> dict:
    speeds = run.verification.get("speeds", [])
    lost = [s.get("speed_rpm") for s in speeds if upper_end(s, name) is None]
    found = worst_of(run, name)
    if found is None or lost:
        return _row(name, limit, None, f"no figure at {shown(lost[0])} r/min" if lost else "not verified")
    return _row(name, limit, found[0], f"at {shown(found[1])} r/min")


def worst_of(run: RunFolder, name: str) -> tuple[float, float | None] | None:
    """Largest verified figure and its speed [r/min], over the speeds of the verdict and, for bounce, the band."""
    values = [(upper_end(s, name), s.get("speed_rpm")) for s in run.verification.get("speeds", [])]
    if name == "bounce_mm":
        band = run.verification.get("band") or {}
        values.append((band.get("worst_bounce_mm"), band.get("worst_speed_rpm")))
    known = [(value, at) for value, at in values if is_number(value)]
    return max(known, key=lambda pair: pair[0], default=None)


def _row(key: str, limit: float, worst: float | None, where: str) -> dict:
    label, unit = label_and_unit(key)
    held = None if worst is None else worst * _sign(limit) <= abs(limit) * (1 + ROUND_OFF)
    kind, state = STATES[held]
    relation = "at least" if limit < 0 else "at most"
    return {
        "label": label,
        "unit": unit,
        "limit": f"{relation} {shown(limit)}",
        "reached": shown(worst),
        "where": where,
        "held": held,
        "kind": kind,
        "state": state,
    }


def _sign(limit: float) -> float:
    return -1.0 if limit < 0 else 1.0


def disagreements(run: RunFolder, rows: Iterable[dict]) -> list[str]:
    """Sentences where the verdict and the figures beside it do not go together."""
    verdict = run.verification.get("verdict")
    broken = [row["label"] for row in rows if row["held"] is False]
    sentences = []
    if verdict == "confirmed" and broken:
        sentences.append(f"The verdict is confirmed, yet by the figures below it breaks: {', '.join(broken)}.")
    if verdict == "confirmed":
        others = [s for s in run.verification.get("speeds", []) if s.get("verdict") != "confirmed"]
        sentences += [
            f"The verdict is confirmed, yet at {shown(s.get('speed_rpm'))} r/min it is {shown(s.get('verdict'))}."
            for s in others
        ]
    return sentences
