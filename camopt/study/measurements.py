"""Measurements of `camopt tradeoff` and `camopt extremes`, which resume after an interruption, and timing of calls. The
least of several times counts, because other work on the machine can only lengthen a call."""

import time
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
from tqdm import tqdm

from camopt.storage.journal import Records

LINES = "measured.jsonl"
"""The journal of a run folder, with a line for each measurement."""
COLUMNS = ("case", "method", "setting", "error", "error_of", "seconds", "converged", "verdict")
"""Columns of tradeoff.csv and extremes.csv."""
REFERENCE = "reference"
"""The method name of a case's reference, with which all others are compared."""
Measurement = tuple[tuple[str, ...], Callable[[], dict]]
"""The values of the journal's key fields, case and method first, and the function that returns the other fields."""


def measured(journal: Records, work: Sequence[Measurement], progress: bool = False) -> list[dict]:
    """The records of all measurements, in the order of `work`; those in the journal are not measured again."""
    records = []
    with tqdm(work, disable=None if progress else True, unit="measurement", dynamic_ncols=True) as bar:
        for key, run in bar:
            bar.set_description(": ".join(key[:2]))
            if journal.get(*key) is None:
                journal.add(dict(zip(journal.names, key, strict=True)) | run())
            records.append(journal.get(*key))
    return records


def aligned(cells: Sequence[Sequence[str]], sides: str) -> list[str]:
    """The lines of a table whose columns are aligned to the left (<) or to the right (>)."""
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    spec = list(zip(sides, widths, strict=True))
    lines = ("  ".join(f"{text:{side}{width}}" for text, (side, width) in zip(row, spec, strict=True)) for row in cells)
    return [line.rstrip() for line in lines]


REPEATS = 100
PATIENCE = 0.4
"""Total time [s] after which `timed` stops repeating a call."""
T = TypeVar("T")


def fastest(
    run: Callable[[], T], repeats: int, clock: Callable[[], Any] = time.process_time, *, first: bool = True
) -> tuple[Any, T]:
    """The least time [s] of `repeats` calls and the result of the last one. A `first` call, which compiles and builds
    tables, is not counted. `clock` returns one time, or several as an array, each of which is minimised."""
    if first:
        run()
    seconds = []
    while True:
        begin = clock()
        result = run()
        seconds.append(clock() - begin)
        if len(seconds) == repeats:
            return np.min(seconds, axis=0), result


def timed(run: Callable[[], T], per: float = 1.0) -> tuple[dict[str, float], T]:
    """({"seconds": least processor time of a call divided by `per`, "setup_seconds": the excess of the first call},
    result). Processor time is used so that other programs on the machine do not make a method look slow."""
    first, result = fastest(run, 1, first=False)
    seconds: list[float] = []
    while not seconds or (len(seconds) < REPEATS and sum(seconds) < PATIENCE):
        seconds.append(float(fastest(run, 1, first=False)[0]))
    return {"seconds": min(seconds) / per, "setup_seconds": max(0.0, float(first) - min(seconds))}, result
