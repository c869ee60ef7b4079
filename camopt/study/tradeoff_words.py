"""What the rows of `camopt tradeoff` say, in one paragraph."""

from collections.abc import Sequence

TARGETS_UM = (100.0, 10.0, 1.0, 0.001)


def words_of(scene: str, rows: Sequence[dict]) -> str:
    """What each accuracy costs on this scene."""
    methods = [r for r in rows if not r["case"].startswith("job: ") and "side by side" not in r["case"]]
    sentences = []
    for case in dict.fromkeys(r["case"] for r in methods):
        lifts = [r for r in methods if r["case"] == case and r["error_of"] == "lift_mm" and r["converged"]]
        costs = [f"{target:g} um {_cheapest(lifts, target)}" for target in TARGETS_UM]
        sentences.append(f"On {scene}, one {case}: the valve's lift within {'; '.join(costs)}.")
        sentences += _stuck(lifts)
    gradients = [r for r in methods if r["error_of"] == "gradient" and r["converged"] and "adjoint" not in r["method"]]
    for case in dict.fromkeys(r["case"] for r in gradients):
        best = min((r for r in gradients if r["case"] == case), key=lambda r: r["error"])
        sentences.append(
            f"The smooth gradient at the {case} is off by {best['error']:.1g} at best "
            f"({best['setting']}, {1e3 * best['seconds']:.3g} ms)."
        )
    failed = sum(1 for r in rows if not r["converged"])
    sentences += _side_by_side(rows) + _job(rows)
    if failed:
        sentences.append(f"{failed} settings gave no answer; their rows say why.")
    return " ".join(sentences)


def _cheapest(rows: Sequence[dict], target_um: float) -> str:
    """The fastest setting of an error within a target of which no finer setting of the method leaves it."""
    found = [r for r in rows if r["error"] * 1e3 <= target_um]
    if not found:
        return "by no method"
    best = min(found, key=lambda r: r["seconds"])
    others = [r for r in found if not r["method"].startswith(best["method"].split(",")[0])]
    text = f"costs {1e3 * best['seconds']:.3g} ms ({best['method']}, {best['setting']})"
    if others:
        second = min(others, key=lambda r: r["seconds"])
        text += f", {1e3 * second['seconds']:.3g} ms by {second['method']}"
    return text


def _stuck(rows: Sequence[dict]) -> list[str]:
    """Methods whose best setting stays above a micrometre."""
    best: dict[str, float] = {}
    for r in rows:
        best[r["method"]] = min(best.get(r["method"], float("inf")), r["error"] * 1e3)
    stuck = [f"{name} ({um:.2g} um)" for name, um in best.items() if um > 1.0]
    return [f"Within the settings tried these stay above 1 um: {', '.join(stuck)}."] if stuck else []


def _side_by_side(rows: Sequence[dict]) -> list[str]:
    found = [r for r in rows if "side by side" in r["case"] and r["error_of"] == "lift_mm" and r["converged"]]
    parts = []
    for method in dict.fromkeys(r["method"] for r in found):
        best = min((r for r in found if r["method"] == method), key=lambda r: r["error"])
        parts.append(f"{method} {1e3 * best['seconds']:.3g} ms at {best['error'] * 1e3:.2g} um")
    return [f"Of {found[0]['case']}, a revolution takes: {', '.join(parts)}."] if parts else []


def _job(rows: Sequence[dict]) -> list[str]:
    """Each dial's settings with their time and error."""
    sentences = []
    job = [r for r in rows if r["case"].startswith("job: ") and r["converged"]]
    for case in dict.fromkeys(r["case"] for r in job):
        parts = []
        for setting in dict.fromkeys(r["setting"] for r in job if r["case"] == case):
            of = [r for r in job if (r["case"], r["setting"]) == (case, setting)]
            errors = [f"{r['error_of']} {r['error']:.2g}" for r in of if r["error_of"] != "verdict"]
            verdict = f", {of[0]['verdict']}" if of[0]["verdict"] else ""
            parts.append(f"{setting.split(':')[0]} {of[0]['seconds']:.3g} s, {' and '.join(errors)}{verdict}")
        sentences.append(f"{case.removeprefix('job: ').capitalize()} (time, error): {'; '.join(parts)}.")
    return sentences
