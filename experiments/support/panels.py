"""A grid of panels with curves over one abscissa; a label has the same colour in all panels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from camopt.plots.style import cam_line, family_of, legend_above, lines, new_figure, styled

POINTS = {"linestyle": "none", "marker": "o", "markersize": 3}
"""Line properties of a curve that is drawn as points."""
DASHED = {"linestyle": (0, (5, 3))}


@dataclass(frozen=True)
class Panel:
    """The curves of one panel, each with its label, abscissa (k) and ordinate (k)."""

    ylabel: str
    curves: Sequence[tuple[str, Any, Any]]
    title: str = ""
    ylim: tuple[float, float] | None = None


@styled
def panels(
    rows: Sequence[Sequence[Panel]],
    xlabel: str,
    xlim: tuple[float, float] | None = None,
    width: float = 7.6,
    row_height: float = 1.6,
    *,
    sharey: bool = False,
    scale: tuple[str, str] = ("linear", "linear"),
    marker: str = "",
    look: Mapping[str, Mapping] | None = None,
) -> Figure:
    """Draws rows of panels over a shared abscissa, with one legend, and a line at zero on a linear ordinate.

    Cam families have their usual colours; other labels get colours in the order of their first appearance. `marker` is
    that of all curves, `scale` that of abscissa and ordinate, and `look` has further line properties by label.
    """
    labels = list(dict.fromkeys(label for row in rows for panel in row for label, _, _ in panel.curves))
    line = {
        label: {"marker": marker, "markersize": 3} | line_look | (look or {}).get(label, {})
        for label, line_look in _lines(labels).items()
    }
    figure = new_figure(width, 0.9 + row_height * len(rows))
    grid = figure.subplots(len(rows), len(rows[0]), sharex=True, sharey="row" if sharey else False, squeeze=False)
    for axes_row, row in zip(grid, rows, strict=True):
        for axes, panel in zip(axes_row, row, strict=True):
            for label, x, y in panel.curves:
                axes.plot(x, y, **line[label])
            axes.set(title=panel.title, ylabel=panel.ylabel, xscale=scale[0], yscale=scale[1])
            if panel.ylim is not None:
                axes.set_ylim(panel.ylim)
            if scale[1] == "linear":
                axes.axhline(0, color="#777777", linewidth=0.7, zorder=1)
    for axes in grid[-1]:
        axes.set_xlabel(xlabel)
    if xlim is not None:
        grid[0, 0].set_xlim(xlim)
    for label in labels:  # lines for the legend: not every panel has every label
        grid[0, 0].plot([], [], label=label, **line[label])
    figure.align_ylabels()
    legend_above(figure, grid[0, 0], 6)
    return figure


def _lines(labels: Sequence[str]) -> dict[str, dict]:
    """Line properties by label: cams as in all figures, other labels in colours that no cam of this figure has."""
    families = {family_of(label) for label in labels}
    free = [colour for family, (colour, _) in lines().items() if family not in families]
    looks, taken = {}, 0
    for label in labels:
        if family_of(label):
            looks[label] = cam_line(label)
            continue
        dashes = ("-", (0, (5, 1.3)), (0, (2, 1)))[taken // len(free) % 3]
        looks[label] = {"color": free[taken % len(free)], "linestyle": dashes, "linewidth": 1.1}
        taken += 1
    return looks
