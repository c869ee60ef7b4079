"""How a verdict shows itself: a table by speed for a notebook, and bounce and jump against speed as a figure."""

from html import escape
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from camopt.verify.verdict import Verdict

COLUMNS = {
    "speed_rpm": "speed [r/min]",
    "bounce_mm": "bounce [mm]",
    "bounce_error_mm": "error of bounce [mm]",
    "jump_mm": "jump [mm]",
    "seating_velocity_m_per_s": "seating velocity [m/s]",
    "contact_force_max_N": "peak contact force [N]",
    "verdict": "verdict",
}


def html(verdict: "Verdict") -> str:
    """The verdict, what is broken, and a row for each speed that all methods looked at."""
    from pandas import DataFrame

    rows = [s.as_dict() for s in (*verdict.speeds, *verdict.worst_in_band)]
    table = DataFrame({label: [row[name] for row in rows] for name, label in COLUMNS.items()})
    broken = f"; broken: {escape(', '.join(verdict.broken))}" if verdict.broken else ""
    shown = table.to_html(index=False, float_format="{:.4g}".format, na_rep="never seats")
    return f"<p><b>{escape(verdict.verdict)}</b>{broken}</p>{shown}"


def figure(verdict: "Verdict") -> "Figure":
    """Bounce and jump over the band where one was swept, at the listed speeds otherwise; NaN where never seated."""
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
        starts = {"bounce_mm": verdict.first_bounce_rpm, "jump_mm": verdict.first_jump_rpm}
        worst = {name: verdict.band.worst(name) for name in starts}
    order = np.argsort(speeds)
    sweep = Sweep(verdict.cam, speeds[order], bounce[order], jump[order], starts_rpm=starts, worst=worst)
    return bounce_against_speed([sweep], scene.design, scene.operation.band_rpm, listed)
