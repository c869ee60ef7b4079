"""The report of a run folder: one HTML file that works offline, loads nothing and runs only its own script."""

import base64
import hashlib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from camopt.cam.lift import Lift
from camopt.measure.yield_words import ENOUGH, HELD, MISSED, NOT_ASKED, asked_sentence, share_sentence, standing
from camopt.plots.style import DESIGN, cam_line
from camopt.report import outcome, tables, wording
from camopt.report.advice import MOVED, advice, ranked
from camopt.report.cams import cards, curves, geometry, stress
from camopt.report.folder import RunFolder, read_run_folder
from camopt.report.limits import OF_MOTION, disagreements, limit_rows, matrix
from camopt.report.motion import RunCams, animation, cams_of
from camopt.report.wording import NO_VERDICT, VERDICTS, in_words, shown
from camopt.scene.quantities import QUANTITIES, is_number, label_and_unit
from camopt.scene.units import DEG, MM
from camopt.storage import write_text
from camopt.verifier.methods import METHOD_NAMES
from camopt.verifier.record import bounce_error_um, outside_sentence

KINDS = ("good", "doubt", "bad")
"""Classes of the banner from best to worst; the banner has the worse class of its two lines."""
BUILT = {HELD: ("good", "✓"), ENOUGH: ("good", "✓"), NOT_ASKED: ("doubt", "!"), MISSED: ("bad", "✗")}
"""Class in the page and mark, by the result of comparing the share of trains with the requested yield."""
WIDTH, HEIGHT = 300.0, 96.0
"""Size of the sketch of the lift [px]."""
POINTS = 241


def banner(run: RunFolder) -> dict[str, Any]:
    """Content of the banner: its lines ("as designed" and, where the scene is known, "as built"), its class, which is
    green only where both lines meet the requirements, and the beginning of the page's title."""
    word = run.verdict or "not verified"
    kind, mark, meaning = VERDICTS.get(word, NO_VERDICT)
    designed = {"which": "as designed", "kind": kind, "mark": mark, "word": word, "meaning": meaning}
    lines = [designed, *_as_built(run)]
    worst = max((line["kind"] for line in lines), key=KINDS.index)
    return {"kind": worst, "lines": lines, "title": word}


def _as_built(run: RunFolder) -> list[dict[str, str]]:
    """The banner's line on the trains as built; an empty list where the scene is not known."""
    record, words = run.built, outcome.as_built_words(run)
    if not words:
        return []
    kind, mark, word = "doubt", "?", "not known"
    meaning = _sentence(words.removeprefix("not known: "))
    if stands := standing(record):
        (kind, mark), word = BUILT[stands], f"{100 * record['share']:.3g} % of trains"
        meaning = f"{_sentence(share_sentence(record))} {_sentence(asked_sentence(record))}"
    return [{"which": "as built", "kind": kind, "mark": mark, "word": word, "meaning": meaning}]


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."


def sketch(lift: Lift, duration_deg: float) -> dict[str, Any]:
    """The cam's lift over its event, ramps included, as the path of an SVG."""
    lifted = [angle for angle in lift.borders if lift(np.array(angle)) > 0]
    reach = max([duration_deg / 2 * DEG, *np.abs(lifted)]) * 1.1
    theta = np.linspace(-reach, reach, POINTS)
    x, y = WIDTH * (theta / reach + 1) / 2, HEIGHT * (1 - 0.92 * lift(theta) / lift.max_lift)
    path = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))
    ends = [round(WIDTH * (sign * duration_deg / 2 * DEG / reach + 1) / 2, 1) for sign in (-1, 1)]
    words = f"Lift of the cam, {shown(lift.max_lift / MM)} mm at most over a duration of {shown(duration_deg)} deg"
    return {"path": path, "width": WIDTH, "height": HEIGHT, "ends": ends, "words": words}


def facts(run: RunFolder, cams: RunCams) -> list[tuple[str, str]]:
    """Names and values of the cam's main results: area ratio, distance from the bound, largest lift, duration, and the
    area compared with the best other confirmed cam."""
    d, lift, figures = run.design, cams.lifts.get(DESIGN), []
    if is_number(d.get("area_ratio")):
        figures.append(("area ratio", shown(d["area_ratio"])))
    if is_number(d.get("area_gap_percent")):
        figures.append(("below the bound", f"{shown(d['area_gap_percent'], 3)} %"))
    if lift is not None:
        figures.append(("largest lift", f"{shown(lift.max_lift / MM)} mm"))
        figures.append(("duration", f"{shown(2 * lift.half_duration / DEG)} deg"))
    groups = tables.comparison_groups(run)
    others = [g for g in groups if g["cam"] != DESIGN and g["within"] and g["verdict"] == "confirmed" and g["area"]]
    if others and is_number(d.get("area_ratio")):
        best = max(others, key=lambda g: g["area"])
        more = 100 * (d["area_ratio"] / best["area"] - 1)
        figures.append((f"area against {best['cam']}", f"{'+' if more >= 0 else '−'}{shown(abs(more), 3)} %"))
    elif groups:
        figures.append(("other cams under these limits", "none confirmed"))
    return figures


HERE = Path(__file__).parent
SCRIPTS = ("animation.js", "charts.js", "curves.js")
WORDING = ("shown", "cell", "heading", "kind", "state", "share_kind", "used")
"""Functions of `camopt.report.wording` that the templates use as filters."""
START = """
const data = JSON.parse(document.getElementById("run-data").textContent);
document.getElementById("train").append(...trainParts(true));
trainAnimation(document, data.animation);
new ReportCharts(document, data.curves, data.animation);
"""
"""Last part of the page's script: it starts the animation and the charts with the data that the page embeds."""


def write_report(folder: Path | str) -> Path:
    """Write `report.html` into a run folder from the files in it, and return its path.

    The animation's motion is simulated here by event-exact. The page names the files that are missing. Raises
    InputError where the folder does not exist or a file in it cannot be understood; an older report is then kept.
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
    environment.filters |= {name: getattr(wording, name) for name in WORDING} | {"error_um": bounce_error_um}
    environment.filters |= {"label": lambda key: label_and_unit(key)[0], "unit": lambda key: label_and_unit(key)[1]}
    environment.filters |= {"method": lambda name: METHOD_NAMES.get(name, shown(name)), "line": cam_line}
    environment.filters |= {"base64": lambda text: base64.b64encode(text.encode()).decode()}
    environment.tests["finite"] = is_number
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment


def render(run: RunFolder, cams: RunCams) -> str:
    """HTML of the report, from a run folder's data and cams; every text from the folder is escaped."""
    lift, design = cams.lifts.get(DESIGN), cams.scene.design if cams.scene else None
    shape = None if lift is None or design is None else (lift, design)
    limits, scene = limit_rows(run, shape), cams.scene
    assumed = ranked(scene, lift) if scene and lift else ()
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            run=run,
            outcome=outcome,
            tables=tables,
            title=str(run.scene.get("title") or run.scene.get("name") or run.name),
            banner=banner(run),
            disagreements=disagreements(run, limits),
            headline=headline(run),
            limits=limits,
            quantities=QUANTITIES,
            limited=OF_MOTION,
            facts=facts(run, cams),
            sketch=shape and sketch(shape[0], shape[1].duration_deg),
            steps=advice(run, f"{run.path or run.name}/scene.toml", run.path or run.name, assumed),
            matrix=matrix(run, limits),
            scene=scene,
            ranked=assumed,
            moved=f"{100 * MOVED:.0f} %",
            stress=stress(cams),
            cards=cards(cams),
            geometry=geometry(cams),
            outside=outside_sentence(run.verification.outside),
            **_animation_variables(run, cams),
        )
    )


def _animation_variables(run: RunFolder, cams: RunCams) -> dict:
    """Template variables of the animation and the charts: data, script, and sentences on every motion left out."""
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
    """Sentences on the area, the bounce over the band, the contacts, and the speeds where jump and bounce begin."""
    d, v = run.design, run.verification
    sentences = []
    if is_number(d.get("area_ratio")):
        gap, bound = d.get("area_gap_percent"), shown(d.get("area_ratio_bound"))
        below = f", {shown(gap, 3)} % below the certified bound {bound}" if is_number(gap) else ""
        sentences.append(f"Area ratio {shown(d['area_ratio'])}{below}.")
    sentences += outcome.lift_sentence(run) + outcome.gain_sentences(run)
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
    return sentences + outcome.contact_sentence(run) + outcome.reserve(run)
