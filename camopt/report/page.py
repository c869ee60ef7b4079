"""The report of a run folder: one HTML file that needs no network, no script and nothing beside it."""

from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from camopt.report.figures import CAPTIONS, inline_svg, ordered
from camopt.report.folder import RunFolder, read_run_folder
from camopt.report.limits import disagreements, limit_rows
from camopt.report.tables import (
    LIMITS,
    SPEED_COLUMNS,
    area_rows,
    comparison_groups,
    comparison_table,
    heading,
    method_tables,
    provenance_rows,
    speed_rows,
    start_and_end,
)
from camopt.report.wording import NO_VERDICT, VERDICTS, is_number, label_and_unit, shown
from camopt.storage import write_text


def write_report(folder: Path | str) -> Path:
    """Write `report.html` into a run folder from the files that lie in it, and return its path.

    Parts that are missing are named in the page. Raises InputError where the folder is none or a file in it cannot
    be understood; an older report then stays as it is.
    """
    folder = Path(folder)
    page = render(read_run_folder(folder))
    path = folder / "report.html"
    write_text(path, page)
    return path


def render(run: RunFolder) -> str:
    """The page of a run folder's data; every text from the folder is escaped."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    limits = limit_rows(run)
    verdict = run.verification.get("verdict")
    kind, mark, meaning = VERDICTS.get(verdict, NO_VERDICT) if isinstance(verdict, str) else NO_VERDICT
    return environment.get_template("page.html.j2").render(
        run=run,
        title=str(run.scene.get("title") or run.scene.get("name") or run.name),
        verdict={"word": verdict or "not verified", "kind": kind, "mark": mark, "meaning": meaning},
        broken=_words(run.verification.get("broken")),
        disagreements=disagreements(run, limits),
        headline=headline(run),
        limits=limits,
        start_end=start_and_end(run),
        areas=area_rows(run),
        groups=comparison_groups(run),
        limit_names=LIMITS,
        comparison=comparison_table(run),
        speeds=speed_rows(run),
        speed_columns=[heading(c) for c in SPEED_COLUMNS],
        methods=method_tables(run),
        accuracy=accuracy(run),
        provenance=provenance_rows(run.provenance),
        figures=figures(run),
    )


def headline(run: RunFolder) -> list[str]:
    """Sentences on area, bounce over the band and the speeds at which jump and bounce begin."""
    d, v = run.design, run.verification
    sentences = []
    if is_number(d.get("area_ratio")):
        gap = d.get("area_gap_percent")
        below = (
            f", {shown(gap, 3)} % below the certified bound {shown(d.get('area_ratio_bound'))}"
            if is_number(gap)
            else ""
        )
        sentences.append(f"Area ratio {shown(d['area_ratio'])}{below}.")
    if is_number(d.get("gradient_gain")):
        sentences.append(f"The gradient stage gained {shown(d['gradient_gain'], 3)} of area ratio.")
    band = v.get("band") or {}
    if band:
        sentences.append(
            f"Largest bounce over {shown(band.get('from_rpm'))} to {shown(band.get('to_rpm'))} r/min in steps of "
            f"{shown(band.get('step_rpm'))} r/min: {shown(band.get('worst_bounce_mm'))} mm, at "
            f"{shown(band.get('worst_speed_rpm'))} r/min."
        )
    starts = v.get("limits") or {}
    for key, word in (("first_jump_rpm", "Jump"), ("first_bounce_rpm", "Bounce")):
        if key in starts:
            at = starts[key]
            where = f"begins at {shown(at)} r/min" if is_number(at) else "does not begin below 1.5 times the band's top"
            sentences.append(f"{word} {where}.")
    return sentences


def accuracy(run: RunFolder) -> list[str]:
    """What accuracy was asked for, and what error was estimated for what was delivered."""
    settings = run.provenance.get("settings")
    asked = settings.get("accuracy") if isinstance(settings, dict) else run.provenance.get("accuracy")
    unit = " µm" if is_number(asked) else ""
    sentences = [
        f"Asked for: {shown(asked)}{unit}." if asked is not None else "The accuracy asked for is not recorded."
    ]
    speeds = run.verification.get("speeds", [])
    errors = [(s["bounce_error_mm"], s.get("speed_rpm")) for s in speeds if is_number(s.get("bounce_error_mm"))]
    if errors:
        worst, at = max(errors, key=lambda e: e[0])
        sentences.append(
            f"Delivered: bounce to ±{shown(1000 * worst, 3)} µm or better, the largest estimate at {shown(at)} r/min."
        )
    else:
        sentences.append("No error estimate was delivered.")
    without = [shown(s.get("speed_rpm")) for s in speeds if not is_number(s.get("bounce_error_mm"))]
    if errors and without:
        sentences.append(f"No error estimate at {', '.join(without)} r/min.")
    return sentences


def figures(run: RunFolder) -> list[dict]:
    """The drawings with title and caption; one that cannot be shown says why."""
    shown_figures = []
    for number, name in enumerate(ordered(run.figures), 1):
        title, caption = CAPTIONS.get(name, (name, ""))
        try:
            drawing, fault = inline_svg(run.figures[name], number), ""
        except ValueError as error:
            drawing, fault = "", f"figures/{name}.svg cannot be shown: {error}."
        shown_figures.append({"name": name, "title": title, "caption": caption, "drawing": drawing, "fault": fault})
    return shown_figures


def _words(value) -> list[str]:
    return [label_and_unit(str(v))[0] for v in value] if isinstance(value, list) else []
