"""The train, cam and tables of a traced motion as the compiled code reads them, and the run itself."""

from typing import NamedTuple

import numpy as np

from camopt.exact.kernel.arrays import CamArrays, TrainArrays
from camopt.exact.kernel.revolution import DONE, revolve
from camopt.exact.kernel.tables import Tables
from camopt.exact.kernel.trace import later
from camopt.programs import compiled


class Setting(NamedTuple):
    """A train with its tables; a cam and its speed; what metrics are taken of."""

    train: TrainArrays
    cam: CamArrays
    step: float  # s
    tables: Tables
    valve: int
    seat: int
    cam_side: np.ndarray  # contacts between cam and valve
    half_duration: float  # rad
    opening_foot: float  # rad


@compiled
def follow(train, cam, step, tables, state, revolutions, most, rows, trace):
    """Writes whole revolutions from `state` (2n + r), which is changed in place, into the trace.

    Returns (code, number of segments or missing key, number of switchings). `rows` is where `revolve` would write
    samples; here it has no room for any.
    """
    used, total = 0, 0
    for turn in range(revolutions):
        rest = later(trace, used)
        code, count, switchings = revolve(train, cam, step, tables, state, rows, rest, most)
        total += switchings
        if code != DONE:
            return code, count, total
        for k in range(count + 1):
            rest.angle[k] += 2.0 * np.pi * turn
        used += count
    return DONE, used, total
