"""The figures of studies: a front of limits, identified parameters, natural modes, and a matrix of verdicts."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from camopt.plots.style import BASE, DESIGN, INK, LIMIT, OTHERS, cam_line, new_figure, styled

if TYPE_CHECKING:
    import xarray as xr

UNITS = {"mm": "mm", "mm_per_deg2": "mm/deg²", "mm_per_deg3": "mm/deg³", "m_per_s": "m/s", "N": "N"}
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
"""Colour and sign of each verdict; the sign tells the verdicts apart without any colour."""


@styled
def front(against: str, limit: np.ndarray, area_ratio: np.ndarray, title: str = "") -> Figure:
    """Draws the area ratio (k) over the k values of a design limit; a value without a cam is a cross on the axis."""
    figure = new_figure(5.2, 3.4)
    axes = figure.subplots()
    feasible = np.isfinite(area_ratio)
    axes.plot(limit[feasible], area_ratio[feasible], "o-", color=cam_line(DESIGN)["color"], markersize=4)
    if not feasible.all():
        lowest = np.full((~feasible).sum(), np.nanmin(area_ratio))
        axes.plot(limit[~feasible], lowest, "x", color=LIMIT, label="no cam")
        axes.legend()
    name, unit = next((against.removesuffix(f"_{u}"), v) for u, v in list(UNITS.items())[::-1] if against.endswith(u))
    axes.set(xlabel=f"{name.replace('_', ' ')} [{unit}]", ylabel="area ratio [-]")
    axes.set_title(title)
    return figure


@styled
def identification(
    table: "xr.Dataset", speeds_rpm: Sequence[float], angles_deg, residuals_um, noise_um: float
) -> Figure:
    """Draws the estimates over their start values with intervals, and the residual (m) of each series.

    A parameter that was not identified is a cross at its start value, without an interval.
    """
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
        axes.set_title(f"{i + 1}:  {_hertz(frequency_Hz[i])}", fontsize=BASE)
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


def _hertz(value: float) -> str:
    return f"{value / 1000:.4g} kHz" if value >= 1000 else f"{value:.4g} Hz"


@styled
def verdict_matrix(rows: Sequence[Mapping], scene: str) -> Figure:
    """Draws the verdicts of `rows`, which have `case` ("scene: case"), `method` and `verdict`.

    The field of a case that a method did not run stays white.
    """
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
