"""How long a call takes: the least of several times, because other work on the machine only ever makes it longer."""

import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

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
