"""Presentation of a verification: text for a terminal, a table for a notebook, and a figure over the speed."""

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from camopt.measure.sweep import STARTS, reserve_sentences
from camopt.scene.schema import Scene
from camopt.verifier.record import VerificationRecord, outside_sentence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = {
    "speed_rpm": "speed [r/min]",
    "bounce_mm": "bounce [mm]",
    "bounce_error_mm": "error of bounce [mm]",
    "jump_mm": "jump [mm]",
    "jump_deg": "jump angle [deg]",
    "seating_velocity_m_per_s": "seating velocity [m/s]",
    "contact_force_min_N": "least contact force [N]",
    "contact_force_max_N": "peak contact force [N]",
    "verdict": "verdict",
}
TEXT = {
    "speed_rpm": ("r/min", 8),
    "bounce_mm": ("bounce mm", 10),
    "jump_mm": ("jump mm", 10),
    "jump_deg": ("jump deg", 10),
    "contact_force_min_N": ("least N", 10),
    "contact_force_max_N": ("peak N", 10),
    "seating_velocity_m_per_s": ("seating m/s", 11),
}
MOST_LINES = 20
"""Largest number of speeds in the text; verification.json has them all."""


def text(record: VerificationRecord, scene: Scene | None) -> str:
    """The verdict for a terminal, at most one screen: a line for each speed, the worst of the band, and the outcome."""
    rows, band, outside = record["speeds"], record["band"], outside_sentence(record.outside)
    heads = (f"{label:>{width}}" for label, width in TEXT.values())
    lines = ["  ".join([*heads, _last_columns("verdict", "outside nm", rows)])]
    lines += [_line(row, _last_columns(row["verdict"], _outside_nm(row), rows)) for row in rows[:MOST_LINES]]
    if len(rows) > MOST_LINES:
        lines.append(f"and {len(rows) - MOST_LINES} more speeds")
    if band is not None:
        worst = {name: record.worst(name) for name in TEXT if name != "speed_rpm"}
        low, high = band["from_rpm"], band["to_rpm"]
        beyond = [f"{row['speed_rpm']:g}" for row in rows if not low <= row["speed_rpm"] <= high]
        over = f"{low:g} to {high:g} r/min" + (f" and at {', '.join(beyond)} r/min" if beyond else "")
        lines.append(f"worst over {over}, including neighbouring speeds, lifts and states, each with its speed")
        lines.append(_line({name: entry and entry.value for name, entry in worst.items()}))
        lines.append(_line({name: entry and entry.speed_rpm for name, entry in worst.items()}, "r/min"))
    reason = f". {record['reason']}" if record["reason"] else ""
    lines.append(record["accuracy"]["statement"])
    lines += [f"{record['shape_says']}."] if "shape_says" in record else []
    lines += [outside] if outside and not reason.endswith(outside) else []
    lines.append(f"verdict: {record['verdict']}{reason}")
    if band is not None and scene is not None and scene.operation is not None:
        limits = scene.design.model_dump() if scene.design else {}
        lines += reserve_sentences(record["limits"], limits, scene.operation.band_rpm)
    return "\n".join(lines)


def _outside_nm(row: dict) -> str:
    """Difference [nm] of the valve's motion from rest to that of another engine at a speed; empty if none was run."""
    return f"{row['outside']['difference_nm']:.2g}" if "outside" in row else ""


def _last_columns(verdict: str, outside: str, rows: list[dict]) -> str:
    """The last columns of a line: the verdict and, if another engine was run at any speed, its difference."""
    return f"{verdict:<13}  {outside:>10}" if any("outside" in row for row in rows) else verdict


def _line(row: dict, last: str = "") -> str:
    """One row of `text`: a metric that is null is shown as "none", and one that the row does not have as blank."""
    cells = []
    for name, (_, width) in TEXT.items():
        value = row.get(name, "")
        shown = "none" if value is None else value if isinstance(value, str) else f"{value:.5g}"
        cells.append(f"{shown:>{width}}")
    return ("  ".join(cells) + f"  {last}").rstrip()


def html(record: VerificationRecord) -> str:
    """The verdict, the reason, and a row for each judged speed."""
    from pandas import DataFrame

    rows = record.judged
    table = DataFrame({label: [row[name] for row in rows] for name, label in COLUMNS.items()})
    if record.outside:
        table["difference to Exudyn [nm]"] = [_outside_nm(row) for row in rows]
    shown = table.to_html(index=False, float_format="{:.4g}".format, na_rep="never seats")
    return f"<p><b>{escape(record['verdict'])}</b> {escape(record['reason'])}</p>{shown}"


def figure(record: VerificationRecord, scene: Scene, cam: str) -> "Figure":
    """Bounce and jump against speed: over the band if one was swept, otherwise at the listed speeds.

    The curve has a gap where the valve never seats.
    """
    from camopt.plots import Sweep, bounce_against_speed

    band, listed = record["band"], [row["speed_rpm"] for row in record["speeds"]]
    curves = band["curves"] if band else {name: [row[name] for row in record["speeds"]] for name in COLUMNS}
    speeds, bounce, jump = (np.array(curves[name], dtype=float) for name in ("speed_rpm", "bounce_mm", "jump_mm"))
    starts = {metric: record["limits"][key] for key, metric in STARTS.items()} if band else None
    worst = {name: (band["worst"][name]["speed_rpm"], band["worst"][name]["value"]) for name in starts or ()}
    order = np.argsort(speeds)
    sweep = Sweep(cam, speeds[order], bounce[order], jump[order], starts_rpm=starts, worst=worst)
    return bounce_against_speed([sweep], scene.design, scene.required_operation.band_rpm, listed)
