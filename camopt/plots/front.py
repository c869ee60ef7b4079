"""A front: the area that each value of a limit allows."""

import numpy as np
from matplotlib.figure import Figure

from camopt.plots.style import DESIGN, cam_line, new_figure, styled

UNITS = {"mm": "mm", "mm_per_deg2": "mm/deg²", "mm_per_deg3": "mm/deg³", "m_per_s": "m/s", "N": "N"}


@styled
def front(against: str, limit: np.ndarray, area_ratio: np.ndarray, title: str = "") -> Figure:
    """Draws the area ratio (k) over the k values of a design limit; a value without a cam is a cross on the axis."""
    figure = new_figure(5.2, 3.4)
    axes = figure.subplots()
    found = np.isfinite(area_ratio)
    axes.plot(limit[found], area_ratio[found], "o-", color=cam_line(DESIGN)["color"], markersize=4)
    if not found.all():
        axes.plot(limit[~found], np.full((~found).sum(), np.nanmin(area_ratio)), "x", color="#8a1c1c", label="no cam")
        axes.legend()
    name, unit = next((against.removesuffix(f"_{u}"), v) for u, v in list(UNITS.items())[::-1] if against.endswith(u))
    axes.set(xlabel=f"{name.replace('_', ' ')} [{unit}]", ylabel="area ratio [-]")
    axes.set_title(title)
    return figure
