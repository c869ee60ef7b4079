"""The report's tables as plain rows of text, from a run folder's data."""

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from camopt.optimizer.baselines.comparison_table import FAILED, NO_JERK
from camopt.plots.style import DESIGN, cam_line, family_of
from camopt.report.folder import RunFolder, broken_places, comparison_rows
from camopt.report.outcome import broken_words
from camopt.report.wording import as_number, heading
from camopt.scene.quantities import QUANTITIES, is_number
from camopt.study.measurements import aligned
from camopt.verifier.methods import METHOD_NAMES
from camopt.verifier.verdict import ORDER

METHOD_ROWS = (
    "bounce_mm", "jump_mm", "contact_force_min_N", "contact_force_max_N", "seating_velocity_m_per_s",
    "impact_velocity_m_per_s", "dynamic_area_mm_deg", "steps_per_revolution", "converged",
)  # fmt: skip
DESIGN_CELLS = {"bounce": "bounce_mm", "jump": "jump_mm", "seating": "seating_velocity_m_per_s"}
WORST_FIRST = (FAILED, *reversed(ORDER))
AT_A_SPEED = re.compile(r" at [\d.e+]+ r/min$")
BROKEN_WIDTH = 48
"""Longest list of broken limits in a line of the terminal [characters]."""


def area_rows(run: RunFolder) -> tuple[list[tuple], list[tuple]]:
    """Area ratios as (name, area, verdict, colour) in two lists: the design, followed by the certified bound and all
    that keeps the limits on the cam, largest first; and the cams that do not, to which the bound does not apply."""
    d = run.design
    within: list[tuple] = [
        ("certified bound", d.get("area_ratio_bound"), "", "#888888"),
        ("no-jump linear program", d.get("area_ratio_no_jump"), "", "#bbbbbb"),
    ]
    beyond: list[tuple] = []
    for c in comparison_groups(run):
        if family_of(c["cam"]) != DESIGN:
            name = c["cam"].removesuffix(NO_JERK) + ("" if c["limits"] == "all" else " (without the jerk limit)")
            (within if c["within"] else beyond).append((name, c["area"], c["verdict"], cam_line(c["cam"])["color"]))
    design = (DESIGN, d.get("area_ratio"), run.verdict or "", cam_line(DESIGN)["color"])
    within, beyond = (sorted((r for r in rows if is_number(r[1])), key=lambda r: -r[1]) for rows in (within, beyond))
    return [design, *within] if is_number(design[1]) else within, beyond


def comparison_groups(run: RunFolder) -> list[dict]:
    """One entry per cam and set of limits, the design first: the worst values over the speeds, the verdict over all of
    them, and whether the cam is `within` the limits, which means that it was made under all limits of the scene and
    keeps those on its shape. The values of the design are those of verification.json."""
    groups = []
    for entry in sorted(worst_by_cam(run.comparison), key=lambda e: (e["cam"] != DESIGN, e["limits"], e["cam"])):
        broken, failed = entry["broken"], entry["verdict"] == FAILED
        of_motion = all(" at " in word or word in QUANTITIES for word in broken)
        listed = "; ".join(broken if failed else broken_words(broken_places(broken))) or "–"
        group = entry | {"broken": listed, "within": entry["limits"] == "all" and (failed or of_motion)}
        if entry["lost"]:
            group["bounce"] = f"no figure at {entry['lost']} of {entry['speeds']} speeds"
        if entry["cam"] == DESIGN and run.verdict:
            worst = {key: run.verification.worst(name) for key, name in DESIGN_CELLS.items()}
            group |= {key: "none" if w.value is None else w.value for key, w in worst.items() if w is not None}
            group |= {"verdict": run.verdict, "broken": "; ".join(broken_words(run.broken)) or "–"}
        groups.append(group)
    return groups


def worst_by_cam(rows: Sequence[dict[str, str]]) -> list[dict]:
    """One entry per cam and set of limits of comparison.csv, in the file's order: `area`, the worst `bounce`, `jump`,
    `seating` and `jerk` over the speeds (None where there is none), the number of `speeds` and of those without a
    bounce (`lost`), the worst `verdict`, and every entry of `broken` once."""
    cams: dict[tuple[str, str], list[dict[str, str]]] = {}
    for row in rows:
        cams.setdefault((row["cam"], row.get("limits", "")), []).append(row)
    entries = []
    for (cam, limits), speeds in cams.items():
        area, jerks = speeds[0].get("area_ratio", ""), [row.get("jerk_max_mm_per_deg3", "") for row in speeds]
        verdicts = {row.get("verdict", "") for row in speeds}
        broken = [row.get("broken", "") for row in speeds]  # a sentence with the reason where a family has no member
        if FAILED not in verdicts:
            broken = [word.strip() for text in broken for word in text.split(";") if word.strip()]
        entries.append(
            {
                "cam": cam,
                "limits": limits,
                "area": as_number(area),
                "area_cell": area,
                "bounce": _largest(row.get("bounce_high_mm", "") or row.get("bounce_mm", "") for row in speeds),
                "jump": _largest(row.get("jump_mm", "") for row in speeds),
                "seating": _largest(row.get("seating_velocity_m_per_s", "") for row in speeds),
                "jerk": "infinite" if "inf" in jerks else _largest(jerks),  # its acceleration is discontinuous
                "speeds": len(speeds),
                "lost": sum(as_number(row.get("bounce_mm", "")) is None for row in speeds),
                "verdict": next((v for v in WORST_FIRST if v in verdicts), ""),
                "broken": list(dict.fromkeys(broken)),
            }
        )
    return entries


def comparison_lines(folder: Path) -> list[str]:
    """Lines at the end of `camopt compare`: cam, area ratio, worst bounce and jump over the speeds [mm], verdict, and
    broken limits, shortened to `BROKEN_WIDTH`; comparison.csv holds all of them."""
    table: list[tuple[str, ...]] = [("cam", "area ratio", "bounce mm", "jump mm", "verdict", "broken")]
    for entry in worst_by_cam(comparison_rows((folder / "comparison.csv").read_text(encoding="utf-8"))):
        limits = (AT_A_SPEED.sub("", word) for text in entry["broken"] for word in text.split("; "))
        broken = ", ".join(dict.fromkeys(limits)) or "nothing"
        shortened = broken if len(broken) <= BROKEN_WIDTH else broken[: BROKEN_WIDTH - 3] + "..."
        numbers = ("none" if entry[key] is None else f"{entry[key]:.4f}" for key in ("area", "bounce", "jump"))
        table.append((entry["cam"], *numbers, entry["verdict"], shortened))
    return aligned(table, "<>>><<")


def _largest(cells: Iterable[str]) -> float | None:
    return max((number for text in cells if (number := as_number(text)) is not None), default=None)


def method_tables(run: RunFolder) -> list[dict]:
    """One table per speed: a row per metric with the methods side by side, and the largest difference between them."""
    tables = []
    for speed in run.verification.by_speed:
        methods = speed.get("methods") or {}
        names = [m for m in METHOD_NAMES if m in methods] + sorted(m for m in methods if m not in METHOD_NAMES)
        rows = []
        for key in METHOD_ROWS:
            values = [methods[m].get(key) for m in names]
            numbers = [v for v in values if is_number(v)]
            difference = max(numbers) - min(numbers) if len(numbers) > 1 and key != "steps_per_revolution" else None
            if key == "bounce_mm" or any(v is not None for v in values):
                rows.append((heading(key), values, difference))
        if names:
            columns = [METHOD_NAMES.get(m, m) for m in names]
            tables.append({"speed": speed.get("speed_rpm"), "methods": columns, "rows": rows})
    return tables


def leaves(value: Any, path: str = "", into_lists: bool = True) -> Iterator[tuple[str, Any]]:
    """Every value inside nested tables with its dotted name, in order; with `into_lists` also those inside lists."""
    if isinstance(value, dict):
        for key, child in value.items():
            yield from leaves(child, f"{path}.{key}" if path else str(key), into_lists)
    elif into_lists and isinstance(value, list):
        yield f"{path} (length)", len(value)
        for i, child in enumerate(value):
            yield from leaves(child, f"{path}[{i}]")
    else:
        yield path, value
