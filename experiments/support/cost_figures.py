"""Table and figures of `cost_scaling`."""

from matplotlib.figure import Figure

from camopt.plots.style import new_figure, styled

LINES = {
    "event": ("event-exact, sampled", "#0072B2"),
    "event, end state": ("event-exact, end state", "#56B4E9"),
    "rkg": ("Runge-Kutta-Gill", "#D55E00"),
    "tmm": ("transition matrix", "#009E73"),
    "smooth": ("smooth scan", "#B0518E"),
    "batch": ("smooth batch, per motion", "#E69F00"),
}


def print_table(content: dict) -> None:
    """Every row as text."""
    for part, by in (("masses", "masses"), ("contacts", "idle_contacts")):
        for row in content[part]:
            times = ", ".join(f"{path} {ms:.3g}" for path, ms in row["ms"].items())
            print(f"{by} {row[by]:3d}: {times} ms")
    for key in ("one_against_ten", "masses_exponent", "never_closing"):
        print(f"{key}: {content[key]}")


@styled
def figures(masses: list[dict], contacts: list[dict]) -> dict[str, Figure]:
    """Time of a revolution against masses, and what idle contacts add to it."""
    drawing = new_figure(6.4, 3.6)
    axes = drawing.subplots(1, 2)
    _lines(axes[0], masses, "masses")
    none = contacts[0]["ms"]
    more = [row | {"ms": {p: 100 * (ms / none[p] - 1) for p, ms in row["ms"].items()}} for row in contacts]
    _lines(axes[1], more, "idle_contacts")
    axes[0].set(xscale="log", yscale="log", xlabel="masses", ylabel="time per revolution [ms]")
    axes[1].set(xlabel="contacts that never close", ylabel="more time [%]")
    handles, labels = axes[0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside upper center", ncols=3)
    return {"time": drawing}


def _lines(axes, rows: list[dict], by: str) -> None:
    for path in dict.fromkeys(p for r in rows for p in r["ms"]):
        points = sorted((r[by], r["ms"][path]) for r in rows if path in r["ms"])
        label, colour = LINES[path]
        axes.plot(*zip(*points, strict=True), marker="o", markersize=3.5, color=colour, label=label)
