"""The report of a run folder: one HTML file that opens offline and fetches nothing; its only script is its own."""

import base64
import hashlib
import json
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from camopt.cam.lift import Lift
from camopt.plots.style import DESIGN, cam_line
from camopt.report.advice import advice
from camopt.report.assumed import MOVED, assumed_rows, of_the_run
from camopt.report.cams import cards, geometry, stress
from camopt.report.curves import curves
from camopt.report.edge import edge_sentences
from camopt.report.first_screen import banner, facts, sketch
from camopt.report.folder import RunFolder, read_run_folder
from camopt.report.limits import disagreements, limit_rows, matrix
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
from camopt.report.wording import cell, heading, in_words, kind, label_and_unit, share_kind, shown, state, used
from camopt.scene.design import Design
from camopt.scene.quantities import QUANTITIES, is_number
from camopt.storage import write_text
from camopt.verifier.methods import METHOD_NAMES
from camopt.verifier.record import bounce_error_um, outside_sentence

HERE = Path(__file__).parent
SECTIONS = (
    ("limits", "Limits"), ("area", "Area"), ("motion", "Animation"), ("cams", "Cams"), ("motions", "Motion and forces"),
    ("band", "Band"), ("search", "Search"), ("card", "Cam card"), ("geometry", "Geometry"), ("train-data", "Train"),
    ("accuracy", "Accuracy"), ("verification", "Verification"), ("provenance", "Provenance"),
)  # fmt: skip
SCRIPTS = ("animation.js", "charts.js", "curves.js")
START = """
const data = JSON.parse(document.getElementById("run-data").textContent);
trainAnimation(document, data.animation);
new ReportCharts(document, data.curves, data.animation);
"""
"""What the page's script ends with: animation and charts of the data that the page embeds."""
CAPTIONS = {
    "profiles": ("The cams", "Lift, velocity, acceleration and jerk against cam angle; dashed lines are the limits."),
    "valve_motion": (
        "The valve's motion",
        "Valve lift, its closing enlarged, and the contact forces between cam and valve, at each speed; where a force "
        "is zero the contact is open.",
    ),
    "bounce_against_speed": (
        "Bounce and jump over the band",
        "Linear up to 0.01 mm, logarithmic above. The curves are event-exact alone; the verdict rests on the marked "
        "speeds and, where it was asked for, on the band.",
    ),
    "convergence": (
        "The search",
        "Area ratio of its steps, and worst bounce or, for a yield, the drawn trains that fail; only filled steps may "
        "be returned.",
    ),
    "prices": (
        "What tolerances cost",
        "Change of the largest area ratio where a tolerance is left out or halved, and for every per cent by which the "
        "numbers that it moves are raised; lines are standard errors.",
    ),
    "modes": ("Natural modes", "Shapes over the masses, of unit norm, with their frequencies."),
}
"""Figures that a run writes, in the order of the page: title and caption."""
SPEED_COLUMNS = (
    "jump_mm", "jump_deg", "contact_force_min_N", "contact_force_max_N", "seating_velocity_m_per_s",
    "impact_velocity_m_per_s", "dynamic_area_mm_deg", "revolutions", "periodic",
)  # fmt: skip
COSTS = {
    "clock_s": "clock s",
    "processor_s": "processor s",
    "compilation_s": "compiling s",
    "peak_memory_MB": "peak MB",
}
"""Keys of a stage's cost in provenance.json, and their headings."""
PLACED = ("profiles", "valve_motion", "bounce_against_speed", "convergence")
"""Figures that stand in a section of their own; any others follow before the tables."""


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
    environment.filters |= {"state": state, "share_kind": share_kind, "used": used}
    environment.tests["figure"] = is_number
    return environment


def render(run: RunFolder, cams: RunCams) -> str:
    """The page of a run folder's data and cams; every text from the folder is escaped."""
    limits, assumed = limit_rows(run, _shape(cams)), of_the_run(cams)
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            run=run,
            title=str(run.scene.get("title") or run.scene.get("name") or run.name),
            banner=banner(run),
            sections=SECTIONS,
            broken=broken_limits(run),
            disagreements=disagreements(run, limits),
            headline=headline(run),
            limits=limits,
            outcome=outcome_rows(run),
            worst=(run.verification.get("band") or {}).get("worst") or {},
            quantities=QUANTITIES,
            yields=yield_rows(run),
            areas=area_rows(run),
            groups=comparison_groups(run),
            reserve=reserve(run),
            facts=facts(run, cams),
            sketch=_sketch(cams),
            steps=advice(run, f"{run.path or run.name}/scene.toml", run.path or run.name, assumed),
            edge=edge_sentences(run),
            spoiling=yield_sentences(run),
            matrix=matrix(run, limits),
            scene=cams.scene,
            ranked=assumed_rows(assumed),
            moved=f"{100 * MOVED:.0f} %",
            stress=stress(cams),
            cards=cards(cams),
            geometry=geometry(cams),
            outside=outside_sentence(run.verification.outside),
            speed_columns=SPEED_COLUMNS,
            methods=method_tables(run),
            accuracy=accuracy(run),
            costs=COSTS,
            provenance=[*provenance_rows({k: v for k, v in run.provenance.items() if k != "stages"})],
            figures=figures(run),
            placed=PLACED,
            **_moving(run, cams),
        )
    )


def _shape(cams: RunCams) -> tuple[Lift, Design] | None:
    """The design's cam with what it is held to."""
    lift, design = cams.lifts.get(DESIGN), cams.scene.design if cams.scene else None
    return (lift, design) if lift is not None and design is not None else None


def _sketch(cams: RunCams) -> dict | None:
    shape = _shape(cams)
    return None if shape is None else sketch(shape[0], shape[1].duration_deg)


def _moving(run: RunFolder, cams: RunCams) -> dict:
    """The animation's part of the page: data and script, or the sentences that say why there is none."""
    data, left_out = animation(cams)
    if data is None:
        return {"animation": "", "script": "", "script_hash": "", "motion_note": "", "motion_left_out": left_out}
    script = "\n".join((HERE / name).read_text(encoding="utf-8") for name in SCRIPTS) + START
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    circle = f"a base circle of {shown(data['base_radius_mm'])} mm"
    if data["follower"] == "point":
        circle += " and a pointed follower, for the scene gives no [geometry]"
    note = (
        f"Simulated by event-exact, one revolution once the motion has settled, a sample every "
        f"{shown(data['step_deg'])} deg. Cam and masses move to one "
        f"scale, the cam with {circle}; gaps are drawn larger, as far as there is room. Yellow: an open contact."
    )
    return {
        "animation": embedded({"animation": data, "curves": curves(run, cams)}),
        "script": script,
        "script_hash": f"sha256-{digest}",
        "motion_note": note,
        "motion_left_out": left_out,
    }


def embedded(data: dict) -> str:
    """JSON that may stand inside a script element: nothing in it can end the element or begin another."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


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


def accuracy(run: RunFolder) -> list[str]:
    """What accuracy was asked for, and what was delivered, in the words of the verification's own statement."""
    asked = run.settings.get("accuracy", run.provenance.get("accuracy"))
    unit = " µm" if is_number(asked) else ""
    stated = (run.verification.get("accuracy") or {}).get("statement")
    return [
        f"Asked for: {shown(asked)}{unit}." if asked is not None else "The accuracy asked for is not recorded.",
        f"Delivered: {str(stated).partition('; ')[2]}." if stated else "No error estimate was delivered.",
    ]


def figures(run: RunFolder) -> list[dict]:
    """The drawings with title and caption: the known ones in the page's order, then any others by name. As an image a
    drawing can neither run a script nor load anything."""
    names = [name for name in CAPTIONS if name in run.figures] + sorted(run.figures.keys() - CAPTIONS.keys())
    shown_figures = []
    for name in names:
        title, caption = CAPTIONS.get(name, (name, ""))
        image = "data:image/svg+xml;base64," + base64.b64encode(run.figures[name].encode()).decode()
        shown_figures.append({"name": name, "title": title, "caption": caption, "image": image})
    return shown_figures
