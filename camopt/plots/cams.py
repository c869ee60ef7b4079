"""The lift laws of cams over each other, with the design's limits."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from camopt.plots.style import BASE, SHADE, cam_lines, draw_limit, legend_above, new_figure, quoted, styled, write
from camopt.scene.design import Design

Table = Mapping[str, np.ndarray]
CURVES = (
    ("lift_mm", "lift [mm]"),
    ("velocity_mm_per_deg", "velocity\n[mm/deg]"),
    ("acceleration_mm_per_deg2", "acceleration\n[mm/deg²]"),
    ("jerk_mm_per_deg3", "jerk\n[mm/deg³]"),
)
JERK_SPAN = 2.5
"""The jerk axis ends at this many times the limit, because the steps of a family without a jerk limit would flatten all
other curves."""


@styled
def profiles(cams: Sequence[tuple[str, Table]], design: Design | None = None) -> Figure:
    """Lift, velocity, acceleration and jerk against cam angle.

    `cams` holds for each cam its name and the columns of `camopt.cam.lift.lift_table`. Where a `design` is given, its
    limits are drawn, its duration as thin lines, and its nose, where no acceleration may be positive, as a shade.
    """
    figure = new_figure(7.6, 8.6)
    rows = figure.subplots(4, 1, sharex=True, height_ratios=(1.5, 1, 1.15, 1.15))
    lines = cam_lines(name for name, _ in cams)
    for axes, (column, label) in zip(rows, CURVES, strict=True):
        for name, table in cams:
            axes.plot(table["cam_angle_deg"], table[column], label=name, **lines[name])
        axes.set_ylabel(label)
    legend_above(figure, rows[0])
    rows[0].set_ylim(bottom=0)
    rows[3].set_xlabel("cam angle [deg]")
    if design is not None:
        _conditions(rows, cams, design)
    return figure


def _conditions(rows: Sequence[Axes], cams: Sequence[tuple[str, Table]], design: Design) -> None:
    """Draws the design's duration and limits, and lets the axes end where its event does."""
    for axes in rows:
        for angle in (-design.duration_deg / 2, design.duration_deg / 2):
            axes.axvline(angle, color="#999999", linewidth=0.7, zorder=1)
    _limits(rows, design)
    if design.jerk_max_mm_per_deg3 is not None:
        _shorten(rows[3], cams, JERK_SPAN * design.jerk_max_mm_per_deg3)
    end = design.duration_deg / 2 + max(h / v for h, v, _ in design.ramps()) + design.ramp_foot_deg / 2 + 2
    lifted = [float(np.abs(table["cam_angle_deg"][table["lift_mm"] > 0]).max(initial=0.0)) for _, table in cams]
    end = max(end, *lifted)  # a cam longer than the design shows whole
    rows[3].set_xlim(-end, end)
    rows[3].set_xlabel(f"cam angle [deg];  thin lines: duration {design.duration_deg:g} deg")


def _limits(rows: Sequence[Axes], design: Design) -> None:
    draw_limit(
        rows[0], design.max_lift_mm, quoted("reach" if design.reach_max_lift else "at most", design.max_lift_mm, "mm")
    )
    low, high = design.acceleration_min_mm_per_deg2, design.acceleration_max_mm_per_deg2
    draw_limit(rows[2], high, quoted("at most", high, ""))
    draw_limit(rows[2], low, quoted("at least", low, ""))
    jerk = design.jerk_max_mm_per_deg3
    if jerk is not None:
        draw_limit(rows[3], jerk, quoted("at most", jerk, ""))
        draw_limit(rows[3], -jerk, quoted("at least", -jerk, ""))
    for axes in rows[2:]:
        axes.margins(y=0.14)  # room for the nose's words
    if design.nose_deg is not None:
        rows[2].axvspan(-design.nose_deg, design.nose_deg, ymin=0, ymax=1, color=SHADE, zorder=0)
        how = {"ha": "center", "va": "top", "fontsize": BASE - 1.5, "color": "#555555"}
        write(rows[2], "nose: no positive acceleration", (0, 0.97), (0, 0), over=rows[2].get_xaxis_transform(), **how)


def _shorten(axes: Axes, cams: Sequence[tuple[str, Table]], span: float) -> None:
    """Ends the jerk axis at +-span and says which cams go beyond."""
    largest = [(name, float(np.max(np.abs(table["jerk_mm_per_deg3"])))) for name, table in cams]
    beyond = ", ".join(f"{name} to ±{jerk:.2g}" for name, jerk in largest if jerk > span)
    if beyond:
        axes.set_ylim(-span, span)
        axes.set_title(f"beyond this axis: {beyond}", fontsize=BASE - 1.5, fontweight="normal")
