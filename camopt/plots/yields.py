"""Figures of trains as built: used share of each limit over the speed, and the effect of each tolerance."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from camopt.plots.style import DESIGN_LINE, draw_limit, legend_above, new_figure, styled

SHOWN = 2.0
"""Largest used share of a limit on the axis; how far beyond it a limit is exceeded does not matter."""
RANGES = ((5, 95, 0.18), (25, 75, 0.3))
"""Lower and upper percentile of each shaded range, and the opacity of its shade."""
COLOUR = DESIGN_LINE[0]


@styled
def used_against_speed(speeds_rpm: np.ndarray, used: Mapping[str, np.ndarray], title: str) -> Figure:
    """Draws for each limit the shares (t, s) used by the trains over the crankshaft speeds (s): median, percentile
    ranges and the worst train."""
    figure = new_figure(7.6, 0.9 + 1.7 * len(used))
    grid = figure.subplots(len(used), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (limit, parts) in zip(grid, used.items(), strict=True):
        bounded = np.minimum(parts, 10 * SHOWN)  # percentiles need finite values
        for low, high, depth in RANGES:
            ends = np.percentile(bounded, (low, high), axis=0)
            label = f"{high - low} % of the trains"
            axes.fill_between(speeds_rpm, *ends, color=COLOUR, alpha=depth, linewidth=0, label=label)
        axes.plot(speeds_rpm, np.median(bounded, axis=0), color=COLOUR, label="median")
        axes.plot(speeds_rpm, bounded.max(axis=0), ".", color="#444444", label="worst train", clip_on=True)
        draw_limit(axes, 1.0, "limit")
        axes.set_ylim(0.0, min(SHOWN, 1.1 * max(1.05, float(bounded.max()))))
        axes.set_ylabel("used part [-]")
        axes.set_title(f"{title}\n{limit}" if axes is grid[0] else limit)
    grid[-1].set_xlabel("crankshaft speed [r/min]")
    legend_above(figure, grid[0])
    return figure


@styled
def blame_bars(blame: Mapping[str, float], bought: Mapping[str, float]) -> Figure:
    """Draws for each tolerance its part in the trains' scatter and, where known, the gain of yield by halving it."""
    labels = list(blame)[::-1]
    figure = new_figure(7.6, 1.3 + 0.3 * max(len(labels), 1))
    panels = [(blame, "part in the scatter [%]")] + (
        [(bought, "gain by halving it [% of the trains]")] if bought else []
    )
    for axes, (values, words) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        axes.barh(range(len(labels)), [100 * values.get(label, 0.0) for label in labels], color=COLOUR, height=0.6)
        axes.set_yticks(range(len(labels)), labels)
        axes.axvline(0.0, color="#777777", linewidth=0.7)
        axes.set_xlabel(words)
    return figure


@styled
def price_bars(
    left_out: Mapping[str, float],
    halved: Mapping[str, float],
    noise: float,
    worth: Mapping[str, float],
    worth_noise: float,
) -> Figure:
    """Draws for each tolerance the change of the area ratio where it is left out or halved, and the change for one per
    cent more of the numbers that it moves, each with a standard error."""
    labels = sorted(left_out or halved, key=lambda label: (left_out or halved)[label])
    figure = new_figure(7.6, 1.5 + 0.42 * max(len(labels), 1))
    both, raised = figure.subplots(1, 2, sharey=True)
    rows = np.arange(len(labels))
    for axes, values, error, place, height, label, depth in (
        (both, left_out, noise, 0.2, 0.38, "left out", 1.0),
        (both, halved, noise, -0.2, 0.38, "halved", 0.45),
        (raised, worth, worth_noise, 0.0, 0.5, "", 1.0),
    ):
        drawn = [i for i, name in enumerate(labels) if name in values]
        widths = [values[labels[i]] for i in drawn]
        axes.barh(rows[drawn] + place, widths, height, color=COLOUR, alpha=depth, label=label or None)
        axes.errorbar(widths, rows[drawn] + place, xerr=error, fmt="none", ecolor="#444444", elinewidth=0.8)
        axes.axvline(0.0, color="#777777", linewidth=0.7)
    both.set_yticks(rows, labels)
    both.set_xlabel("change of the area ratio [-]")
    raised.set_xlabel("change for 1 % more of its numbers [-]")
    legend_above(figure, both)
    return figure
