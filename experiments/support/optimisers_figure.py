"""The figure of `experiments.optimisers`: confirmed area against processor time, beside that of the linear program."""

from textwrap import wrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from camopt.plots.style import new_figure, styled

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#9A6A00", "#7A3B69", "#555555", "#CC3311")
DASHES = {"Adam": "-", "L-BFGS": "--", "gradient": ":"}
STARTS: dict[str, str] = dict(zip(("polydyne", "multi-pol", "program"), COLOURS, strict=False))
LINEAR = 1e-3
"""Difference of the area ratio up to which the scale is linear."""
TICKS = (-0.3, -0.1, -0.03, -0.01, -0.003, -0.001, 0.0, 0.001, 0.003, 0.01, 0.03)
SMALL_PRINT = {"fontsize": 6.5, "title_fontsize": 6.5, "frameon": True, "edgecolor": "none", "framealpha": 0.9}
PATHS = ("exact gradients", "smooth gradients")


@styled
def figure(found: dict[str, dict[str, list[dict]]], budget: float) -> Figure:
    """A row of panels for each scene: ascents by exact and by smooth gradients, and all other methods.

    A line is the median of the seeds from where all of them have a confirmed cam, and the band their spread.
    """
    drawn = new_figure(11.0, 3.6 * len(found))
    panels = drawn.subplots(len(found), 3, squeeze=False, sharex=True, sharey="row")
    for row, (scene, methods) in zip(panels, found.items(), strict=True):
        groups = [{n: rows for n, rows in methods.items() if path in n} for path in PATHS]
        groups.append({n: rows for n, rows in methods.items() if not any(path in n for path in PATHS)})
        for axes, title, group in zip(row, (*PATHS, "programs and searches"), groups, strict=True):
            looks = {name: look(name, i) for i, name in enumerate(group)}
            none = [looks[name]["label"] for name, rows in group.items() if not any(row["gains"] for row in rows)]
            for name, rows in group.items():
                course(axes, rows, budget, **looks[name])
            axes.set_title(f"{scene}: {title}")
            finish(axes, bool(group), none)
    for axes in panels[:, 0]:
        axes.set_ylabel("confirmed area ratio, less the program's [-]")
    for axes in panels[-1]:
        axes.set_xlabel("processor time [s]")
    return drawn


def look(name: str, number: int) -> dict:
    """Label, colour and dashes of a method."""
    method, _, start = name.partition(", ")
    if method in DASHES:
        start = start.rpartition(" ")[2]
        return {"label": f"{method} from {start}", "color": STARTS[start], "linestyle": DASHES[method]}
    return {"label": name, "color": COLOURS[number % len(COLOURS)], "linestyle": ("-", "--", "-.")[number % 3]}


def course(axes: Axes, rows: list[dict], budget: float, **style) -> None:
    """One method's area against time."""
    time = np.linspace(0.0, budget, 801)
    areas = np.array([held(row["gains"], time) for row in rows])
    if not np.isfinite(areas).any():
        return
    everywhere = np.flatnonzero(np.isfinite(areas).all(axis=0))
    some = f" ({sum(np.isfinite(one).any() for one in areas)} of {len(areas)})"
    label = style["label"] if len(everywhere) else style["label"] + some
    if len(everywhere):
        middle, low, high = (f(areas[:, everywhere], axis=0) for f in (np.median, np.min, np.max))
        axes.fill_between(time[everywhere], low, high, color=style["color"], alpha=0.15, linewidth=0)
        axes.plot(time[everywhere], middle, **style | {"label": label})
        return
    for i, one in enumerate(areas[np.isfinite(areas).any(axis=1)]):  # some seeds alone
        axes.plot(time, one, **style | {"label": label if i == 0 else None, "alpha": 0.6})


def held(stairs: list, time: np.ndarray) -> np.ndarray:
    """The largest confirmed area until each second; NaN before there is one."""
    at, areas = np.array(stairs, dtype=float).reshape(-1, 2).T
    return np.append(np.nan, areas)[np.searchsorted(at, time, side="right")]


def finish(axes: Axes, used: bool, none: list[str]) -> None:
    """The scale, the legend, and words where nothing was confirmed or tried."""
    axes.set_yscale("symlog", linthresh=LINEAR, linscale=2.0)
    axes.set_yticks(TICKS, [f"{tick:+g}" if tick else "0" for tick in TICKS])
    axes.minorticks_off()
    if axes.has_data():
        words = "\n".join(wrap("none confirmed: " + ", ".join(none), 60)) if none else None
        axes.legend(title=words, loc="lower center", bbox_to_anchor=(0.57, 0.14), ncols=2, **SMALL_PRINT)
    if not used:
        axes.text(0.5, 0.5, "not tried", transform=axes.transAxes, ha="center")
