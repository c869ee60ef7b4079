"""The figure of masses and elements in docs/model.md: a bucket tappet as camopt sees it, and the laws of force."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle

from camopt.plots.style import BASE, LIMIT, new_figure, styled

STEEL, COIL, CAM = "#c8d2dc", "#0072B2", "#9A6A00"


@styled
def model_train():
    """The train beside its elements' forces by compression."""
    figure = new_figure(8.4, 3.6)
    scheme, laws = figure.subplots(1, 2, width_ratios=(1.15, 1))
    _scheme(scheme)
    _laws(laws)
    return figure


def _scheme(axes: Axes) -> None:
    """Cam, mass, spring and seat on the valve's axis; x grows downwards, as the valve opens."""
    angle = np.linspace(0, 2 * np.pi, 200)
    radius = 0.62 + 0.33 * np.exp(-(((angle - 1.1 * np.pi) / 0.5) ** 2))
    axes.add_patch(Polygon(np.column_stack([radius * np.cos(angle), 4.8 + radius * np.sin(angle)]), fc="w", ec=CAM))
    axes.add_patch(Rectangle((-0.9, 3.3), 1.8, 0.75, fc=STEEL, ec="k"))
    axes.plot([0, 0], [3.3, 1.0], color="k", linewidth=3)
    axes.plot([-0.75, 0.75], [1.03, 1.03], color="k", linewidth=3)
    y = np.linspace(1.75, 3.3, 60)
    axes.plot(
        1.35 + 0.16 * np.sign(np.sin(9 * (y - 1.75) * np.pi)) * np.abs(np.sin(9 * (y - 1.75) * np.pi)), y, color=COIL
    )
    axes.plot([0.9, 1.35], [3.3, 3.3], color=COIL)
    for left in (-1.7, 0.35):
        axes.add_patch(Rectangle((left, 1.08), 1.35, 0.28, fc="w", ec="k", hatch="////"))
    axes.add_patch(Rectangle((1.05, 1.36), 0.65, 0.39, fc="w", ec="k", hatch="////"))
    axes.annotate("", (-2.1, 2.3), (-2.1, 4.2), arrowprops={"arrowstyle": "-|>", "linewidth": 1})
    axes.text(-2.2, 3.2, "x: the valve opens", rotation=90, ha="right", va="center", fontsize=BASE - 1)
    words = (
        (4.6, "cam, which turns and pushes by the lift"),
        (4.18, 'contact "cam": pushes only, its gap is the lash'),
        (3.65, "mass: valve, bucket, retainer"),
        (2.6, 'spring: ["valve", "ground"], preloaded'),
        (0.95, 'contact "seat": ["ground", "valve"]'),
    )
    for height, text in words:
        axes.text(2.0, height, text, va="center", fontsize=BASE - 1)
    axes.plot([0.35, 1.9], [4.22, 4.18], color="#888888", linewidth=0.6)
    axes.plot([0.8, 1.9], [0.99, 0.95], color="#888888", linewidth=0.6)
    axes.set(xlim=(-2.7, 6.6), ylim=(0.5, 6.1), aspect="equal")
    axes.set_axis_off()
    axes.set_title("A train of one mass and three elements")


def _laws(axes: Axes) -> None:
    """Elastic force by compression, with what a spring, a contact and a contact with a gap do."""
    d = np.linspace(-1.2, 1.0, 200)
    axes.axhline(0, color="#888888", linewidth=0.6)
    axes.axvline(0, color="#888888", linewidth=0.6)
    axes.plot(d, 0.5 + 0.55 * d, color=COIL, label="spring with a preload: pushes and pulls")
    axes.plot(
        d, np.maximum(0.0, 0.3 + 1.3 * d), color=LIMIT, linestyle="--", label="contact with a preload: pushes only"
    )
    axes.plot(d, np.maximum(0.0, 1.3 * (d - 0.3)), color=CAM, linestyle=":", label="contact with a gap: touches later")
    axes.set(xticks=[0], yticks=[0], xlabel="compression d", ylabel="elastic force p")
    axes.legend(fontsize=BASE - 1, loc="upper left")
    axes.set(ylim=(-0.3, 2.2))
    axes.set_title("What elements do")
