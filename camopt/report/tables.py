"""The report's tables as plain rows of text, from a run folder's data."""

from itertools import groupby

from camopt.optimizer.baselines.comparison_table import FAILED, NO_JERK
from camopt.plots.style import DESIGN, cam_line, family_of
from camopt.report.folder import RunFolder
from camopt.report.outcome import broken_limits, broken_words
from camopt.report.wording import VERDICTS, as_number, cell, label_and_unit, shown
from camopt.scene.quantities import QUANTITIES, is_number
from camopt.verifier.methods import METHOD_NAMES
from camopt.verifier.record import bounce_error_um
from camopt.verifier.verdict import ORDER

SPEED_COLUMNS = (
    "jump_mm", "jump_deg", "contact_force_min_N", "contact_force_max_N", "seating_velocity_m_per_s",
    "impact_velocity_m_per_s", "dynamic_area_mm_deg", "revolutions", "periodic",
)  # fmt: skip
METHOD_ROWS = (
    "bounce_mm", "jump_mm", "contact_force_min_N", "contact_force_max_N", "seating_velocity_m_per_s",
    "impact_velocity_m_per_s", "dynamic_area_mm_deg", "steps_per_revolution", "converged",
)  # fmt: skip
DESIGN_CELLS = {"bounce": "bounce_mm", "jump": "jump_mm", "seating": "seating_velocity_m_per_s"}
WORST_FIRST = (FAILED, *reversed(ORDER))


def heading(key: str) -> str:
    """A column's heading: label and unit."""
    label, unit = label_and_unit(key)
    return f"{label} [{unit}]" if unit else label


def area_rows(run: RunFolder) -> tuple[list[dict], list[dict]]:
    """Area ratios: the design, the certified bound and what else keeps the limits on the cam, largest first; and apart
    from them those cams that do not, of which the bound says nothing."""
    bound = run.design.get("area_ratio_bound")
    verdict = run.verification.get("verdict", "")
    within = [
        ("certified bound", bound, "", "#888888"),
        ("no-jump linear program", run.design.get("area_ratio_no_jump"), "", "#bbbbbb"),
    ]
    beyond = []
    for c in comparison_groups(run):
        if family_of(c["cam"]) == DESIGN:
            continue
        without = "" if c["limits"] == "all" else " (without the jerk limit)"
        row = (c["cam"].removesuffix(NO_JERK) + without, c["area"], c["verdict"], cam_line(c["cam"])["color"])
        (within if c["within"] else beyond).append(row)
    design = (DESIGN, run.design.get("area_ratio"), verdict, cam_line(DESIGN)["color"])
    tables = [design, *_largest_first(within)], _largest_first(beyond)
    largest = max((row[1] for rows in tables for row in rows if is_number(row[1])), default=1.0)
    shares = bound if is_number(bound) and bound > 0 else None
    return _area_rows(tables[0], largest, shares), _area_rows(tables[1], largest, None)


def _largest_first(rows: list[tuple]) -> list[tuple]:
    return sorted((row for row in rows if is_number(row[1])), key=lambda row: -row[1])


def _area_rows(rows: list[tuple], largest: float, bound: float | None) -> list[dict]:
    return [
        {
            "label": label,
            "area": f"{area:.4f}",
            "share": f"{100 * area / bound:.1f} %" if bound else "–",
            "verdict": verdict,
            "kind": VERDICTS[verdict][0] if verdict in VERDICTS else "",
            "width": round(100 * max(area, 0.0) / largest, 1) if largest > 0 else 0,
            "colour": colour,
        }
        for label, area, verdict, colour in rows
        if is_number(area)
    ]


def worth_rows(run: RunFolder) -> list[dict]:
    """Per cent more area for one per cent more of each limit, where design.json records them, largest first."""
    worth = run.design.get("limit_worth")
    known = [(k, v) for k, v in worth.items() if is_number(v)] if isinstance(worth, dict) else []
    return [
        {"label": label_and_unit(str(k))[0], "worth": shown(v, 3)} for k, v in sorted(known, key=lambda pair: -pair[1])
    ]


def comparison_groups(run: RunFolder) -> list[dict]:
    """One entry per cam and set of limits: its worst figures over the speeds, and its verdict over all of them.

    What is said of the design is what verification.json says; it comes first. `within` is whether a cam was made under
    all limits of the scene and keeps those on its shape.
    """
    groups = []
    ordered = sorted(run.comparison, key=lambda r: (r["cam"] != DESIGN, r.get("limits", ""), r["cam"]))
    for (limits, cam), rows in groupby(ordered, key=lambda r: (r.get("limits", ""), r["cam"])):
        rows = list(rows)
        lost = [r for r in rows if as_number(r.get("bounce_mm", "")) is None]
        high = [as_number(r.get("bounce_high_mm", "") or r.get("bounce_mm", "")) for r in rows]
        verdicts = {r.get("verdict", "") for r in rows}
        broken = list(dict.fromkeys(word for r in rows for word in _words_of(r)))
        group = {
            "cam": cam,
            "limits": limits,
            "area": as_number(rows[0].get("area_ratio", "")),
            "shown_area": cell(rows[0].get("area_ratio", "")),
            "bounce": f"no figure at {len(lost)} of {len(rows)} speeds" if lost else _largest(high),
            "jump": _largest([as_number(r.get("jump_mm", "")) for r in rows]),
            "seating": _largest([as_number(r.get("seating_velocity_m_per_s", "")) for r in rows]),
            "jerk": _jerk([r.get("jerk_max_mm_per_deg3", "") for r in rows]),
            "verdict": next((v for v in WORST_FIRST if v in verdicts), ""),
            "broken": "; ".join(broken if FAILED in verdicts else broken_words(broken)) or "–",
            "within": limits == "all" and (FAILED in verdicts or all(_of_the_motion(word) for word in broken)),
            "colour": cam_line(cam)["color"],
        }
        if cam == DESIGN and run.verification.get("verdict"):
            group |= _as_verified(run)
        groups.append(group | {"kind": VERDICTS[group["verdict"]][0] if group["verdict"] in VERDICTS else ""})
    return groups


def _of_the_motion(word: str) -> bool:
    """Whether what is named as broken is a limit on the motion."""
    return " at " in word or word in QUANTITIES


def _words_of(row: dict[str, str]) -> list[str]:
    """What a row of the comparison names as broken; where a family has no member, the sentence that says why."""
    text = row.get("broken", "")
    return [text] if row.get("verdict") == FAILED else [w.strip() for w in text.split(";") if w.strip()]


def _as_verified(run: RunFolder) -> dict:
    """The entries of the design's group, from verification.json."""
    found = {key: run.verification.worst(name) for key, name in DESIGN_CELLS.items()}
    cells = {key: "none" if w.value is None else shown(w.value) for key, w in found.items() if w is not None}
    return cells | {"verdict": run.verification["verdict"], "broken": "; ".join(broken_limits(run)) or "–"}


def _largest(values: list[float | None]) -> str:
    return shown(max((v for v in values if v is not None), default=None))


def _jerk(cells: list[str]) -> str:
    """The largest jerk of a cam; that of one whose acceleration steps is infinite."""
    return "infinite" if "inf" in cells else _largest(list(map(as_number, cells)))


def worst_rows(run: RunFolder) -> list[dict]:
    """Per metric: its worst value over the band, the speed and the method, as verification.json states them."""
    worst = (run.verification.get("band") or {}).get("worst") or {}
    rows = []
    for name in (n for n in QUANTITIES if n in worst):
        label, unit = label_and_unit(name)
        speed, method = shown(worst[name].get("speed_rpm")), worst[name].get("method")
        value = worst[name].get("value")
        rows.append({"label": label, "unit": unit, "value": shown(value) if is_number(value) else "none",
                     "speed": speed, "method": METHOD_NAMES.get(str(method), shown(method))})  # fmt: skip
    return rows


def speed_rows(run: RunFolder) -> list[dict]:
    """Per speed that all methods looked at: verdict, bounce with its error and range, and the other metrics."""
    rows, listed = [], {s.get("speed_rpm") for s in run.verification.get("speeds") or []}
    for speed in run.verification.by_speed:
        verdict = str(speed.get("verdict", ""))
        bounce = shown(speed["bounce_mm"]) if is_number(speed.get("bounce_mm")) else "never seats"
        error = bounce_error_um(speed)
        rows.append(
            {
                "speed": shown(speed.get("speed_rpm")),
                "why": "listed" if speed.get("speed_rpm") in listed else "worst of the band",
                "verdict": verdict or "–",
                "kind": VERDICTS[verdict][0] if verdict in VERDICTS else "",
                "bounce": bounce,
                "error": "–" if error is None else f"±{shown(error, 2)}",
                "range": shown(speed.get("bounce_range_mm"), 3),
                "cells": [shown(speed.get(key)) for key in SPEED_COLUMNS],
                "outside": shown((speed.get("outside") or {}).get("difference_nm"), 2),
            }
        )
    return rows


def method_tables(run: RunFolder) -> list[dict]:
    """Per speed: a row per figure with the methods side by side, and the largest difference between them."""
    tables = []
    for speed in run.verification.by_speed:
        methods = speed.get("methods") or {}
        names = [m for m in METHOD_NAMES if m in methods] + sorted(m for m in methods if m not in METHOD_NAMES)
        rows = []
        for key in METHOD_ROWS:
            values = [methods[m].get(key) for m in names]
            if all(v is None for v in values) and key != "bounce_mm":
                continue
            numbers = [v for v in values if is_number(v)]
            compared = len(numbers) > 1 and key != "steps_per_revolution"
            rows.append(
                {
                    "label": heading(key),
                    "cells": [shown(v, 5) for v in values],
                    "difference": shown(max(numbers) - min(numbers), 2) if compared else "–",
                }
            )
        if names:
            columns = [METHOD_NAMES.get(m, m) for m in names]
            tables.append({"speed": shown(speed.get("speed_rpm")), "methods": columns, "rows": rows})
    return tables


def comparison_table(run: RunFolder) -> dict:
    """The whole comparison as its file has it, numbers rounded."""
    columns = [key for key in (run.comparison[0] if run.comparison else {}) if key]
    return {"columns": [heading(c) for c in columns],
            "rows": [[cell(row.get(c, "")) for c in columns] for row in run.comparison]}  # fmt: skip


COSTS = {
    "clock_s": "clock s",
    "processor_s": "processor s",
    "compilation_s": "compiling s",
    "peak_memory_MB": "peak MB",
}
"""Keys of a stage's cost in provenance.json, and their headings."""


def cost_rows(provenance: dict) -> list[list[str]]:
    """Per stage of the run: its name and what it cost, in the order of COSTS; empty where none is recorded."""
    stages = provenance.get("stages")
    known = stages.items() if isinstance(stages, dict) else ()
    return [
        [str(name).replace("_", " "), *(shown(cost.get(key)) for key in COSTS)]
        for name, cost in known
        if isinstance(cost, dict)
    ]


def provenance_rows(data: dict, prefix: str = "") -> list[tuple[str, str]]:
    """Every entry of the provenance with its dotted name, in the file's order."""
    rows: list[tuple[str, str]] = []
    for key, value in data.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            rows += provenance_rows(value, f"{name}.")
        else:
            rows.append((name, shown(value, 6)))
    return rows
