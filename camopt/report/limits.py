"""The scene's limits against what the run folder says was reached: held, broken, or not known, and the share used."""

from collections.abc import Iterable

from camopt.cam.lift import Lift
from camopt.measure.limits import broken_by_shape
from camopt.plots.style import DESIGN, family_of
from camopt.report.folder import RunFolder
from camopt.report.shape import EVERYWHERE, reached_by_shape
from camopt.report.wording import as_number, label_and_unit, shown
from camopt.scene.design import ROUNDING, Design
from camopt.scene.quantities import LESS_IS_WORSE, QUANTITIES, is_number
from camopt.verifier.record import worst_case_value
from camopt.verifier.verdict import ORDER

CAM_LIMITS = ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3")
BROKEN = "verification.json broken"
NEAR = 0.9
"""Share of a limit from which a cell says that it is near."""
NO_PRICE = "–"
STATES = {True: ("good", "✓ held"), False: ("bad", "✗ broken"), None: ("doubt", "? not known")}


def limit_rows(run: RunFolder, shape: tuple[Lift, Design] | None = None) -> list[dict]:
    """A row per limit of the scene's design, and per other condition that the verdict found broken: what was reached,
    where, whether that holds, and where it is recorded.

    `shape` is the run's cam with the design that it is held to: with it every limit on the shape has a row, too.
    """
    design = run.demands
    rows = [_cam_row(run, key, design[key]) for key in CAM_LIMITS if is_number(design.get(key))]
    if shape is not None:
        recorded = {row["key"] for row in rows if row["held"] is not None}
        rows = [row for row in rows if row["key"] in recorded]
        broken = {*broken_by_shape(*shape), *_broken(run)}
        rows += [_shape_row(one, broken) for one in reached_by_shape(*shape) if one["key"] not in recorded]
    for quantity in QUANTITIES.values():
        limit = design.get(quantity.limit or "")
        if is_number(limit):
            rows.append(_motion_row(run, quantity.name, str(quantity.limit), limit))
    listed = {row["key"] for row in rows}
    others = {key: where for key, where in _broken(run).items() if key not in listed}
    return rows + [_other_row(key, where) for key, where in others.items()]


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
    row = _row(key, key, limit, limit < 0, worst, EVERYWHERE, f"comparison.csv {key}", ROUNDING * abs(limit))
    if row["held"] is not False and key in _broken(run):  # broken at a step, which has no value
        row |= _state(False) | {"where": "at a step of the cam's velocity or acceleration", "source": BROKEN}
    return row


def _shape_row(reached: dict, broken: set[str]) -> dict:
    """All rows of a limit that is `broken` are: it holds at both flanks and in every window, or it does not hold."""
    key, limit, least, value, where = (reached[name] for name in ("key", "limit", "least", "value", "where"))
    row = _row(key, key, limit, least, value, where, "design.json pieces")
    return row | {"label": reached["label"], "unit": reached["unit"]} | _state(key not in broken)


def _motion_row(run: RunFolder, name: str, key: str, limit: float) -> dict:
    worst, least = run.verification.worst(name), name in LESS_IS_WORSE
    if worst is None:
        return _row(key, name, limit, least, None, "not verified", "verification.json")
    where = worst.where if worst.value is not None else f"no figure {worst.where}"
    return _row(key, name, limit, least, worst.value, where, f"verification.json {worst.source}")


def _other_row(key: str, where: str) -> dict:
    label, unit = label_and_unit(key)
    words = {"key": key, "label": label, "unit": unit, "limit": "–", "reached": "–", "where": where, "source": BROKEN}
    return words | {"share": None} | _state(False)


def _row(
    key: str, name: str, limit: float, least: bool, worst: float | None, where: str, source: str, slack: float = 0.0
) -> dict:
    label, unit = label_and_unit(name)
    held = None
    if worst is not None:
        held = worst >= limit - slack if least else worst <= limit + slack
    demand, reached = f"at {'least' if least else 'most'} {shown(limit)}", shown(worst)
    words = {"key": key, "label": label, "unit": unit, "limit": demand, "reached": reached, "where": where}
    return words | {"source": source, "share": share_of(limit, least, worst)} | _state(held)


def share_of(limit: float, least: bool, value: float | None) -> float | None:
    """How much of a limit a value uses, one at the limit, as `camopt.measure.limits.MotionLimit.share` has it; None
    where nothing is known, or the limit is zero."""
    if value is None or not limit:
        return None
    return max(2 - value / limit, 0.0) if least and limit > 0 else value / limit


def _state(held: bool | None) -> dict:
    kind, state = STATES[held]
    return {"held": held, "kind": kind, "state": state}


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
    """`speeds`, and `rows` with label, demand, price and `cells`: words, class, and whether it is the row's worst.

    A limit on the motion has a cell for each speed and one for the band. One on the cam's shape holds at every speed:
    its row has one cell, which spans them all. The price is what one per cent more of the limit buys.
    """
    judged = run.verification.by_speed
    worst = (run.verification.get("band") or {}).get("worst") or {}
    of_motion = {quantity.limit: quantity for quantity in QUANTITIES.values()}
    motion, shape = [], []
    for row in limits:
        quantity, limit = of_motion.get(row["key"]), run.demands.get(row["key"])
        price = run.worth.get(row["key"]) if quantity is None else None
        words = {"label": row["label"], "demand": f"{row['limit']} {row['unit']}".strip()}
        words["price"] = NO_PRICE if price is None else shown(price, 2)
        if quantity is None:
            shape.append({**words, "shape": _of_shape(row)})
        elif is_number(limit):
            values = [worst_case_value(speed, quantity.name)[0] for speed in judged]
            stated = (worst.get(quantity.name) or {}).get("value")
            values += [stated if is_number(stated) else None] if worst else []
            shares = [share_of(limit, quantity.less_is_worse, value) for value in values]
            largest = max((share for share in shares if share is not None), default=0.0)
            first = shares.index(largest) if largest > 0 else None
            motion.append({**words, "cells": [_cell(s, i == first) for i, s in enumerate(shares)], "shape": None})
    speeds = [shown(speed.get("speed_rpm")) for speed in judged] + ["band"] * bool(worst)
    priced = any(row["price"] != NO_PRICE for row in shape)
    return {"speeds": speeds, "rows": motion + shape, "priced": priced}


def _of_shape(row: dict) -> dict:
    """The cell of a limit on the shape; where no share can be told, whether it holds. A cam that reaches a limit up to
    the rounding of its file holds it."""
    kind = {True: "calm", False: "bad", None: "unknown"}[row["held"]]
    words = row["state"] if row["share"] is None else ("✗ " if kind == "bad" else "") + _percent(row["share"])
    return {"words": words, "worst": False, "kind": kind}


def _cell(share: float | None, worst: bool = False) -> dict:
    if share is None:
        return {"words": "?", "kind": "unknown", "worst": False}
    kind = "bad" if share > 1 + 1e-6 else "near" if share >= NEAR else "calm"
    return {"words": ("✗ " if kind == "bad" else "") + _percent(share), "kind": kind, "worst": worst}


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share < 10 else f"{share:.0f} times"
