"""Parameters identified from a measured lift, drawn as factors with their intervals, and the residual."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from camopt.plots.style import INK, LIMIT, OTHERS, new_figure, styled


@styled
def identification(table: xr.Dataset, speeds_rpm: Sequence[float], angles_deg, residuals_um, noise_um: float) -> Figure:
    """Draws the estimates over their start values with intervals, and the residual (m) of each series.

    A parameter that was not identified is a cross at its start value, without an interval.
    """
    figure = new_figure(9.6, 1.6 + 0.32 * max(table.sizes["parameter"], 6))
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.4))
    rows = np.arange(table.sizes["parameter"])
    ratio, low, high = (table[k].values / table["start"].values for k in ("estimate", "low", "high"))
    known = table["identified"].values
    ends = np.sort(np.stack([low, high])[:, known], axis=0)
    left.hlines(rows[known], *ends, color=INK)
    left.plot(ratio[known], rows[known], "o", color=INK, markersize=4)
    left.plot(np.ones(int(np.sum(~known))), rows[~known], "x", color=LIMIT, markersize=5, label="not identified")
    left.set_yticks(rows, table["parameter"].values)
    left.invert_yaxis()
    left.set_xlabel("estimate over start value")
    if np.any(~known):
        left.legend(loc="lower left", bbox_to_anchor=(0, 1))
    for i, (speed, angle, residual) in enumerate(zip(speeds_rpm, angles_deg, residuals_um, strict=True)):
        right.plot(angle, residual, color=OTHERS[i % len(OTHERS)], linewidth=0.6, label=f"{speed:g} r/min")
    right.set(xlabel="cam angle [deg]", ylabel="computed less measured [µm]", title=f"noise {noise_um:.3g} µm")
    right.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=len(residuals_um), columnspacing=1.0)
    return figure
