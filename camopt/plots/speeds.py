"""Bounce and jump of cams over a band of speeds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from camopt.plots.style import BASE, SHADE, cam_lines, draw_limit, legend_above, new_figure, styled, write
from camopt.scene.design import Design
from camopt.scene.quantities import QUANTITIES

FINEST_MM = 0.01
"""The axis is linear below this value and logarithmic above it, because a bounce or jump of zero must be seen."""
NUMBER_WIDTH = 0.08
"""Width of the number beside a mark as a share of the axes."""
NUMBER_HEIGHT = 1.3 * BASE
"""Height of a line of numbers [pt]."""


@dataclass(frozen=True)
class Sweep:
    """Bounce and jump of one cam at k crankshaft speeds; NaN where the valve never seats."""

    cam: str
    speed_rpm: np.ndarray  # (k) ascending
    bounce_mm: np.ndarray  # (k)
    jump_mm: np.ndarray  # (k)
    starts_rpm: Mapping[str, float | None] | None = None  # by metric: the verdict's speed of the first excess
    worst: Mapping[str, tuple[float, float | None]] = field(default_factory=dict)  # by metric: speed, value [mm]


@styled
def bounce_against_speed(
    sweeps: Sequence[Sweep],
    design: Design | None,
    band_rpm: tuple[float, float],
    speeds_rpm: Sequence[float] = (),
) -> Figure:
    """Draws bounce and jump against speed with their limits, a shaded band, and marks at the verified `speeds_rpm`."""
    figure = new_figure(7.6, 5.8)
    rows, lines = figure.subplots(2, 1, sharex=True), cam_lines(s.cam for s in sweeps)
    for axes, key in zip(rows, ("bounce_mm", "jump_mm"), strict=True):
        quantity = QUANTITIES[key]
        limit = getattr(design, quantity.limit or "", None)
        for s in sweeps:
            _draw(axes, s, key, lines[s.cam])
        _mark_starts(axes, sweeps, key, limit, lines)
        for s in sweeps:
            _mark_worst(axes, s, key, lines[s.cam]["color"])
        axes.set_ylabel(f"{quantity.label} [{quantity.unit}]")
        draw_limit(axes, limit, "at most\n{:g} mm")
        scale_symlog(axes, limit)
        axes.axvspan(*band_rpm, color=SHADE, zorder=0)
        mark = {"color": "#444444", "markersize": 6, "clip_on": False, "zorder": 5}
        axes.plot(list(speeds_rpm), [0] * len(speeds_rpm), "^", transform=axes.get_xaxis_transform(), **mark)
    rows[0].set_title(f"shaded: band {band_rpm[0]:g} to {band_rpm[1]:g} r/min;  ▲ speeds of the verdict;  "
                      "◆ where a cam first passes the limit;  ○ worst of the band",
                      fontsize=BASE - 1, fontweight="normal")  # fmt: skip
    rows[1].set_xlabel("crankshaft speed [r/min]")
    legend_above(figure, rows[0])
    return figure


def scale_symlog(axes: Axes, limit: float | None) -> None:
    """Scales a bounce or jump axis: linear from zero to `FINEST_MM`, logarithmic above; it always shows the limit."""
    shown = [line.get_ydata() for line in axes.lines if line.get_transform() == axes.transData]
    largest = max([np.nanmax(np.append(np.asarray(y, dtype=float), 0.0)) for y in shown], default=0.0)
    axes.set_yscale("symlog", linthresh=FINEST_MM, linscale=0.5, subs=[2, 5])
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_ylim(0, 1.5 * max(largest, 3 * (limit or 0.0), 10 * FINEST_MM))


def first_exceeded(speed_rpm: np.ndarray, values: np.ndarray, limit: float) -> float | None:
    """Speed [r/min] at which the drawn curve first rises above the limit, or None where it never does; a speed without
    a value, at which the valve never seats, counts as above."""
    above = ~(np.asarray(values, dtype=float) <= limit)
    if not above.any():
        return None
    i = int(np.argmax(above))
    if i == 0 or np.isnan(values[i]):
        return float(speed_rpm[i])
    return float(np.interp(limit, values[i - 1 : i + 1], speed_rpm[i - 1 : i + 1]))


def _mark_starts(axes: Axes, sweeps: Sequence[Sweep], key: str, limit: float | None, lines: Mapping[str, dict]) -> None:
    """Marks the speeds above which cams float or bounce by a diamond on the limit, or on the curve without a limit.

    Beside it is the verdict's speed or, without a verdict, that of the drawn curve, marked as approximate, to 10 r/min.
    The number is on the left, or on the right where another diamond is near on the left; then each number is higher
    than the one before.
    """
    starts = [(*_diamond(s, key, limit), s) for s in sweeps]
    before, level = -np.inf, 0  # number of close diamonds on the left
    for at, words, s in sorted(((at, w, s) for at, w, s in starts if at is not None), key=lambda one: one[0]):
        level = level + 1 if at - before <= NUMBER_WIDTH * np.ptp(sweeps[0].speed_rpm) else 0
        colour, left, before = lines[s.cam]["color"], level == 0, at
        height = float(np.interp(at, s.speed_rpm, getattr(s, key))) if limit is None else limit
        axes.plot(at, height, "D", color=colour, markersize=6, markeredgecolor="white", zorder=6)
        _number(axes, words, (at, height), (-5 if left else 5, 5 + NUMBER_HEIGHT * max(level - 1, 0)), colour)


def _diamond(sweep: Sweep, key: str, limit: float | None) -> tuple[float | None, str]:
    """Speed [r/min] of a cam's diamond and its text; None where it is outside the axes or missing."""
    if sweep.starts_rpm is None:
        at = None if limit is None else first_exceeded(sweep.speed_rpm, getattr(sweep, key), limit)
        return at, "" if at is None else f"≈{round(at, -1):.0f}"
    at = sweep.starts_rpm.get(key)
    inside = at is not None and sweep.speed_rpm[0] <= at <= sweep.speed_rpm[-1]
    return (at, f"{at:.0f}") if inside else (None, "")


def _mark_worst(axes: Axes, sweep: Sweep, key: str, colour: str) -> None:
    """Draws a circle around the worst point of the band, with its value, both as the verdict states them."""
    speed, value = sweep.worst.get(key, (0.0, None))
    if value is None:
        return
    axes.plot(speed, value, "o", color=colour, markerfacecolor="none", markersize=8, zorder=6)
    _number(axes, f"{value:.4g}", (speed, value), (-7, 6), colour)


def _number(axes: Axes, words: str, at: tuple[float, float], offset: tuple[float, float], colour: str) -> None:
    """Writes a text beside a mark, legible over the curves."""
    write(axes, words, at, offset, color=colour, bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.5})


def _draw(axes: Axes, sweep: Sweep, key: str, line: Mapping) -> None:
    values = np.asarray(getattr(sweep, key), dtype=float)
    few = len(values) <= 12
    axes.plot(sweep.speed_rpm, values, label=sweep.cam, marker="o" if few else "", markersize=3.5, **line)
    lost = np.asarray(sweep.speed_rpm)[np.isnan(values)]
    if key == "bounce_mm" and len(lost):
        mark = {"color": line["color"], "transform": axes.get_xaxis_transform()}
        axes.plot(lost, np.full(len(lost), 0.97), "x", label=f"{sweep.cam}: never seats", **mark)
