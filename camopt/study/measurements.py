"""Measurements that `camopt tradeoff` and `camopt extremes` write, and go on with after an interruption; times of
calls, the least of several, because other work on the machine only ever makes a call longer."""

import time
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
from tqdm import tqdm

from camopt.storage.journal import Records

LINES = "measured.jsonl"
"""The journal of a run folder, a line for each measurement."""
COLUMNS = ("case", "method", "setting", "error", "error_of", "seconds", "converged", "verdict")
"""Columns of tradeoff.csv and extremes.csv."""
REFERENCE = "reference"
"""The method of a case's reference, against which the errors of all others are taken."""
Measurement = tuple[tuple[str, ...], Callable[[], dict]]
"""The values of the journal's names, case and method first, and what gives the rest of the record."""


def measured(journal: Records, work: Sequence[Measurement], progress: bool = False) -> list[dict]:
    """The records of all measurements, in the order of `work`; those that the journal holds are not made again."""
    records = []
    with tqdm(work, disable=None if progress else True, unit="measurement", dynamic_ncols=True) as bar:
        for key, run in bar:
            bar.set_description(": ".join(key[:2]))
            if journal.get(*key) is None:
                journal.add(dict(zip(journal.names, key, strict=True)) | run())
            records.append(journal.get(*key))
    return records


def aligned(cells: Sequence[Sequence[str]], sides: str) -> list[str]:
    """The lines of a table, each of whose columns stands to the left (<) or to the right (>)."""
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    how = list(zip(sides, widths, strict=True))
    lines = ("  ".join(f"{text:{side}{width}}" for text, (side, width) in zip(row, how, strict=True)) for row in cells)
    return [line.rstrip() for line in lines]


REPEATS = 100
PATIENCE = 0.4
"""Seconds after which `timed` repeats a call no more."""
T = TypeVar("T")


def fastest(
    run: Callable[[], T], repeats: int, clock: Callable[[], Any] = time.process_time, *, first: bool = True
) -> tuple[Any, T]:
    """(least time of `repeats` calls [s], result of the last), after a `first` call, not counted, which compiles and
    builds tables. `clock` gives one time, or several in an array, of each of which the least is told."""
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
    """({"seconds": least processor time of a call over `per`, "setup_seconds": what the first one took beyond}, its
    result); processor time, because another program on the machine shall not look like a slow method."""
    first, result = fastest(run, 1, first=False)
    seconds: list[float] = []
    while not seconds or (len(seconds) < REPEATS and sum(seconds) < PATIENCE):
        seconds.append(float(fastest(run, 1, first=False)[0]))
    return {"seconds": min(seconds) / per, "setup_seconds": max(0.0, float(first) - min(seconds))}, result
