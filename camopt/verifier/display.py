"""How a verdict shows itself: a table by speed for a notebook, and bounce and jump against speed as a figure."""

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from camopt.measure.reserve import STARTS, reserve_sentences
from camopt.verifier.outside_speeds import outside_sentence
from camopt.verifier.worst import worst_in

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from camopt.measure.sweep import Band
    from camopt.verifier.verdict import Verdict

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
"""Speeds that a printed verdict lists; verification.json has them all."""


def text(verdict: "Verdict") -> str:
    """The verdict for a terminal, a screen at most: a line for each speed, the worst of the band, and the outcome."""
    rows = verdict.as_dict()["speeds"]
    heads = (f"{label:>{width}}" for label, width in TEXT.values())
    lines = ["  ".join([*heads, _beside("verdict", "outside nm", rows)])]
    lines += [_line(row, _beside(row["verdict"], _outside(row), rows)) for row in rows[:MOST_LINES]]
    if len(rows) > MOST_LINES:
        lines.append(f"and {len(rows) - MOST_LINES} more speeds")
    if verdict.band is not None:
        record = verdict.as_dict()
        worst = {name: worst_in(record, name) for name in TEXT if name != "speed_rpm"}
        over = _judged_speeds(verdict.band, rows)
        lines.append(f"worst over {over}, neighbouring speeds, lifts and states included, each at its speed")
        lines.append(_line({name: one and one.value for name, one in worst.items()}))
        lines.append(_line({name: one and one.speed_rpm for name, one in worst.items()}, "r/min"))
    reason = f". {verdict.reason}" if verdict.reason else ""
    says = [f"{verdict.shape_says}."] * bool(verdict.shape_says)
    if verdict.outside and not reason.endswith(outside := outside_sentence([one.as_dict() for one in verdict.outside])):
        says.append(outside)
    return "\n".join(
        [*lines, verdict.accuracy["statement"], *says, f"verdict: {verdict.verdict}{reason}", *_reserve(verdict)]
    )


def _outside(row: dict) -> str:
    """How far the judge from outside is off at a speed [nm]."""
    return f"{row['outside']['difference_nm']:.2g}" if "outside" in row else ""


def _beside(verdict: str, outside: str, rows: list[dict]) -> str:
    """A verdict, and beside it what is said from outside where that was asked."""
    return f"{verdict:<13}  {outside:>10}" if any("outside" in row for row in rows) else verdict


def _reserve(verdict: "Verdict") -> list[str]:
    """How far beyond the scene's band the cam keeps its limits, where a band was swept."""
    scene, limits = verdict.scene, verdict.as_dict()["limits"]
    if verdict.band is None or scene is None or scene.operation is None:
        return []
    return reserve_sentences(limits, scene.design.model_dump() if scene.design else {}, scene.operation.band_rpm)


def _judged_speeds(band: "Band", rows: list[dict]) -> str:
    """The speeds that the worst figures are of: the band, and the listed ones that lie outside it."""
    outside = [f"{row['speed_rpm']:g}" for row in rows if not band.from_rpm <= row["speed_rpm"] <= band.to_rpm]
    listed = f" and at {', '.join(outside)} r/min" if outside else ""
    return f"{band.from_rpm:g} to {band.to_rpm:g} r/min{listed}"


def _line(row: dict, last: str = "") -> str:
    """One row of `text`: a figure that is null shows as "none", and one that the row does not have as blank."""
    cells = []
    for name, (_, width) in TEXT.items():
        value = row.get(name, "")
        shown = "none" if value is None else value if isinstance(value, str) else f"{value:.5g}"
        cells.append(f"{shown:>{width}}")
    return ("  ".join(cells) + f"  {last}").rstrip()


def html(verdict: "Verdict") -> str:
    """The verdict, what is broken, and a row for each speed that all methods looked at."""
    from pandas import DataFrame

    record = verdict.as_dict()
    rows = [*record["speeds"], *record["worst_in_band"]]
    table = DataFrame({label: [row[name] for row in rows] for name, label in COLUMNS.items()})
    if verdict.outside:
        table["from outside, off by [nm]"] = [_outside(row) for row in rows]
    shown = table.to_html(index=False, float_format="{:.4g}".format, na_rep="never seats")
    return f"<p><b>{escape(verdict.verdict)}</b> {escape(verdict.reason)}</p>{shown}"


def figure(verdict: "Verdict") -> "Figure":
    """Bounce and jump against speed: over the band where one was swept, and at the listed speeds otherwise.

    The curve has a gap where the valve never seats.
    """
    from camopt.plots import Sweep, bounce_against_speed

    scene = verdict.scene
    assert scene is not None and scene.operation is not None, "`verify` saw to it"
    first = [next(iter(s.methods.values())) for s in verdict.speeds]
    listed = [s.speed_rpm for s in verdict.speeds]
    starts, worst = None, {}
    if verdict.band is None:
        speeds = np.array(listed)
        bounce, jump = (np.array([m.worst[name] for m in first]) for name in ("bounce_mm", "jump_mm"))
    else:
        speeds, swept = verdict.band.speeds_rpm, verdict.band.figures
        bounce, jump = swept["bounce_mm"], swept.get("jump_mm", np.full(len(speeds), np.nan))
        starts = {metric: getattr(verdict, key) for key, metric in STARTS.items()}
        worst = {name: verdict.band.worst(name) for name in starts}
    order = np.argsort(speeds)
    sweep = Sweep(verdict.cam, speeds[order], bounce[order], jump[order], starts_rpm=starts, worst=worst)
    return bounce_against_speed([sweep], scene.design, scene.operation.band_rpm, listed)
