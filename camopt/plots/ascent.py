"""The course of a gradient ascent: its objective, the area, and what the judge says of it."""

import numpy as np
from matplotlib.figure import Figure

from camopt.plots.style import DESIGN, cam_line, draw_limit, new_figure, styled

SHOWN = 3.0
"""Shares of a limit beyond which the axis ends: how far a limit is broken there does not matter."""


@styled
def course(
    objective: np.ndarray,
    area_ratio: np.ndarray,
    share: np.ndarray,
    holds: np.ndarray,
    *,
    best: int | None,
    title: str = "",
) -> Figure:
    """Draws objective and area ratio (n) over the steps, and the judged shares of the limits (n, NaN: not judged).

    `best` is the step of the best cam, None where none holds every limit.
    """
    figure = new_figure(7.6, 6.0)
    value, area, judged = figure.subplots(3, 1, sharex=True)
    step, colour = np.arange(len(objective)), cam_line(DESIGN)["color"]
    value.plot(step, objective, color=colour)
    value.set_ylabel("objective [-]")
    area.plot(step, area_ratio, color=colour)
    if best is not None:
        area.plot(step[best], area_ratio[best], "o", color=colour, markersize=6, label="best")
        area.legend()
    area.set_ylabel("area ratio [-]")
    seen = ~np.isnan(share)
    shown = np.minimum(share, SHOWN)
    for keep, face in ((seen & holds, colour), (seen & ~holds, "white")):
        judged.plot(step[keep], shown[keep], "o", color=colour, markerfacecolor=face, markersize=4, clip_on=False)
    draw_limit(judged, 1.0, "limit")
    judged.set_ylim(0.0, min(SHOWN, 1.1 * max(1.0, float(shown[seen].max(initial=0.0)))))
    judged.set_ylabel("largest used share [-]")
    judged.set_xlabel("step")
    value.set_title(title)
    return figure
