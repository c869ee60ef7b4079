"""The table of `experiments.optimisers`: its stored runs by method and scene, without the optimisers themselves."""

import numpy as np


def name_of(row: dict) -> str:
    """What a row's method is called; the ascents alone begin at a cam, all others at the limits on the shape."""
    if row["start"] != "shape":
        return f"{row['method']}, {row['path']} gradients, from {row['start']}"
    return row["method"]


def grouped(rows: list[dict]) -> dict[str, dict[str, list[dict]]]:
    """The rows of all seeds by scene and method."""
    found: dict[str, dict[str, list[dict]]] = {}
    for row in rows:
        found.setdefault(row["scene"], {}).setdefault(name_of(row), []).append(row)
    return found


def table(found: dict[str, dict[str, list[dict]]]) -> str:
    """In Markdown by method and scene: area ratio (median of the seeds), its gain over the program's cam (least to
    largest), how many seeds reach a confirmed cam, and the second of the last gain (median)."""
    names = list(dict.fromkeys(name for methods in found.values() for name in methods))
    lines = [f"| method | {' | '.join(found)} |", "|---" * (len(found) + 1) + "|"]
    lines += [f"| {name} | {' | '.join(cell(found[scene].get(name, [])) for scene in found)} |" for name in names]
    return "\n".join(lines)


def cell(rows: list[dict]) -> str:
    """One cell of the table."""
    areas = [row["area_ratio"] for row in rows if row["area_ratio"] is not None]
    if not rows:
        return "not tried"
    if not areas:
        return "none confirmed"
    seconds = np.median([row["stairs"][-1][0] for row in rows if row["stairs"]])
    over = sorted({f"{row['gain']:+.4f}" for row in rows if row["gain"] is not None}, key=float)
    some = f", {len(areas)} of {len(rows)} seeds" if len(areas) < len(rows) else ""
    return f"{np.median(areas):.4f} ({' to '.join(dict.fromkeys((over[0], over[-1])))}){some}, {seconds:.1f} s"
