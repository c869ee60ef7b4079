"""The table that `camopt tradeoff` prints: what each method costs within an error, with one row to choose."""

from collections.abc import Sequence

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
