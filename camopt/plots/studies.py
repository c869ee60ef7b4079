"""Figures of studies: area over a limit, identified parameters, natural modes, a matrix of verdicts, and error over
time."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from camopt.plots.style import BASE, DESIGN, INK, LIMIT, OTHERS, cam_line, new_figure, styled
from camopt.scene.quantities import label_and_unit

if TYPE_CHECKING:
    import xarray as xr

COLUMNS = (5, 4, 3)
MOST = 15
"""Largest number of modes that are drawn; they are the lowest ones."""
VERDICTS = {
    "within tolerance": ("#009E73", ""),
    "range": ("#56B4E9", "~"),
    "not converged": ("#E69F00", "?"),
    "refused": ("#bbbbbb", "–"),
    "wrong": ("#8a1c1c", "x"),
}
"""Colour and sign of each verdict; the signs distinguish the verdicts without colour."""


@styled
def front(against: str, limit: np.ndarray, area_ratio: np.ndarray, title: str) -> Figure:
    """Draws the area ratio (k) over the k values of a design limit; a value without a cam is a cross on the axis."""
    figure = new_figure(5.2, 3.4)
    axes = figure.subplots()
    feasible = np.isfinite(area_ratio)
    axes.plot(limit[feasible], area_ratio[feasible], "o-", color=cam_line(DESIGN)["color"], markersize=4)
    if not feasible.all():
        lowest = np.full((~feasible).sum(), np.nanmin(area_ratio))
        axes.plot(limit[~feasible], lowest, "x", color=LIMIT, label="no cam")
        axes.legend()
    name, unit = label_and_unit(against)
    axes.set(xlabel=f"{name} [{unit or '-'}]", ylabel="area ratio [-]")
    axes.set_title(title)
    return figure


@styled
def identification(
    table: "xr.Dataset", speeds_rpm: Sequence[float], angles_deg, residuals_um, noise_um: float
) -> Figure:
    """Draws the estimates over their start values with intervals, and the residual (m) of each series; a parameter that
    was not identified is a cross at its start value."""
    figure = new_figure(9.6, 1.6 + 0.32 * max(table.sizes["parameter"], 6))
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.4))
    rows = np.arange(table.sizes["parameter"])
    ratio, low, high = (table[k].values / table["start"].values for k in ("estimate", "low", "high"))
    identified = table["identified"].values
    ends = np.sort(np.stack([low, high])[:, identified], axis=0)
    left.hlines(rows[identified], *ends, color=INK)
    left.plot(ratio[identified], rows[identified], "o", color=INK, markersize=4)
    at_start = np.ones(int(np.sum(~identified)))
    left.plot(at_start, rows[~identified], "x", color=LIMIT, markersize=5, label="not identified")
    left.set_yticks(rows, table["parameter"].values)
    left.invert_yaxis()
    left.set_xlabel("estimate over start value")
    if np.any(~identified):
        left.legend(loc="lower left", bbox_to_anchor=(0, 1))
    for i, (speed, angle, residual) in enumerate(zip(speeds_rpm, angles_deg, residuals_um, strict=True)):
        right.plot(angle, residual, color=OTHERS[i % len(OTHERS)], linewidth=0.6, label=f"{speed:g} r/min")
    right.set(xlabel="cam angle [deg]", ylabel="computed less measured [µm]", title=f"noise {noise_um:.3g} µm")
    right.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=len(residuals_um), columnspacing=1.0)
    return figure


@styled
def modes(frequency_Hz: np.ndarray, shape: np.ndarray, mass_names: Sequence[str], state: str = "") -> Figure:
    """Draws the shape of each mode over the masses in the scene's order, with its frequency in the title.

    `frequency_Hz` (m) ascends; `shape` (m, n) has a row per mode, of unit norm. The sign of a shape is arbitrary, and
    it is drawn with its largest displacement positive. `state` ("lifted", "seated") goes into the title.
    """
    frequency_Hz, shape = np.asarray(frequency_Hz, dtype=float), np.asarray(shape, dtype=float)
    if shape.shape != (len(frequency_Hz), len(mass_names)):
        wanted = f"{len(frequency_Hz)} modes by {len(mass_names)} masses"
        raise ValueError(f"shape must be {wanted}, it is {' by '.join(map(str, shape.shape))}")
    count = min(MOST, len(frequency_Hz))
    columns = min(count, min(COLUMNS, key=lambda c: -count % c))  # the grid with the fewest empty places
    lines = -(-count // columns)
    figure = new_figure(1.0 + 1.55 * columns, 0.9 + lines * (0.6 + 0.16 * len(mass_names)))
    grid = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    place = np.arange(len(mass_names))
    colour = cam_line(DESIGN)["color"]
    for i, axes in enumerate(grid.flat):
        if i >= count:
            axes.set_visible(False)
            continue
        amplitude = shape[i] * np.sign(shape[i, np.argmax(np.abs(shape[i]))])
        axes.axvline(0, color="#777777", linewidth=0.7, zorder=1)
        axes.hlines(place, 0, amplitude, color=colour, linewidth=1.6)
        axes.plot(amplitude, place, "o", color=colour, markersize=3.5)
        scale, unit = (1000, "kHz") if frequency_Hz[i] >= 1000 else (1, "Hz")
        axes.set_title(f"{i + 1}:  {frequency_Hz[i] / scale:.4g} {unit}", fontsize=BASE)
        axes.set_xlim(-1.08, 1.08)
        if i + columns >= count:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel("displacement [-]")
    grid[0, 0].set_yticks(place, mass_names)
    grid[0, 0].invert_yaxis()  # the cam's end on top
    title = f"natural modes, {state}" if state else "natural modes"
    left_out = len(frequency_Hz) - count
    figure.suptitle(title + (f" (the {left_out} highest left out)" if left_out else ""), fontsize=BASE + 1, ha="center")
    return figure


@styled
def verdict_matrix(rows: Sequence[Mapping], scene: str) -> Figure:
    """Draws the verdicts of `rows`, which have `case` ("scene: case"), `method` and `verdict`; the field of a case that
    was not run with a method stays white."""
    cases = list(dict.fromkeys(r["case"].split(": ", 1)[-1] for r in rows))
    methods = list(dict.fromkeys(r["method"] for r in rows))
    figure = new_figure(3.4 + 0.42 * len(methods), 1.9 + 0.2 * len(cases))
    axes = figure.subplots()
    axes.grid(False)
    for r in rows:
        x, y = methods.index(r["method"]), cases.index(r["case"].split(": ", 1)[-1])
        colour, sign = VERDICTS[r["verdict"]]
        axes.add_patch(Rectangle((x - 0.46, y - 0.44), 0.92, 0.88, color=colour, linewidth=0))
        light = "white" if r["verdict"] == "wrong" else INK
        axes.text(x, y, sign, ha="center", va="center", color=light, fontsize=BASE - 1.5)
    axes.set(xlim=(-0.6, len(methods) - 0.4), ylim=(len(cases) - 0.4, -0.6))
    axes.set_xticks(range(len(methods)), methods, rotation=90)
    axes.set_yticks(range(len(cases)), cases)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    axes.set_title(f"{scene}: figures of the first revolution against the reference", loc="right", fontsize=BASE)
    entries = [Patch(color=colour, label=f"{name} {sign}".strip()) for name, (colour, sign) in VERDICTS.items()]
    figure.legend(handles=entries, loc="outside lower center", ncols=3)
    return figure


COLOURS = ("#0072B2", "#D55E00", "#009E73", "#B0518E", "#E69F00", "#56B4E9", "#7A5C2E", "#555555")
MARKERS = "osD^vP"
"""Markers of the series. There are eight colours; series that share one differ in their marker."""
PANEL = 3.5
"""Width of a panel [in]."""
NARROW = 100.0
"""Ratio of the ends of an axis below which it also has labels at 2 and 5 of each decade."""
Series = Mapping[str, tuple[Sequence[float], Sequence[float]]]
"""By the name of a series: times (k) [s] and errors (k)."""


@styled
def work_precision(clouds: Mapping[str, Series], xlabel: str, rivals: bool = True) -> Figure:
    """Draws a panel of error over time for each quantity, whose label is the key; an error of 0 is drawn at the lower
    end of the axis.

    The line of a series runs through its Pareto-optimal settings, to which none of its other settings is superior in
    both time and error. Where the series are `rivals`, which means methods for the same result, a grey staircase marks
    the Pareto front of all series.
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
            if high < NARROW * low:  # labels at the decades alone would be at most one or two
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
    """Indices of the Pareto-optimal points, from the fastest to the most accurate: no faster point is as accurate."""
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
    """Figures by name: one for each case of methods, "job" for the settings of a job, "masses" for smaller models."""
    usable = [row for row in rows if row["converged"] and row["seconds"] and row["error_of"] in LABELS]
    methods = [row for row in usable if not row["case"].startswith("job: ") and row["method"] != "reference"]
    # the time of a smaller model is that of a revolution, of the other settings that of the whole step of the job
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
        if clouds  # empty where all errors are zero
    }


def _clouds(rows: Sequence[dict], by: str) -> dict[str, Series]:
    """By the label of each quantity with an error above zero, its series, which are named by the column `by`."""
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
