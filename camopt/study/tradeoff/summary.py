"""What the rows of `camopt tradeoff` say: one paragraph, and the table that it prints, with one row to choose."""

from collections.abc import Sequence

import numpy as np

from camopt.plots.tradeoff import pareto
from camopt.study.measured_rows import REFERENCE

TARGETS_UM = (100.0, 10.0, 1.0, 0.001)
STUCK_UM = 1.0
SHOWN_OF = ("bounce_mm", "area_mm_deg")
MANY = 8
FIT_MM = 0.1


def words_of(scene: str, rows: Sequence[dict]) -> str:
    """What each accuracy costs on this scene."""
    answered = [r for r in rows if r["converged"]]
    methods = [r for r in answered if r["case"].startswith("revolution")]
    sentences = [f"On {scene}; times are processor times."]
    for case in dict.fromkeys(r["case"] for r in methods):
        here = [r for r in methods if r["case"] == case]
        sentences += _lift(case, [r for r in here if r["error_of"] == "lift_mm"])
        sentences += _gradient([r for r in here if r["error_of"] == "gradient"])
    sentences += _side_by_side(answered) + _precision(answered)
    job = [r for r in answered if r["case"].startswith("job: ")]
    if job:
        sentences.append("Of the job, by dial, each setting with its time and error:")
    for case in dict.fromkeys(r["case"] for r in job):
        sentences += _dial(case, [r for r in job if r["case"] == case and r["error_of"] in SHOWN_OF])
    failed = len(rows) - len(answered)
    if failed:
        sentences.append(f"Settings that gave no answer: {failed}; their rows say why.")
    return " ".join(sentences)


def _lift(case: str, rows: Sequence[dict]) -> list[str]:
    """The most accurate way, what every target costs by other methods, and who reaches none."""
    reached = [target for target in TARGETS_UM if any(r["error"] * 1e3 <= target for r in rows)]
    if not reached:
        return [f"A {case}: no method gives the valve's lift within {TARGETS_UM[0]:g} um."]
    best = _cheapest(rows, reached[-1])
    text = f"A {case} with the valve's lift within {reached[-1]:g} um takes {_ms(best)}"
    others = [r for r in rows if _family(r) != _family(best)]
    within: dict[str, list[float]] = {}
    for target in reached:
        if any(r["error"] * 1e3 <= target for r in others):
            within.setdefault(_ms(_cheapest(others, target)), []).append(target)
    if within:
        text += "; by another method " + ", ".join(f"{targets[-1]:g} um takes {ms}" for ms, targets in within.items())
    least = {name: min(r["error"] for r in rows if r["method"] == name) * 1e3 for name in _methods(rows)}
    stuck = [f"{name} ({_figure(um)})" for name, um in least.items() if um > STUCK_UM]
    sentences = [text + "."]
    if stuck:
        sentences.append(f"No setting tried brings these below {STUCK_UM:g} um: {', '.join(stuck)}.")
    return sentences


def _gradient(rows: Sequence[dict]) -> list[str]:
    """The gradient by the adjoint, and the best by reverse mode."""
    exact = [r for r in rows if "adjoint" in r["method"]]
    smooth = [r for r in rows if "adjoint" not in r["method"]]
    if not exact or not smooth:
        return []
    best = min(smooth, key=lambda r: r["error"])
    return [
        f"Its gradient by the adjoint takes {1e3 * exact[0]['seconds']:.3g} ms; reverse mode of the smooth path takes "
        f"{1e3 * best['seconds']:.3g} ms and is off by {best['error']:.1g} at best ({best['setting']})."
    ]


def _side_by_side(rows: Sequence[dict]) -> list[str]:
    batches = [r for r in rows if "side by side" in r["case"] and r["method"] != REFERENCE]
    parts = []
    for method in _methods(batches):
        best = min((r for r in batches if r["method"] == method), key=lambda r: r["error"])
        parts.append(f"{method} {1e3 * best['seconds']:.3g} ms, {_figure(best['error'] * 1e3)} um")
    return [f"With {batches[0]['case']} a revolution takes and is off by: {'; '.join(parts)}."] if parts else []


def _precision(rows: Sequence[dict]) -> list[str]:
    """float32 beside float64 of the same setting."""
    lifts = {(r["case"], r["method"], r["setting"]): r for r in rows if r["error_of"] == "lift_mm"}
    pairs = [
        (r, lifts[case, method.replace("float32", "float64"), setting])
        for (case, method, setting), r in lifts.items()
        if "float32" in method and (case, method.replace("float32", "float64"), setting) in lifts
    ]
    if not pairs:
        return []
    time = np.median([single["seconds"] / double["seconds"] for single, double in pairs])
    ratios = [single["error"] / double["error"] for single, double in pairs if double["error"] > 0]
    off = f" and is at most {max(ratios):.2g} times as far off" if ratios else ""
    return [f"float32 takes {time:.2g} of the time of float64{off}."]


def _dial(case: str, rows: Sequence[dict]) -> list[str]:
    """A dial's settings with time, error and verdict; of many settings those worth taking."""
    parts, rows = [], [r for r in rows if r["seconds"]]
    for setting in dict.fromkeys(r["setting"] for r in _worth(rows)):
        of = [r for r in rows if r["setting"] == setting]
        errors = "the reference" if of[0]["method"] == REFERENCE else " and ".join(_error(r) for r in of)
        verdict = f", {of[0]['verdict']}" if of[0]["verdict"] else ""
        parts.append(f"{setting} {_time(of[0]['seconds'])}, {errors}{verdict}")
    return [f"{case.removeprefix('job: ').capitalize()}: {'; '.join(parts)}."] if parts else []


def _worth(rows: Sequence[dict]) -> Sequence[dict]:
    """All of a few settings; of MANY those off by at most FIT_MM that none beats in time and error."""
    if len({r["setting"] for r in rows}) < MANY:
        return rows
    rows = [r for r in rows if r["error"] <= FIT_MM]
    best = pareto(np.array([r["seconds"] for r in rows]), np.array([r["error"] for r in rows]))
    return [rows[i] for i in best]


def _error(row: dict) -> str:
    if row["error_of"] == "bounce_mm":
        return f"bounce {_figure(1e3 * row['error'])} um off"
    return f"area {_figure(row['error'])} mm deg off"


def _figure(value: float) -> str:
    """Two digits, without an exponent where there is no need of one."""
    return f"{value:.0f}" if value >= 100 else f"{value:.2g}"


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds > 0.1 else f"{1e3 * seconds:.3g} ms"


def _ms(row: dict) -> str:
    return f"{1e3 * row['seconds']:.3g} ms ({row['method']}, {row['setting']})"


def _cheapest(rows: Sequence[dict], target_um: float) -> dict:
    return min((r for r in rows if r["error"] * 1e3 <= target_um), key=lambda r: r["seconds"])


def _family(row: dict) -> str:
    return row["method"].split(",")[0]


def _methods(rows: Sequence[dict]) -> list[str]:
    return list(dict.fromkeys(r["method"] for r in rows))


TARGET_UM = 1.0
"""Error of the valve's lift within which the cheapest setting of each method is shown, what a drawing asks of a cam."""
HEAD = ("", "method", "setting", "time ms", "error um")


def table_of(rows: Sequence[dict]) -> list[str]:
    """Lines of a table of the rows of tradeoff.csv, of the fastest speed that was measured: of each method the cheapest
    setting within `TARGET_UM`, or else its most accurate one; the cheapest of all within it is recommended. Empty where
    nothing was measured."""
    answered = [r for r in rows if r["converged"] and r["error_of"] == "lift_mm" and r["case"].startswith("revolution")]
    if not answered:
        return []
    case = answered[-1]["case"]
    here = [r for r in answered if r["case"] == case]
    best = [_best([r for r in here if r["method"] == method]) for method in dict.fromkeys(r["method"] for r in here)]
    within = [r for r in best if _um(r) <= TARGET_UM]
    chosen = min(within, key=lambda r: r["seconds"]) if within else None
    order = sorted(best, key=lambda r: (_um(r) > TARGET_UM, r["seconds"]))
    cells = [HEAD, *(_cells(r, r is chosen) for r in order)]
    widths = [max(len(line[i]) for line in cells) for i in range(len(HEAD))]
    said = f"A {case}, the valve's lift within {TARGET_UM:g} um, or as near as a method came; * is recommended:"
    return [said, *(_aligned(line, widths) for line in cells)]


def _best(rows: Sequence[dict]) -> dict:
    within = [r for r in rows if _um(r) <= TARGET_UM]
    return min(within, key=lambda r: r["seconds"]) if within else min(rows, key=_um)


def _um(row: dict) -> float:
    return 1e3 * row["error"]


def _cells(row: dict, recommended: bool) -> tuple[str, ...]:
    return "*" * recommended, row["method"], row["setting"], f"{1e3 * row['seconds']:.3g}", f"{_um(row):.2g}"


def _aligned(line: Sequence[str], widths: Sequence[int]) -> str:
    """Words to the left, numbers to the right."""
    cells = enumerate(zip(line, widths, strict=True))
    return "  ".join(cell.rjust(width) if i > 2 else cell.ljust(width) for i, (cell, width) in cells).rstrip()
