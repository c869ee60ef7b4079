"""Bounce and jump of cams over a band of speeds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from camopt.plots.style import (
    BASE,
    SHADE,
    cam_line,
    draw_limit,
    legend_above,
    new_figure,
    quoted,
    styled,
    zero_and_decades,
)
from camopt.scene.quantities import QUANTITIES
from camopt.scene.schema import Design

FINEST_MM = 0.01
"""The axis is linear below this value and logarithmic above it, because a bounce or jump of zero must be seen."""
NUMBER_WIDTH = 0.08
"""Width of a speed's number as a share of the axes."""


@dataclass(frozen=True)
class Sweep:
    """Bounce and jump of one cam at k crankshaft speeds; NaN where the valve never seats."""

    cam: str
    speed_rpm: np.ndarray  # (k) ascending
    bounce_mm: np.ndarray  # (k)
    jump_mm: np.ndarray  # (k)
    bounce_low_mm: np.ndarray | None = None  # (k) range over neighbouring states, speeds and lifts
    bounce_high_mm: np.ndarray | None = None  # (k)


@styled
def bounce_against_speed(
    sweeps: Sequence[Sweep],
    design: Design | None,
    band_rpm: tuple[float, float],
    speeds_rpm: Sequence[float] = (),
) -> Figure:
    """Draws bounce and jump against speed with their limits; the band is shaded, the `speeds_rpm` judged are marked."""
    figure = new_figure(7.6, 5.8)
    rows = figure.subplots(2, 1, sharex=True)
    for axes, key in zip(rows, ("bounce_mm", "jump_mm"), strict=True):
        quantity = QUANTITIES[key]
        limit = getattr(design, quantity.limit or "", None)
        for s in sweeps:
            _draw(axes, s, key)
        _mark_starts(axes, sweeps, key, limit)
        axes.set_ylabel(f"{quantity.label} [{quantity.unit}]")
        draw_limit(axes, limit, quoted("at most", limit, "mm"))
        zero_and_decades(axes, limit, FINEST_MM)
        axes.axvspan(*band_rpm, color=SHADE, zorder=0)
        axes.plot(
            list(speeds_rpm),
            [0] * len(speeds_rpm),
            "^",
            color="#444444",
            markersize=6,
            clip_on=False,
            transform=axes.get_xaxis_transform(),
            zorder=5,
        )
    rows[0].set_title(f"shaded: band {band_rpm[0]:g} to {band_rpm[1]:g} r/min;  ▲ speeds of the verdict;  "
                      "◆ where a cam first passes the limit",
                      fontsize=BASE - 1, fontweight="normal")  # fmt: skip
    rows[1].set_xlabel("crankshaft speed [r/min]")
    legend_above(figure, rows[0])
    return figure


def first_passed(speed_rpm: np.ndarray, values: np.ndarray, limit: float) -> float | None:
    """Speed [r/min] at which the drawn curve first rises above the limit, or None where it never does.

    A speed without a value, at which the valve never seats, counts as above the limit.
    """
    above = ~(np.asarray(values, dtype=float) <= limit)
    if not above.any():
        return None
    i = int(np.argmax(above))
    if i == 0 or np.isnan(values[i]):
        return float(speed_rpm[i])
    return float(np.interp(limit, values[i - 1 : i + 1], speed_rpm[i - 1 : i + 1]))


def _mark_starts(axes: Axes, sweeps: Sequence[Sweep], key: str, limit: float | None) -> None:
    """Marks the speeds from which cams float or bounce by a diamond on the limit, with the speed to 10 r/min beside it.

    The number stands on the left of its diamond, or on the right where another diamond is near on the left.
    """
    if limit is None:
        return
    found = [(first_passed(s.speed_rpm, getattr(s, key), limit), s.cam) for s in sweeps]
    before = -np.inf
    for at, cam in sorted((at, cam) for at, cam in found if at is not None):
        colour, left = cam_line(cam)["color"], at - before > NUMBER_WIDTH * np.ptp(sweeps[0].speed_rpm)
        before = at
        axes.plot(at, limit, "D", color=colour, markersize=6, markeredgecolor="white", zorder=6)
        axes.annotate(
            f"≈{round(at, -1):.0f}",
            (at, limit),
            xytext=(-5 if left else 5, 5),
            textcoords="offset points",
            ha="right" if left else "left",
            color=colour,
            fontsize=BASE - 1,
            bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.5},
        )


def _draw(axes: Axes, sweep: Sweep, key: str) -> None:
    line = cam_line(sweep.cam)
    values = np.asarray(getattr(sweep, key), dtype=float)
    few = len(values) <= 12
    axes.plot(sweep.speed_rpm, values, label=sweep.cam, marker="o" if few else "", markersize=3.5, **line)
    if key != "bounce_mm":
        return
    if sweep.bounce_low_mm is not None and sweep.bounce_high_mm is not None:
        axes.fill_between(
            sweep.speed_rpm,
            sweep.bounce_low_mm,
            sweep.bounce_high_mm,
            color=line["color"],
            alpha=0.2,
            linewidth=0,
            label=f"{sweep.cam}: range",
        )
    lost = np.asarray(sweep.speed_rpm)[np.isnan(values)]
    if len(lost):
        axes.plot(
            lost,
            np.full(len(lost), 0.97),
            "x",
            color=line["color"],
            transform=axes.get_xaxis_transform(),
            label=f"{sweep.cam}: never seats",
        )
