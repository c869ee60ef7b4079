"""The cost of accuracy on a scene: error against time for every method and every dial of the job.

Each measurement is a line of `measured.jsonl`, written as soon as it is known, so that an interrupted run resumes;
`tradeoff.csv`, `setup.csv`, the figures and the tables are made from these lines.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camopt.cam.design_file import design_record
from camopt.cam.lift import Lift
from camopt.scene import InputError, MotionRefused, Scene, build_train
from camopt.scene.text_file import scene_toml
from camopt.scene.units import MM
from camopt.storage import check_run_folder, default_run_folder, run_folder, run_identity, write_csv, write_text
from camopt.storage.journal import Records
from camopt.study.measurements import COLUMNS, LINES, REFERENCE, Measurement, aligned, measured

KNOT_DEG = 3.0
"""Knot interval [deg] of the default cam."""
MARGIN_N = 40.0
"""Least contact force [N] of the default cam, where that is possible."""
SIZES = ("small", "full")
TARGET_UM = 1.0
"""Error of the lift [um] within which each method's cheapest setting is shown: what a drawing requires of a cam."""
JOB = "job: "
"""Prefix of the case names of the job's dials."""


@dataclass(frozen=True)
class Tradeoff:
    """The measurements: the folder, the rows of `tradeoff.csv`, and the lines of a table with the cheapest setting of
    each method within a micrometre at the highest speed, one of which is recommended."""

    folder: Path
    rows: list[dict]
    table: list[str]


def tradeoff(
    scene: Scene,
    out: Path | str | None = None,
    resume: bool = False,
    *,
    size: str = "full",
    progress: bool = False,
    cam: Lift | None = None,
) -> Tradeoff:
    """Measures a scene's methods and job, and writes tradeoff.csv, setup.csv, tradeoff.txt and figures into `out`.

    With `size` "small" there are only a few settings, and neither JAX nor the optimiser is used. With `resume` an
    interrupted run in `out` is continued. The motions are those of `cam`, by default a cam that keeps contact
    (`holding_cam`), because no method is accurate where a valve bounces. Raises InputError for a scene that cannot be
    simulated, or for which there is no cam, before the folder is created; or for an unusable folder.
    """
    from camopt.plots.studies import figures
    from camopt.plots.style import save
    from camopt.study.tradeoff.methods import job_work, method_work

    if scene.operation is None or scene.design is None or scene.seat is None:
        raise InputError(f"scene {scene.name}: tradeoff needs valve, seat, [operation] and [design]")
    if size not in SIZES:
        raise InputError(f"tradeoff: size {size!r}: expected one of {', '.join(SIZES)}")
    path = Path(out or default_run_folder(scene.name))
    check_run_folder(path, resume)
    cam = holding_cam(scene) if cam is None else cam
    work = [*method_work(scene, cam, size)]
    if build_train(scene).laws is None:
        work += job_work(scene, cam, size, path)
    record = design_record(cam, scene.design.max_lift_mm * MM)
    identity = run_identity("tradeoff", scene, size=size, cam=record)
    with run_folder(path, identity, resume, [LINES]) as folder:
        write_text(folder / "scene.toml", scene_toml(scene))
        journal = Records(folder / LINES, "case", "method", "setting")
        lines = measured(journal, [*map(or_failure, work)], progress)
        rows = rows_of(lines)
        write_csv(folder / "tradeoff.csv", {name: [row[name] for row in rows] for name in COLUMNS})
        setup = [line for line in lines if line.get("setup_seconds") is not None]
        names = ("case", "method", "setting", "setup_seconds")
        write_csv(folder / "setup.csv", {name: [line[name] for line in setup] for name in names})
        tables = tables_of(rows)
        write_text(folder / "tradeoff.txt", "\n\n".join("\n".join(lines) for lines in tables.values()) + "\n")
        for name, figure in figures(rows).items():
            save(figure, folder / "figures", name)
        by_method = [lines for case, lines in tables.items() if not case.startswith(JOB)]
        return Tradeoff(folder, rows, by_method[-1] if by_method else [])


def or_failure(measurement: Measurement) -> Measurement:
    """A measurement whose failure is recorded in the table with its reason."""
    key, run = measurement

    def tried() -> dict:
        try:
            return {"failure": "", **run()}
        except (InputError, MotionRefused, ArithmeticError, RuntimeError) as failure:
            return {"failure": str(failure)}

    return key, tried


def holding_cam(scene: Scene) -> Lift:
    """The cam of the no-jump program at the listed speeds, with `MARGIN_N` or the largest possible smaller margin; the
    plain Polydyne where the program has no solution."""
    from camopt.cam.families.polydyne import polydyne
    from camopt.optimizer.program.no_jump import no_jump_program
    from camopt.optimizer.program.program_cam import program_cam

    try:
        design, speeds = scene.required_design, [scene.cam_speed(s) for s in scene.required_operation.speeds_rpm]
        program = no_jump_program(build_train(scene), design, program_cam(design, KNOT_DEG), speeds)
        return program.solve_below(np.full((3, len(speeds)), MARGIN_N)).lift
    except InputError:
        return polydyne(scene)


def rows_of(lines: Sequence[dict]) -> list[dict]:
    """Rows of tradeoff.csv: one per metric of a measurement, with its error against the case's reference; the error of
    a verdict is 1 where it differs. A reference that was timed for the same job is a row with error 0."""
    references = {line["case"]: line for line in lines if line["method"] == REFERENCE}
    rows = []
    for line in lines:
        shared = {name: line[name] for name in ("case", "method", "setting")}
        shared |= {"seconds": line.get("seconds"), "verdict": line["failure"] or line.get("verdict", "")}
        if line["failure"]:
            rows.append({**shared, "error": None, "error_of": "", "converged": False})
        elif line["method"] != REFERENCE or "seconds" in line:
            reference = references.get(line["case"], {})
            figures, true = line.get("figures", {}), reference.get("figures", {})
            errors = {name: error_of(figures[name], true[name]) for name in figures if name in true}
            if "verdict" in line and "verdict" in reference:
                errors["verdict"] = float(line["verdict"] != reference["verdict"])
            errors |= line.get("errors", {})
            rows += [{**shared, "error": e, "error_of": name, "converged": e is not None} for name, e in errors.items()]
    return [{name: row[name] for name in COLUMNS} for row in rows]


def error_of(figure, reference) -> float | None:
    """Largest absolute difference; None where either value is missing."""
    figure, reference = (np.asarray(q, dtype=float) for q in (figure, reference))
    difference = figure - reference
    return float(np.abs(difference).max()) if np.all(np.isfinite(difference)) else None


def tables_of(rows: Sequence[dict]) -> dict[str, list[str]]:
    """The lines of a table by case of the rows of tradeoff.csv: costs by method, or by setting of a dial."""
    answered, tables = [r for r in rows if r["converged"] and r["seconds"] is not None], {}
    for case in dict.fromkeys(r["case"] for r in answered):
        rows_of_case = [r for r in answered if r["case"] == case]
        tables[case] = _by_setting(case, rows_of_case) if case.startswith(JOB) else _by_method(case, rows_of_case)
    return {case: lines for case, lines in tables.items() if lines}


def _by_method(case: str, rows: Sequence[dict]) -> list[str]:
    """The cheapest setting of each method within `TARGET_UM`, or else its most accurate one."""
    best: dict[str, tuple] = {}
    for row in rows:
        if row["error_of"] == "lift_mm" and row["method"] != REFERENCE:
            um, ms, method = 1e3 * row["error"], 1e3 * row["seconds"], row["method"]
            beyond = um > TARGET_UM
            entry = beyond, um if beyond else ms, ms, (method, row["setting"], f"{ms:.3g}", f"{um:.2g}")
            best[method] = min(best.get(method, entry), entry)
    order = sorted(best.values(), key=lambda entry: (entry[0], entry[2]))
    cells = [("*" * (i == 0 and not beyond), *words) for i, (beyond, _, _, words) in enumerate(order)]
    heading = f"A {case}, the valve's lift within {TARGET_UM:g} um, or as near as a method came; * is recommended:"
    return [heading, *aligned([("", "method", "setting", "time ms", "error um"), *cells], "<<<>>")] if cells else []


def _by_setting(case: str, rows: Sequence[dict]) -> list[str]:
    """Every setting of a dial with its time, its errors, and the verdict on its cam."""
    cells = [("setting", "time s", "bounce um off", "area mm deg off", "verdict")]
    for setting, row in {r["setting"]: r for r in rows}.items():
        errors = {r["error_of"]: r["error"] for r in rows if r["setting"] == setting}
        bounce = f"{1e3 * errors['bounce_mm']:.2g}" if "bounce_mm" in errors else ""
        area = f"{errors['area_mm_deg']:.2g}" if "area_mm_deg" in errors else ""
        cells.append((setting, f"{row['seconds']:.3g}", bounce, area, row["verdict"]))
    return [f"{case.removeprefix(JOB).capitalize()}, against the finest:", *aligned(cells, "<>>>>")]
