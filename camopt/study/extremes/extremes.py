"""`camopt extremes`: every method at the extremes, a verdict each; a wrong number without a warning is a defect.

One revolution from rest with the scene's Polydyne, changed as `extreme_cases` lists; the truth is event-exact (DOP853
where laws are curved), each method halves its step until its figures stand, and
`camopt.study.extremes.classification` compares.
"""

import csv
import io
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial
from pathlib import Path

from tqdm import tqdm

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.scene import InputError, Scene, Train, build_train
from camopt.storage import append_line, run_folder, run_identity, whole_lines, write_text
from camopt.study.extremes.cases import AS_IT_IS, ExtremeCase, cases
from camopt.study.extremes.classification import (
    NOT_CONVERGED,
    RANGE,
    REFUSED,
    VERDICTS,
    WITHIN,
    WRONG,
    Truth,
    doubtful_figure,
    first_answer,
    judge,
    samples,
    truth,
)
from camopt.study.extremes.step_methods import DIAL, LOCATING, SMOOTH, STEP_METHODS, smooth
from camopt.verifier.convergence import Converged, Prepare, first_steps
from camopt.verifier.verdict import event_exact

COLUMNS = ("case", "method", "setting", "error", "error_of", "seconds", "converged", "verdict")
FILE = "extremes.csv"
PAST = 32
"""By what the first number of steps is divided to be past every explicit method's limit, twice halved too."""
NARROWER = {"eps 2e-13 m": 1e4, "eps 2e-18 m": 1e9, "eps zero": float("inf")}
"""By what the width of the smooth contact's layer is divided on its way to zero."""
DOP853_STEPS = 20_000
"""First steps per revolution beyond which DOP853 is left out of a case: it would take minutes."""
REFERENCE = "event"
Method = Callable[[ExtremeCase, Lift, Truth], Converged]


def extremes(
    scenes: Sequence[Scene],
    folder: str | Path,
    resume: bool = False,
    progress: bool = True,
    named: Collection[str] | None = None,
) -> list[dict]:
    """Runs the list over `scenes` and writes `extremes.csv` row by row into `folder`; returns all its rows.

    With `named` only the cases of these names are run; with `resume` rows that are there already are not run again.
    Raises InputError for a folder that exists without `resume` or cannot be written.
    """
    work = [(scene, case) for scene in scenes for case in cases(scene) if named is None or case.name in named]
    with run_folder(folder, run_identity("extremes", scenes), resume, [FILE]) as begun:
        rows = _read(begun / FILE)
        have = {(r["case"], r["method"]) for r in rows}
        with tqdm(work, disable=None if progress else True, unit="case") as bar:
            for scene, case in bar:
                bar.set_postfix_str(f"{scene.name}: {case.name}")
                for row in _rows(scene, case, have):
                    _append(begun / FILE, row)
                    rows.append(row)
    return rows


def methods(case: ExtremeCase, train: Train) -> dict[tuple[str, str], Method]:
    """What a case is put to besides the reference, by case name and method: the case as it is also stands for steps
    past the stability limit and for layers of the smooth contact on their way to zero."""
    first = first_steps(train, case.scene.cam_speed(case.speed_rpm))
    found = {(case.name, name): _stepping(prepare) for name, prepare in STEP_METHODS.items()}
    if not train.straight:
        found[case.name, REFERENCE] = _stepping(event_exact)
    elif first <= DOP853_STEPS:
        found[case.name, "dop853"] = _stepping(LOCATING["dop853"], 2, samples(first))
    if " + " not in case.name:
        found |= {(case.name, name): _stepping(prepare, 2, DIAL) for name, prepare in SMOOTH.items()}
    if case.name == AS_IT_IS:
        past = {("steps past the limit", m): _stepping(p, 2, -(-first // PAST)) for m, p in STEP_METHODS.items()}
        thin = {(label, "smooth"): _stepping(partial(smooth, narrower=by), 2, DIAL) for label, by in NARROWER.items()}
        found |= past | thin
    return found


def _stepping(prepare: Prepare, halvings: int = 4, steps: int | None = None) -> Method:
    def answer(case: ExtremeCase, lift: Lift, true: Truth) -> Converged:
        return first_answer(prepare, true.train, lift, case.scene.cam_speed(case.speed_rpm), halvings, steps)

    return answer


def _rows(scene: Scene, case: ExtremeCase, have: set[tuple[str, str]]) -> Iterator[dict]:
    """The rows of one case that are not there yet: the reference first, which the others need.

    Where laws are curved DOP853 is the reference, and event-exact with its chords one of those that are judged.
    """
    reference, train = (f"{scene.name}: {case.name}", REFERENCE), build_train(case.scene)
    asked = {(f"{scene.name}: {label}", method): run for (label, method), run in methods(case, train).items()}
    asked = {key: run for key, run in asked.items() if key not in have}
    if not asked and reference in have:
        return
    lift, begin = polydyne(scene), time.perf_counter()
    row = {"case": reference[0], "error": None, "error_of": "", "seconds": 0.0, "converged": False}
    try:
        locating = LOCATING[REFERENCE if train.straight else "dop853"]
        true = truth(locating, train, lift, case.scene.cam_speed(case.speed_rpm))
    except InputError as refusal:
        for name, method in {reference: None, **asked}:
            yield {**row, "case": name, "method": method, "setting": str(refusal), "verdict": REFUSED}
        return
    if train.straight and reference not in have:
        yield _reference_row(row, true, time.perf_counter() - begin)
    for (name, method), run in asked.items():
        yield {**row, "case": name, "method": method, **_answered(run, method, case, lift, true)}


def _answered(run: Method, method: str, case: ExtremeCase, lift: Lift, true: Truth) -> dict:
    """One method's part of a row."""
    begin = time.perf_counter()
    try:
        answer = run(case, lift, true)
    except InputError as refusal:
        return {"setting": str(refusal), "verdict": REFUSED}
    verdict, error_of, error = judge(answer, true)
    setting = f"{answer.steps_per_revolution} {'dial' if method in SMOOTH else 'steps'}"
    seconds = round(time.perf_counter() - begin, 3)
    return {"setting": setting, "error": None if verdict == REFUSED else error, "error_of": error_of,
            "seconds": seconds, "converged": answer.converged, "verdict": verdict}  # fmt: skip


def _reference_row(row: dict, true: Truth, seconds: float) -> dict:
    """Event-exact beside its own finer steps."""
    name, share = doubtful_figure(true)
    verdict = WITHIN if share <= 1.0 else RANGE if true.sensitive(name) else NOT_CONVERGED
    return {**row, "method": REFERENCE, "setting": f"{true.answer.steps_per_revolution} samples",
            "error": true.answer.error[name], "error_of": name, "seconds": round(seconds, 3),
            "converged": true.answer.converged, "verdict": verdict}  # fmt: skip


def defects(rows: list[dict]) -> list[dict]:
    """Rows that end in a wrong number without a warning."""
    return [r for r in rows if r["verdict"] == WRONG]


def counts(rows: list[dict]) -> dict[str, dict[str, int]]:
    """How often each method ended in each verdict."""
    by_method = {m: [r["verdict"] for r in rows if r["method"] == m] for m in dict.fromkeys(r["method"] for r in rows)}
    return {m: {v: found.count(v) for v in VERDICTS if v in found} for m, found in by_method.items()}


def _read(file: Path) -> list[dict]:
    """Rows of a table left by an interrupted run, which is begun where there is none."""
    lines = whole_lines(file)
    if not lines:
        write_text(file, ",".join(COLUMNS) + "\n")
    elif tuple(next(csv.reader(lines[:1]))) != COLUMNS:
        raise InputError(f"{file}: is not a table of `camopt extremes`: give another --out")
    return list(csv.DictReader(lines))


def _append(file: Path, row: dict) -> None:
    """One line more, on the disk before the next case begins."""
    line = io.StringIO()
    csv.DictWriter(line, COLUMNS, lineterminator="").writerow(row)
    append_line(file, line.getvalue())
