"""One legend for a whole figure, which is as wide as the figure and no wider."""

from collections.abc import Sequence
from itertools import accumulate, pairwise

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.textpath import TextPath

from camopt.plots.style import BASE

_HANDLE = 3.2
"""Length of a line in a legend, over the size of its letters."""
_BESIDE = _HANDLE + 0.8 + 2.0
"""What a column has beside its words: line, gap and distance from the next one, over the size of its letters."""

LONGEST = 200
"""Letters of a label, of which no figure shows more."""


def legend_above(figure: Figure, axes: Axes, columns: int = 5) -> None:
    """Draws one legend for the whole figure, from the labelled lines of one of its axes, in as many columns, up to
    `columns`, as the figure is wide; a label that is longer than the figure loses its middle."""
    handles, labels = axes.get_legend_handles_labels()
    if not handles:
        return
    room = 72 * figure.get_figwidth() - 4 * BASE
    labels = [_shortened(label, room - _BESIDE * BASE) for label in labels]
    widths = [_width(label) + _BESIDE * BASE for label in labels]
    count = min(columns, len(handles))
    while count > 1 and sum(max(part) for part in _columns(widths, count)) > room:
        count -= 1
    figure.legend(handles, labels, loc="outside upper left", ncols=count, handlelength=_HANDLE)


def _width(label: str) -> float:
    """Width [pt] of words in a legend, which are drawn up to a twentieth wider than their letters' outlines."""
    return 1.05 * float(TextPath((0, 0), label, size=BASE).get_extents().width) if label.strip() else 0.0


def _shortened(label: str, room: float) -> str:
    """The label, without its middle where it is wider than some room [pt]."""
    label = label if len(label) <= LONGEST else _without_middle(label, LONGEST)
    wide = _width(label)
    if wide <= room:
        return label
    kept = int(len(label) * room / wide)
    while kept > 8 and _width(_without_middle(label, kept)) > room:
        kept -= 1
    return _without_middle(label, kept)


def _without_middle(label: str, kept: int) -> str:
    return f"{label[: kept // 2]}…{label[len(label) - kept // 2 :]}"


def _columns(widths: Sequence[float], count: int) -> list[Sequence[float]]:
    """The widths by column, as matplotlib fills a legend's columns: the first ones with one more."""
    rows, longer = divmod(len(widths), count)
    ends = [0, *accumulate(rows + (i < longer) for i in range(count))]
    return [widths[a:b] for a, b in pairwise(ends)]
