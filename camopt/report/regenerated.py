"""Recomputation of a run's stated numbers: from the files in its folder, or from the cam in order to check those files.

The verdict of the design and everything derived from it can be recomputed. The search is not repeated, so
`area_ratio_no_jump` and `gradient_gain` keep their recorded values, and baselines keep the verdicts in `verdicts/`.
"""

import html
import json
import math
import re
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

from camopt.cam.design_file import read_design
from camopt.cam.lift import Lift
from camopt.optimizer.accuracy import accuracy_named
from camopt.optimizer.as_built.statement import statement_of_run
from camopt.optimizer.baselines.comparison import compare_again
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.candidates import full_verdict
from camopt.report.folder import RunFolder, read_run_folder
from camopt.report.limits import limit_rows
from camopt.report.motion import cams_of
from camopt.report.outcome import outcome_lines, outcome_rows
from camopt.report.page import render, write_report
from camopt.report.tables import leaves
from camopt.scene import InputError, Scene, load_scene
from camopt.scene.schema import SIMULATED
from camopt.scene.units import DEG, MM
from camopt.storage import check_file, plain
from camopt.verifier.record import VerificationRecord

SAME = 1e-6
"""Relative difference up to which two numbers count as equal: no table of a run prints more digits."""
NOTHING = 1e-9
"""Absolute difference up to which two numbers count as equal, in every unit of a run folder."""
MOST_SENTENCES = 20


def regenerate(folder: Path) -> Path:
    """Write comparison.csv, figures and report.html of a run folder again, from the cams and verdicts in it, and return
    the page's path. Raises InputError where a file is missing or cannot be understood, or nothing can be written."""
    scene = _scene_of(folder)
    check_file(folder / "report.html")
    compare_again(folder, scene, _accuracy_of(folder))
    return write_report(folder)


def _accuracy_of(folder: Path) -> object:
    """The accuracy in provenance.json, which is an untrusted file; None where it has none."""
    try:
        return json.loads((folder / "provenance.json").read_text(encoding="utf-8"))["settings"]["accuracy"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def stated_lines(run: RunFolder) -> list[str]:
    """Lines with every number of the limits and of the outcome table, and the file and key from which it was read."""
    lines = [
        f"limit {row['label']}: {row['reached']} {row['unit']}, {row['where']}  [{row['source']}]"
        for row in limit_rows(run)
    ]
    return lines + [
        f"end {row['label']}: {row['end']} {row['unit']}{', ' * bool(row['where'])}{row['where']}  [{row['source']}]"
        for row in outcome_rows(run)
    ]


def differences(folder: Path) -> list[str]:
    """Sentences on every number of verification.json, design.json, the outcome table and report.html that differs when
    the run's cam is verified again with the run's options; empty where all agree. Raises InputError where the folder
    does not record these options, or a file cannot be understood."""
    run, scene = read_run_folder(folder), _scene_of(folder)
    fresh = _verified_again(run, folder, scene)
    sentences = _json_differences("verification.json", run.verification, fresh.verification)
    sentences += _json_differences("design.json", run.design, fresh.design)
    before, after = outcome_lines(run), outcome_lines(fresh)
    sentences += [
        f"the last table says {old!r}, not {new!r}"
        for old, new in zip_longest(before, after, fillvalue="no further line")
        if old != new
    ]
    page = folder / "report.html"
    if not page.is_file():
        return [*sentences, "report.html is not in the run folder"]
    stated, recomputed = _lines(page.read_text(encoding="utf-8")), _lines(render(fresh, cams_of(folder, fresh)))
    sentences += [f"report.html does not say: {line}" for line in recomputed if line not in stated]
    sentences += [f"report.html says without a source: {line}" for line in stated if line not in recomputed]
    more = len(sentences) - MOST_SENTENCES
    return sentences[:MOST_SENTENCES] + ([f"and {more} more"] if more > 0 else [])


def _scene_of(folder: Path) -> Scene:
    if not folder.is_dir():
        raise InputError(f"{folder}: no such run folder")
    return load_scene(folder / "scene.toml", need=SIMULATED)


def _verified_again(run: RunFolder, folder: Path, scene: Scene) -> RunFolder:
    settings = run.settings
    if not {"accuracy", "speeds"} <= settings.keys():
        raise InputError(f"{folder}: provenance.json does not say with which speeds and accuracy the run was judged")
    lift, design = read_design(folder / "design.json", scene), scene.required_design
    verdict = full_verdict(scene, lift, settings["speeds"], accuracy_named(settings["accuracy"]))
    ratio, bound = lift.area_ratio_in(design), area_ratio_bound(design).bound
    areas = {"area_ratio": ratio, "area_mm_deg": lift.area / MM / DEG, "area_ratio_bound": bound,
             "area_gap_percent": 100 * (bound - ratio) / bound}  # fmt: skip
    if "highest_lift_mm" in run.design:  # older runs did not record it
        areas["highest_lift_mm"] = lift.max_lift / MM
    built = _yield_again(run, scene, lift, settings)
    verification = VerificationRecord(plain(verdict.as_dict() | built)).with_outside(run.verification.outside)
    return replace(run, verification=verification, design=run.design | areas)


def _yield_again(run: RunFolder, scene: Scene, lift: Lift, settings: dict) -> dict:
    """The statement on the trains as built, with all trains judged again; the baselines keep their recorded values.
    Empty for an older run, which has no statement."""
    if "yield" not in run.verification:
        return {}
    stated = statement_of_run(scene, lift, {"seed": 0} | settings, None)
    if stated is None:
        return {}
    recorded = {key: run.built[key] for key in ("baselines", "ideal", "advised") if key in run.built}
    return {"yield": stated.as_dict() | recorded}


def _json_differences(file: str, stated: Any, fresh: Any) -> list[str]:
    """Sentences on the leaves in which two JSON values differ."""
    old, new = dict(leaves(stated)), dict(leaves(fresh))
    pairs = [(key, old.get(key), new.get(key)) for key in {**old, **new}]
    return [f"{file} {key} says {was}, it comes out as {now}" for key, was, now in pairs if not _same(was, now)]


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, int | float) and isinstance(b, int | float):
        return math.isclose(a, b, rel_tol=SAME, abs_tol=NOTHING)
    return a == b


def _lines(page: str) -> list[str]:
    """The lines of text of a page, one for each row, paragraph, item and heading. Style, data, script and commands are
    left out; the paths in the commands depend on the folder in which the page was made."""
    text = re.sub(r"<(style|script|code)\b.*?</\1>", " ", page, flags=re.DOTALL)
    blocks = re.split(r"<(?:tr|p|li|h[123]|figcaption|strong)\b[^>]*>", text)
    lines = (" ".join(html.unescape(re.sub(r"<[^>]*>", " ", block)).split()) for block in blocks)
    return [line for line in lines if line]
