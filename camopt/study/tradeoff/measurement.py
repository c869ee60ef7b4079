"""One measurement of `camopt tradeoff`, the lines that measurements leave, and the rows made from these lines."""

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from tqdm import tqdm

from camopt.scene import InputError, MotionRefused
from camopt.storage import append_line, plain, whole_lines

COLUMNS = ("case", "method", "setting", "error", "error_of", "seconds", "converged", "verdict")
REPEATS = 100
PATIENCE = 0.4
"""Seconds after which a call is not repeated again."""
REFERENCE = "reference"
T = TypeVar("T")


@dataclass(frozen=True)
class Measurement:
    """One measurement: `run` gives figures by name (numbers or arrays), or under "errors" the errors themselves; and
    "seconds", "setup_seconds", "verdict" where it has them."""

    case: str
    method: str
    setting: str
    run: Callable[[], dict]

    @property
    def key(self) -> tuple[str, str, str]:
        return self.case, self.method, self.setting


def measured(path: Path, work: Sequence[Measurement], progress: bool = False) -> list[dict]:
    """The lines of all measurements, in the order of `work`; those already in the file are not measured again."""
    known = {(line["case"], line["method"], line["setting"]): line for line in map(json.loads, whole_lines(path))}
    with tqdm(work, disable=None if progress else True, unit="measurement", dynamic_ncols=True) as bar:
        for one in bar:
            bar.set_description(f"{one.case}: {one.method}")
            if one.key not in known:
                known[one.key] = _measure(one)
                append_line(path, json.dumps(known[one.key], allow_nan=False))
    return [known[one.key] for one in work]


def _measure(one: Measurement) -> dict:
    """The line of a measurement; what fails stays in the table with its reason."""
    line = {"case": one.case, "method": one.method, "setting": one.setting}
    try:
        return plain({**line, "failure": "", **one.run()})
    except (InputError, MotionRefused, ArithmeticError, RuntimeError) as failure:
        return {**line, "failure": str(failure)}


def rows_of(lines: Sequence[dict]) -> list[dict]:
    """Rows of tradeoff.csv: one per figure of a measurement, its error against the case's reference; that of a verdict
    is 1 where it differs. A reference that took its time for the same job is a row of error 0."""
    references = {line["case"]: line for line in lines if line["method"] == REFERENCE}
    rows = []
    for line in lines:
        shared = {name: line[name] for name in ("case", "method", "setting")}
        shared |= {"seconds": line.get("seconds"), "verdict": line["failure"] or line.get("verdict", "")}
        if line["failure"]:
            rows.append({**shared, "error": None, "error_of": "", "converged": False})
        elif line["method"] != REFERENCE or "seconds" in line:
            errors = _errors(line, references.get(line["case"], {})) | line.get("errors", {})
            rows += [{**shared, "error": e, "error_of": name, "converged": e is not None} for name, e in errors.items()]
    return [{name: row[name] for name in COLUMNS} for row in rows]


def _errors(line: dict, reference: dict) -> dict[str, float | None]:
    found, true = line.get("figures", {}), reference.get("figures", {})
    errors = {name: error_of(name, found[name], true[name]) for name in found if name in true}
    if "verdict" in line and "verdict" in reference:
        errors["verdict"] = float(line["verdict"] != reference["verdict"])
    return errors


def error_of(name: str, found, reference) -> float | None:
    """Largest absolute difference, of a gradient relative in the Euclidean norm; None where either has no figure."""
    found, reference = (np.asarray(q, dtype=float) for q in (found, reference))
    difference = found - reference
    if not np.all(np.isfinite(difference)):
        return None
    if name == "gradient":
        size = float(np.linalg.norm(reference))
        return float(np.linalg.norm(difference)) / size if size > 0 else None
    return float(np.abs(difference).max())


def timed(call: Callable[[], T], per: float = 1.0) -> tuple[dict, T]:
    """({"seconds": least processor time of a call over `per`, "setup_seconds": what the first one took beyond}, its
    result); processor time, because another program on the machine shall not look like a slow method."""
    first, result = _processor_seconds(call)
    seconds: list[float] = []
    while not seconds or (len(seconds) < REPEATS and sum(seconds) < PATIENCE):
        seconds.append(_processor_seconds(call)[0])
    return {"seconds": min(seconds) / per, "setup_seconds": max(0.0, first - min(seconds))}, result


def _processor_seconds(call: Callable[[], T]) -> tuple[float, T]:
    begin = time.process_time()
    result = call()
    return time.process_time() - begin, result
