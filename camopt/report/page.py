"""The report of a run folder: one HTML file that opens offline and fetches nothing; its only script is its own."""

import base64
import hashlib
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from camopt.plots.style import DESIGN, cam_line
from camopt.report.advice import advice
from camopt.report.assumed import MOVED, ranked
from camopt.report.cams import cards, geometry, stress
from camopt.report.curves import curves
from camopt.report.edge import edge_sentences
from camopt.report.first_screen import banner, facts, sketch
from camopt.report.folder import RunFolder, read_run_folder
from camopt.report.limits import OF_MOTION, disagreements, limit_rows, matrix
from camopt.report.motion import RunCams, animation, cams_of
from camopt.report.outcome import (
    broken_limits,
    contact_sentence,
    gain_sentences,
    lift_sentence,
    outcome_rows,
    reserve,
    yield_rows,
    yield_sentences,
)
from camopt.report.tables import area_rows, comparison_groups, method_tables, provenance_rows
from camopt.report.wording import (
    after_a_change,
    cell,
    heading,
    in_words,
    kind,
    label_and_unit,
    share_kind,
    shown,
    state,
    used,
)
from camopt.scene.quantities import QUANTITIES, is_number
from camopt.storage import write_text
from camopt.verifier.methods import METHOD_NAMES
from camopt.verifier.record import bounce_error_um, outside_sentence

HERE = Path(__file__).parent
SCRIPTS = ("animation.js", "charts.js", "curves.js")
START = """
const data = JSON.parse(document.getElementById("run-data").textContent);
trainAnimation(document, data.animation);
new ReportCharts(document, data.curves, data.animation);
"""
"""What the page's script ends with: animation and charts of the data that the page embeds."""


def write_report(folder: Path | str) -> Path:
    """Write `report.html` into a run folder from the files that lie in it, and return its path.

    The animation's motion is simulated here, by event-exact. Parts that are missing are named in the page. Raises
    InputError where the folder is none or a file in it cannot be understood; an older report then stays as it is.
    """
    folder = Path(folder)
    run = read_run_folder(folder)
    page = render(run, cams_of(folder, run))
    path = folder / "report.html"
    write_text(path, page)
    return path


@cache
def _environment() -> Environment:
    how = {"autoescape": True, "undefined": StrictUndefined, "trim_blocks": True, "lstrip_blocks": True}
    environment = Environment(loader=FileSystemLoader(HERE), **how)
    environment.filters |= {"shown": shown, "cell": cell, "heading": heading, "kind": kind, "error_um": bounce_error_um}
    environment.filters |= {"label": lambda key: label_and_unit(key)[0], "unit": lambda key: label_and_unit(key)[1]}
    environment.filters |= {"method": lambda name: METHOD_NAMES.get(name, shown(name)), "line": cam_line}
    environment.filters |= {"state": state, "share_kind": share_kind, "used": used, "after_a_change": after_a_change}
    environment.filters |= {"base64": lambda text: base64.b64encode(text.encode()).decode()}
    environment.tests["figure"] = is_number
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment


def render(run: RunFolder, cams: RunCams) -> str:
    """The page of a run folder's data and cams; every text from the folder is escaped."""
    lift, design = cams.lifts.get(DESIGN), cams.scene.design if cams.scene else None
    shape = None if lift is None or design is None else (lift, design)
    limits, scene = limit_rows(run, shape), cams.scene
    assumed = ranked(scene, lift) if scene and lift else ()  # pyright: ignore[reportArgumentType]  # has a hash
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            run=run,
            title=str(run.scene.get("title") or run.scene.get("name") or run.name),
            banner=banner(run),
            broken=broken_limits(run),
            disagreements=disagreements(run, limits),
            headline=headline(run),
            limits=limits,
            outcome=outcome_rows(run),
            worst=(run.verification.get("band") or {}).get("worst") or {},
            quantities=QUANTITIES,
            limited=OF_MOTION,
            yields=yield_rows(run),
            areas=area_rows(run),
            groups=comparison_groups(run),
            reserve=reserve(run),
            facts=facts(run, cams),
            sketch=shape and sketch(shape[0], shape[1].duration_deg),
            steps=advice(run, f"{run.path or run.name}/scene.toml", run.path or run.name, assumed),
            edge=edge_sentences(run),
            spoiling=yield_sentences(run),
            matrix=matrix(run, limits),
            scene=scene,
            ranked=assumed,
            moved=f"{100 * MOVED:.0f} %",
            stress=stress(cams),
            cards=cards(cams),
            geometry=geometry(cams),
            outside=outside_sentence(run.verification.outside),
            methods=method_tables(run),
            provenance=[*provenance_rows({k: v for k, v in run.provenance.items() if k != "stages"})],
            **_moving(run, cams),
        )
    )


def _moving(run: RunFolder, cams: RunCams) -> dict:
    """The animation's part of the page: data and script, or the sentences that say why there is none."""
    data, left_out = animation(cams)
    script = "\n".join((HERE / name).read_text(encoding="utf-8") for name in SCRIPTS) + START if data else ""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return {
        "animation": data,
        "curves": curves(run, cams) if data else None,
        "script": script,
        "script_hash": f"sha256-{digest}",
        "motion_left_out": left_out,
    }


def headline(run: RunFolder) -> list[str]:
    """Sentences on area, bounce over the band, contact, and the speeds at which jump and bounce begin."""
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
    sentences += lift_sentence(run) + gain_sentences(run)
    band, bounce = v.get("band") or {}, run.verification.worst("bounce_mm")
    speeds = [s.get("speed_rpm") for s in v.get("speeds") or []]
    if band and bounce:
        most = f"{shown(bounce.value)} mm, {bounce.where}" if bounce.value is not None else f"none {bounce.where}"
        sentences.append(
            f"Largest bounce over {shown(band.get('from_rpm'))} to {shown(band.get('to_rpm'))} r/min in steps of "
            f"{shown(band.get('step_rpm'))} r/min: {most}."
        )
    elif speeds:
        sentences.append(
            f"Verified at {in_words(speeds)} r/min and at no speed between: the band was not asked for (--speeds band)."
        )
    return sentences + contact_sentence(run) + reserve(run)
