"""Common style of all figures: each cam keeps its colour and dashes, limits and legends look alike, and the files are
deterministic."""

import io
import re
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.textpath import TextPath

from camopt.cam.families.registry import FAMILIES
from camopt.storage import write_bytes

INK = "#222222"
LIMIT = "#8a1c1c"
SHADE = "#eeeeee"
BASE = 9.0
"""Font size of the text [pt]."""
DPI = 160

DESIGN = "design"
DESIGN_LINE = "#0072B2", "-"
"""Colour and dashes of an optimised design; those of a cam family are in its record (`camopt.cam.families.record`).
The colours are those of Okabe and Ito (2008), which are distinguishable for the colour-blind, without the yellow, which
is not visible on white, and with a darker purple. The textbook cams that serve as test subjects are grey. The dashes
distinguish the cams without colour."""
OTHERS = ("#555555", "#9A6A00", "#3B6F6F", "#7A3B69")
"""Colours of cams outside the families, such as lift tables. The cam's name selects one, so a table has the same colour
in every figure in which no other cam has taken it."""
OTHERS_DASHES = (0, (6, 1)), (0, (2, 1)), (0, (6, 1, 1, 1)), (0, (4, 2))
"""Dashes of cams outside the families, used in this order within a figure."""
DESIGN_NAMES = {"free", "free-cam", "camopt", "optimized", "optimised"}

_HANDLE = 3.2
"""Length of a line in a legend, in multiples of the font size."""
_COLUMN_SPACE = _HANDLE + 0.8 + 2.0
"""Width of a legend's column without its text (line, gap, distance from the next column), in multiples of the font
size."""
LONGEST = 200
"""Largest number of characters of a label that a figure shows."""

RC: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": INK,
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.labelsize": BASE,
    "axes.linewidth": 0.7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": BASE,
    "axes.titleweight": "bold",
    "axes.unicode_minus": True,
    "figure.facecolor": "white",
    "font.family": "DejaVu Sans",  # included in matplotlib: the same on every machine
    "font.size": BASE,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "legend.fontsize": BASE,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "path.simplify": True,
    "svg.fonttype": "path",
    "svg.hashsalt": "camopt",
    "text.color": INK,
    "xtick.color": INK,
    "xtick.labelsize": BASE - 1,
    "ytick.color": INK,
    "ytick.labelsize": BASE - 1,
}
styled = matplotlib.rc_context(RC)
"""Decorator of every function that makes a figure: the settings apply inside the function only."""


def family_of(cam: str) -> str:
    """The family in a cam's name, before any parameters (`polydyne:...`), limits or remarks; "" without one."""
    word = cam.replace(",", " ").replace("(", " ").replace(":", " ").split(" ")[0].strip().lower()
    word = DESIGN if word in DESIGN_NAMES else word
    return word if word == DESIGN or word in FAMILIES else ""


def lines() -> dict[str, tuple[str, Any]]:
    """Colour and dashes of the design and of every family whose record defines them."""
    return {name: line for name in (DESIGN, *FAMILIES) if (line := line_of(name)) is not None}


def line_of(family: str) -> tuple[str, Any] | None:
    """Colour and dashes of a family or the design; None where a family's record has none, and for the family ""."""
    if family == DESIGN:
        return DESIGN_LINE
    return resolve_name(FAMILIES[family]).line if family else None


def cam_line(cam: str) -> dict:
    """Line properties of a cam, the same in every figure; all optimised designs look alike."""
    family = family_of(cam)
    line = line_of(family)
    if line is None:
        number = zlib.crc32((family or cam).encode())  # not hash(), which differs between processes
        line = OTHERS[number % len(OTHERS)], (0, (2 + number // 7 % 3, 1.5))
    front = family == DESIGN
    return {"color": line[0], "linestyle": line[1], "linewidth": 2.0 if front else 1.4, "zorder": 3.0 if front else 2.5}


def page_line(cam: str) -> dict:
    """`cam_line` for a page: its `colour`, and its `dashes` in pixels, empty for a solid line."""
    line = cam_line(cam)
    dashes = line["linestyle"]
    return {"colour": line["color"], "dashes": [] if isinstance(dashes, str) else [2 * d for d in dashes[1]]}


def cam_lines(cams: Iterable[str]) -> dict[str, dict]:
    """`cam_line` of each cam of a figure. Cams outside the families get the dashes in turn, and another colour where
    the colour of their name is taken."""
    by_cam, taken = {}, set()
    for cam in dict.fromkeys(cams):
        line = cam_line(cam)
        if line_of(family_of(cam)) is None:
            first = OTHERS.index(line["color"])
            turns = [OTHERS[(first + i) % len(OTHERS)] for i in range(len(OTHERS))]
            line["color"] = next((colour for colour in turns if colour not in taken), line["color"])
            line["linestyle"] = OTHERS_DASHES[len(taken) % len(OTHERS_DASHES)]
            taken.add(line["color"])
        by_cam[cam] = line
    return by_cam


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of a size in inches, with automatic layout and without a window or global state."""
    return ShownFigure(figsize=(width, height), layout="constrained")


class ShownFigure(Figure):
    """A figure that a notebook shows without an import of pyplot."""

    def _repr_png_(self) -> bytes:
        return picture(self, "png", dpi=110)


def draw_limit(axes: Axes, value: float | None, text: str, va: str = "center") -> None:
    """Draws a limit, unless it is None, as a dashed line with its text to the right of the axes, where it hides no
    data; `text` is a format string for the value, such as "at most {:g} mm"."""
    if value is None:
        return
    axes.axhline(value, color=LIMIT, linestyle=(0, (5, 3)), linewidth=0.9, zorder=2.2)
    how = {"va": va, "color": LIMIT, "fontsize": BASE - 1.5, "annotation_clip": False}
    quoted = re.sub(r"-(?=\d)", "\u2212", text.format(value))  # the minus sign of the axes
    write(axes, quoted, (1.0, value), (3, 0), over=axes.get_yaxis_transform(), **how)


def write(
    axes: Axes, words: str, at: tuple[float, float], offset: tuple[float, float], over: Any = "data", **how
) -> None:
    """Writes a text at an offset [pt] from a point; `over` is the coordinate system of the point."""
    how = {"fontsize": BASE - 1, "ha": "right" if offset[0] < 0 else "left"} | how
    axes.annotate(words, at, xycoords=over, xytext=offset, textcoords="offset points", **how)


def legend_above(figure: Figure, axes: Axes, columns: int = 5) -> None:
    """Draws one legend for the whole figure from the labelled lines of one of its axes, in as many columns as fit into
    its width, at most `columns`. A label that is wider than the figure is shortened in the middle."""
    handles, labels = axes.get_legend_handles_labels()
    if not handles:
        return
    room = 72 * figure.get_figwidth() - 4 * BASE
    labels = [_shortened(label, room - _COLUMN_SPACE * BASE) for label in labels]
    widest = max(map(_width, labels)) + _COLUMN_SPACE * BASE
    count = max(1, min(columns, len(handles), int(room / widest)))
    figure.legend(handles, labels, loc="outside upper left", ncols=count, handlelength=_HANDLE)


def _width(label: str) -> float:
    """Width [pt] of a label in a legend: matplotlib draws it up to 5 % wider than the outlines of its characters."""
    return 1.05 * float(TextPath((0, 0), label, size=BASE).get_extents().width) if label.strip() else 0.0


def _shortened(label: str, room: float) -> str:
    """The label, shortened in the middle to a width of at most `room` [pt] and at most `LONGEST` characters."""
    length, short, width = len(label), label, np.inf if len(label) > LONGEST else _width(label)
    while length > 8 and width > room:
        length = min(length - 1, int(length * room / width)) if width < np.inf else LONGEST
        short = f"{label[: length // 2]}…{label[len(label) - length // 2 :]}"
        width = _width(short)
    return short


def save(figure: Figure, folder: Path | str, name: str) -> tuple[Path, Path]:
    """Writes `<name>.png` and `<name>.svg` into `folder` and returns both paths; the same figure gives the same bytes.
    Raises InputError where nothing can be written."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = folder / f"{name}.png", folder / f"{name}.svg"
    with laid_out(figure):
        for path in paths:
            write_bytes(path, picture(figure, path.suffix[1:]))
    return paths


@contextmanager
def laid_out(figure: Figure) -> Iterator[None]:
    """Computes the figure's layout once. Otherwise each file would repeat it, for which the figure is drawn again."""
    layout, dpi = figure.get_layout_engine(), figure.dpi
    with matplotlib.rc_context(RC):
        figure.set_dpi(DPI)
        if layout is not None and figure.axes:
            layout.execute(figure)
        figure.set_layout_engine(None)
    try:
        yield
    finally:
        figure.set_dpi(dpi)
        figure.set_layout_engine(layout)


def picture(figure: Figure, kind: str, dpi: int = DPI) -> bytes:
    """A figure as the bytes of a PNG or SVG file, which are always the same for the same figure."""
    metadata = {"png": {"Software": None}, "svg": {"Date": None, "Creator": "camopt"}}
    buffer = io.BytesIO()
    with matplotlib.rc_context(RC):
        figure.savefig(buffer, format=kind, dpi=dpi, metadata=metadata[kind])
    return buffer.getvalue()
