"""A Campbell diagram: at which speeds the harmonics of the cam meet the natural frequencies."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from camopt.plots.style import BASE, DESIGN, SHADE, cam_line, new_figure, styled


@styled
def campbell(
    frequency_Hz: Sequence[float],
    orders: Sequence[int],
    band_rpm: tuple[float, float],
    cam_per_crank: float,
    title: str = "",
) -> Figure:
    """Draws the frequencies (m) as level lines and the cam's harmonics `orders` as rays over the crankshaft speed.

    Dots mark where they meet inside the band, which is shaded.
    """
    figure = new_figure(7.6, 4.6)
    axes = figure.subplots()
    low, high = band_rpm
    speed = np.array([0.9 * low, 1.08 * high])
    per_order = speed * cam_per_crank / 60
    top = 1.12 * max(frequency_Hz)
    axes.axvspan(low, high, color=SHADE, zorder=0)
    for order in orders:
        ray = order * per_order
        axes.plot(speed, ray, color="#888888", linewidth=0.7, zorder=2)
        _name_ray(axes, order, speed[1], ray[1], top)
        for f in frequency_Hz:
            at = f * 60 / (order * cam_per_crank)
            if low <= at <= high:
                axes.plot(at, f, "o", color=cam_line("polydyne")["color"], markersize=4, zorder=4)
    for f in frequency_Hz:
        axes.axhline(f, color=cam_line(DESIGN)["color"], linewidth=1.4, zorder=3)
        axes.annotate(f"{f:.0f} Hz", (speed[0], f), xytext=(3, 2), textcoords="offset points", fontsize=BASE - 1.5)
    axes.set(xlim=speed, ylim=(0, top), xlabel="crankshaft speed [r/min]", ylabel="frequency [Hz]")
    axes.set_title(title, pad=14)  # above the orders
    return figure


def _name_ray(axes: Axes, order: int, end: float, height: float, top: float) -> None:
    """Writes the order of a ray from the origin to (end, height) where it leaves the axes: right, or at the top."""
    right = height < top
    at = (end, height) if right else (end * top / height, top)
    shift, horizontal, vertical = ((2, 0), "left", "center") if right else ((0, 3), "center", "bottom")
    axes.annotate(f"{order}", at, xytext=shift, textcoords="offset points", ha=horizontal, va=vertical,
                  fontsize=BASE - 2)  # fmt: skip
