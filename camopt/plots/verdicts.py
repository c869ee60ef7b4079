"""A matrix of verdicts with a case per line and a method per column; each verdict has its colour and its letter."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from camopt.plots.style import BASE, INK, new_figure, styled

VERDICTS = {
    "within tolerance": ("#009E73", ""),
    "range": ("#56B4E9", "~"),
    "not converged": ("#E69F00", "?"),
    "refused": ("#bbbbbb", "–"),
    "wrong": ("#8a1c1c", "x"),
}
"""Colour and sign of each verdict; the sign tells the verdicts apart without any colour."""


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
