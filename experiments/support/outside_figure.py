"""Figures of `outside_judges`: the valve from rest and how far Exudyn is off, and what Siconos gains by halving."""

import numpy as np
from matplotlib.figure import Figure

from camopt.plots.style import new_figure, styled
from camopt.scene.units import MM

COLOURS = "#0072B2", "#D55E00", "#009E73", "#B0518E", "#E69F00", "#56B4E9"
"""By scene."""


@styled
def motion_figure(cases: list[dict]) -> Figure:
    """A column for each motion; its two revolutions from rest one after the other."""
    drawing = new_figure(9.6, 4.2)
    axes = np.atleast_2d(drawing.subplots(2, len(cases), sharex=True, height_ratios=(3, 2)))
    for (above, below), case in zip(axes.T, cases, strict=True):
        revolutions, samples = case["valve_m"].shape
        angle = np.concatenate([np.linspace(-180, 180, samples) + 360 * r for r in range(revolutions)])
        above.plot(angle, case["valve_m"].ravel() / MM, color="#0072B2")
        below.plot(angle, case["off_nm"].ravel(), color="#D55E00")
        above.set(title=case["title"])
        below.set(xlabel="cam angle [deg]", xticks=np.arange(-180, 360 * revolutions - 179, 180))
    axes[0, 0].set_ylabel("valve, from rest [mm]")
    axes[1, 0].set_ylabel("Exudyn less camopt [nm]")
    return drawing


@styled
def halvings_figure(rows: list[dict]) -> Figure:
    """How far Siconos's valve is off against its step, a line for each undamped motion, over the slope of order two."""
    drawing = new_figure(5.6, 3.8)
    axes = drawing.subplots()
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    for row in rows:
        i = scenes.index(row["scene"])
        first = row is next(r for r in rows if r["scene"] == row["scene"])
        us = [row["step_us"] * row["steps"] / h["steps"] for h in row["halvings"]]
        off = [h["difference_nm"] for h in row["halvings"]]
        axes.loglog(us, off, COLOURS[i], marker="o", ms=2.5, lw=0.9, label=row["scene"] if first else None)
    ends = np.array(axes.get_xlim())
    axes.loglog(ends, 0.05 * (ends / 0.05) ** 2, "#555555", ls="--", lw=0.8, label="order two")
    axes.set(xlabel="step [us]", ylabel="valve apart [nm]")
    axes.legend(fontsize="small")
    return drawing
