"""How long a call takes: the least of several times, because other work on the machine only ever makes it longer."""

import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

REPEATS = 100
PATIENCE = 0.4
"""Seconds after which `timed` repeats a call no more."""
T = TypeVar("T")


def fastest(
    run: Callable[[], T], repeats: int, clock: Callable[[], Any] = time.process_time, *, first: bool = True
) -> tuple[Any, T]:
    """(least time of `repeats` calls [s], result of the last).

    Before them goes a `first` call, not counted, which compiles and builds tables. `clock` gives one time, or several
    in an array, of each of which the least is told.
    """
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
