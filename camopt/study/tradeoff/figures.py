"""Figures of `camopt tradeoff`: one per case of methods, one of the job's dials."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from camopt.plots.style import save
from camopt.plots.tradeoff import Cloud, work_precision
from camopt.study.tradeoff.measurement import REFERENCE

LABELS = {
    "bounce_mm": "error of bounce [mm]",
    "jump_mm": "error of jump [mm]",
    "seating_velocity_m_per_s": "error of seating velocity [m/s]",
    "lift_mm": "error of valve lift [mm]",
    "gradient": "relative error of the gradient [-]",
    "area_mm_deg": "error of area [mm deg]",
}


def draw(folder: Path, rows: Sequence[dict]) -> None:
    """Writes every figure as `<name>.png` and `.svg`."""
    for name, figure in figures(rows).items():
        save(figure, folder, name)


def figures(rows: Sequence[dict]) -> dict[str, Figure]:
    """A figure by the name of each case of methods, "job" for the job's dials, "masses" for smaller models."""
    usable = [row for row in rows if row["converged"] and row["seconds"] and row["error_of"] in LABELS]
    methods = [row for row in usable if not row["case"].startswith("job: ") and row["method"] != REFERENCE]
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


def _clouds(rows: Sequence[dict], by: str) -> list[Cloud]:
    """A cloud per quantity that anything is wrong about."""
    clouds = []
    for name, label in LABELS.items():
        series: dict[str, tuple[list[float], list[float]]] = {}
        for row in rows:
            if row["error_of"] == name:
                seconds, errors = series.setdefault(row[by].removeprefix("job: "), ([], []))
                seconds.append(row["seconds"])
                errors.append(row["error"])
        if any(error > 0 for _, errors in series.values() for error in errors):
            clouds.append(Cloud(label, series))
    return clouds
