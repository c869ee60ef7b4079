"""Error against time on logarithmic axes, with the Pareto front of what nothing else beats; rows of tradeoff.csv."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from camopt.plots.style import INK, new_figure, styled

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#B0518E", "#E69F00", "#56B4E9", "#7A5C2E", "#555555")
MARKERS = "osD^vP"
"""Markers of the series. There are eight colours; series that share one differ in their marker."""
PANEL = 3.5
"""Width of a panel [in]."""
NARROW = 100.0
"""An axis whose ends have a smaller ratio than this has labels at 2 and 5 too."""


Series = Mapping[str, tuple[Sequence[float], Sequence[float]]]
"""Times (k) [s] and errors (k) by the name of a series."""


@styled
def work_precision(clouds: Mapping[str, Series], xlabel: str, rivals: bool = True) -> Figure:
    """Draws a panel of error over time for each quantity, whose label is the key; an error of 0 is drawn at the floor.

    The line of a series runs through those of its settings that none of its other settings beats. Where the series are
    `rivals`, which means ways to the same result, a grey line steps along what nothing at all beats.
    """
    names = list(dict.fromkeys(name for cloud in clouds.values() for name in cloud))
    look = {n: (COLOURS[i % len(COLOURS)], MARKERS[i // len(COLOURS) % len(MARKERS)]) for i, n in enumerate(names)}
    columns = min(3 if len(clouds) > 4 else 2, len(clouds))
    rows = -(-len(clouds) // columns)
    figure = new_figure(PANEL * columns + 2.6, max(2.7 * rows, 0.21 * len(names) + 0.4))
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[len(clouds) :]:
        axes.remove()
    for axes, (label, cloud) in zip(grid, clouds.items(), strict=False):
        every = np.concatenate([np.asarray(errors, dtype=float) for _, errors in cloud.values()])
        floor = 0.3 * np.min(every[every > 0], initial=1.0)
        for name, (seconds, errors) in cloud.items():
            colour, marker = look[name]
            x, y = np.asarray(seconds, dtype=float), np.maximum(np.asarray(errors, dtype=float), floor)
            front = pareto(x, y)
            axes.plot(x, y, color=colour, marker=marker, markersize=3.5, linestyle="none", zorder=3)
            axes.plot(x[front], y[front], color=colour, linewidth=0.8, zorder=3)
        x = np.concatenate([np.asarray(seconds, dtype=float) for seconds, _ in cloud.values()])
        best = pareto(x, every)
        if rivals:
            steps = np.maximum(every[best], floor)
            axes.step(x[best], steps, where="post", color=INK, linewidth=3, alpha=0.18, zorder=2)
        axes.set(xscale="log", yscale="log", xlabel=xlabel, ylabel=label)
        for axis in (axes.xaxis, axes.yaxis):
            low, high = axis.get_view_interval()
            axis.set_minor_formatter(NullFormatter())
            if high < NARROW * low:  # the decades alone would leave one label or none
                axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    for name in names:
        colour, marker = look[name]
        grid[0].plot([], [], color=colour, marker=marker, markersize=3.5, linewidth=0.8, label=name)
    if rivals:
        grid[0].plot([], [], color=INK, linewidth=3, alpha=0.18, label="Pareto front")
    figure.legend(loc="outside right upper", handlelength=2.2)
    return figure


def pareto(seconds: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Indices of the points that no faster point equals in accuracy, from the fastest to the most accurate."""
    best: list[int] = []
    for i in np.lexsort((errors, seconds)):
        if not best or errors[i] < errors[best[-1]]:
            best.append(int(i))
    return np.array(best, dtype=int)


LABELS = {
    "bounce_mm": "error of bounce [mm]",
    "jump_mm": "error of jump [mm]",
    "seating_velocity_m_per_s": "error of seating velocity [m/s]",
    "lift_mm": "error of valve lift [mm]",
    "gradient": "relative error of the gradient [-]",
    "area_mm_deg": "error of area [mm deg]",
}


def figures(rows: Sequence[dict]) -> dict[str, Figure]:
    """A figure by the name of each case of methods, "job" for the job's dials, "masses" for smaller models."""
    usable = [row for row in rows if row["converged"] and row["seconds"] and row["error_of"] in LABELS]
    methods = [row for row in usable if not row["case"].startswith("job: ") and row["method"] != "reference"]
    # a smaller model is timed by the revolution, the other dials by the whole step of the job
    masses = [row for row in usable if row["case"] == "job: masses"]
    job = [row for row in usable if row["case"].startswith("job: ") and row not in masses]
    named = {
        case.replace("/", "").replace(" ", "-"): _clouds([row for row in methods if row["case"] == case], "method")
        for case in dict.fromkeys(row["case"] for row in methods)
    }
    named |= {"job": _clouds(job, "case"), "masses": _clouds(masses, "method")}
    xlabels = {"job": "processor time of the step of the job [s]"}
    return {
        name: work_precision(clouds, xlabels.get(name, "processor time per revolution [s]"), rivals=name != "job")
        for name, clouds in named.items()
        if clouds  # none where nothing is wrong about anything: there is no error to draw
    }


def _clouds(rows: Sequence[dict], by: str) -> dict[str, Series]:
    """The series of each quantity that anything is wrong about, by its label."""
    clouds = {}
    for name, label in LABELS.items():
        series: dict[str, tuple[list[float], list[float]]] = {}
        for row in rows:
            if row["error_of"] == name:
                seconds, errors = series.setdefault(row[by].removeprefix("job: "), ([], []))
                seconds.append(row["seconds"])
                errors.append(row["error"])
        if any(error > 0 for _, errors in series.values() for error in errors):
            clouds[label] = series
    return clouds
