"""Natural frequencies and mode shapes of a valve train."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from camopt.plots.style import BASE, DESIGN, cam_line, new_figure, styled

COLUMNS = (5, 4, 3)
MOST = 15
"""Largest number of modes that are drawn; they are the lowest ones."""


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
