"""Figures of an optimisation over its steps: of a search, and of a gradient ascent."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from camopt.plots.speeds import scale_symlog
from camopt.plots.style import DESIGN, INK, LIMIT, cam_line, draw_limit, new_figure, styled, write

SHOWN_SHARE = 3.0
"""Largest used share of a limit on the axis of an ascent; how far beyond it a limit is exceeded does not matter."""
ROWS = 6
"""Number of rows for the names of stages above the axes."""
HOLDING = "holds at the searched speeds", "a limit broken or not measured"
KEPT = "largest so far that enough trains hold", "not kept"
"""Labels of filled and hollow steps: `HOLDING` for a search under the limits, `KEPT` for a search for a yield."""
NEAR_BOUND = 1.0
"""A bound that is further above the steps than this multiple of their range is not drawn as a line."""


@styled
def convergence(
    steps: Sequence[Mapping],
    bound: float | None = None,
    no_jump: float | None = None,
    bounce_max_mm: float | None = None,
    delivered: tuple[float, str] | None = None,
) -> Figure:
    """Draws area ratio and worst bounce of every step, filled where it holds the limits, with the certified bound as a
    line where it is near. A search for a yield has the percentage of failing trains in place of the bounce.

    `steps` are the lines of history.jsonl, in which the best area ratio falls where a cam is rejected later. `bound` is
    the area ratio that no cam of the kinematic problem exceeds, `no_jump` the one that the no-jump linear program
    reached under its linear model, and `delivered` the area ratio of the delivered cam and its verdict.
    """
    figure = new_figure(7.6, 5.6)
    area, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1))
    step, colour = np.arange(1, len(steps) + 1), cam_line(DESIGN)["color"]
    confirmed = np.array([line["confirmed"] for line in steps], dtype=bool)
    of_yield = any("failing" in line for line in steps)
    below = (
        100 * _column(steps, "failing") / _column(steps, "trains") if of_yield else _column(steps, "worst_bounce_mm")
    )
    filled, hollow = KEPT if of_yield else HOLDING
    for axes, values in ((area, _column(steps, "area_ratio")), (lower, below)):
        axes.plot(step, values, color="#bbbbbb", linewidth=0.8, zorder=2)
        dots: dict = {"linestyle": "none", "marker": "o", "color": colour, "markersize": 4, "zorder": 3}
        axes.plot(step[confirmed], values[confirmed], label=filled, **dots)
        dots["markerfacecolor"] = "white"
        axes.plot(step[~confirmed], values[~confirmed], label=hollow, **dots)
    best = _column(steps, "best_area_ratio")
    if np.isfinite(best).any():
        area.step(step, best, where="post", color=colour, linewidth=2, label="best of the search", zorder=2.5)
    if delivered is not None:
        value, verdict = delivered
        area.plot(len(step), value, "D", color=INK, markersize=6, label=f"delivered, {verdict}: {value:.4f}", zorder=4)
    if bound is not None:
        _bound(area, bound)
    draw_limit(area, no_jump, "no-jump\nprogram\n{:.4f}", va="top")
    area.set_ylabel("area ratio [-]")
    area.margins(y=0.12)
    area.legend(loc="best")
    if not of_yield:
        scale_symlog(lower, bounce_max_mm)
        lower.set_ylabel("worst bounce [mm]")
        draw_limit(lower, bounce_max_mm, "at most\n{:g} mm")
    else:
        lower.set_ylabel("failing trains [%]")
        lower.set_ylim(bottom=0.0)
    lower.set_xlabel("step")
    lower.xaxis.set_major_locator(MaxNLocator(integer=True))
    _stages(area, lower, [line["stage"] for line in steps])
    return figure


def _column(steps: Sequence[Mapping], key: str) -> np.ndarray:
    """Values (n) of the steps under a key, NaN where a step has none."""
    return np.array([np.nan if line.get(key) is None else line[key] for line in steps], dtype=float)


def _bound(area: Axes, bound: float) -> None:
    """Draws the certified bound as a line where it is near the steps; a distant one, which would flatten them, is given
    as text."""
    seen = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in area.lines])
    low, high = np.nanmin(seen), np.nanmax(seen)
    if bound - high <= NEAR_BOUND * (high - low):
        draw_limit(area, bound, "certified\nbound\n{:.4f}", va="bottom")
        return
    words = f"certified bound {bound:.4f}, above this axis ↑"
    write(area, words, (0.99, 0.985), (0, 0), over="axes fraction", ha="right", va="top", color=LIMIT)


def _stages(area: Axes, lower: Axes, stage: Sequence[str]) -> None:
    """Writes the name of each stage above its steps, in a separate row, with a line at its beginning. In the later half
    the name is on the left of that line, so that it ends inside the figure."""
    begins = [i for i in range(len(stage)) if i == 0 or stage[i] != stage[i - 1]]
    for row, i in enumerate(begins):
        late = i > len(stage) / 2
        for axes in (area, lower):
            axes.axvline(i + 0.5, color="#999999", linewidth=0.7, zorder=1)
        at, offset = (i + (0.4 if late else 0.6), 1.0), (0, 3 + 10 * (row % ROWS))
        write(area, stage[i], at, offset, over=area.get_xaxis_transform(), ha="right" if late else "left")
    for axes in (area, lower):
        axes.set_xlim(0.5, len(stage) + 0.5)


@styled
def course(
    objective: np.ndarray,
    area_ratio: np.ndarray,
    share: np.ndarray,
    holds: np.ndarray,
    *,
    best: int | None,
    title: str,
) -> Figure:
    """Draws objective and area ratio (n) over the steps, and the largest used share of a limit (n, NaN: not computed);
    `best` is the step of the best cam, None where none holds every limit."""
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
    shown = np.minimum(share, SHOWN_SHARE)
    for keep, face in ((seen & holds, colour), (seen & ~holds, "white")):
        judged.plot(step[keep], shown[keep], "o", color=colour, markerfacecolor=face, markersize=4, clip_on=False)
    draw_limit(judged, 1.0, "limit")
    judged.set_ylim(0.0, min(SHOWN_SHARE, 1.1 * max(1.0, float(shown[seen].max(initial=0.0)))))
    judged.set_ylabel("largest used share [-]")
    judged.set_xlabel("step")
    value.set_title(title)
    return figure
