"""The figure of `outside_judges`: the valve from rest, and below it how far the judge from outside is off."""

import numpy as np
from matplotlib.figure import Figure

from camopt.plots.style import new_figure, styled
from camopt.scene.units import MM


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
