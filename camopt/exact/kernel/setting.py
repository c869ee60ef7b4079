"""The train, cam and tables of a traced motion as the compiled code reads them, and the run itself."""

from functools import lru_cache
from threading import Lock
from typing import NamedTuple

import numpy as np

from camopt.exact.kernel.arrays import CamArrays, TrainArrays
from camopt.exact.kernel.propagators import ACTING, SEPARATED, TERMS, Propagators, Tables
from camopt.exact.kernel.revolution import DONE, revolve
from camopt.exact.kernel.trace import later
from camopt.programs import compiled


class Setting(NamedTuple):
    """A train with n masses, e elements and tables for s contact states; a cam of p pieces and its speed."""

    train: TrainArrays
    cam: CamArrays
    step: float  # s
    tables: Tables
    states: np.ndarray  # (s, e): of every contact
    motion: np.ndarray  # (s, n, 2n + 2): accelerations by x, v, lift, lift velocity
    integral: np.ndarray  # (s, m + 1, 2n + q + 1): the seat's distance, integrated over so many steps
    valve: int
    seat: int
    cam_side: np.ndarray  # contacts between cam and valve
    half_duration: float  # rad
    opening_foot: float  # rad


class SlotTables:
    """What the adjoint needs for each contact state beside the propagators; it grows as they do."""

    def __init__(self, tables: Propagators):
        self._tables, self._lock = tables, Lock()
        self._keys = np.empty(0, dtype=np.int64)
        n, e, c = len(tables.train.mass), len(tables.train.a), tables.built.steps.shape[2]
        self._parts = (
            np.empty((0, e), dtype=np.int64),
            np.empty((0, n, 2 * n + 2)),
            np.empty((0, tables.at_once + 1, c)),
        )

    def for_tables(self, built: Tables) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(states, motion, integral) of `Setting` for at least the contact states in `built`."""
        with self._lock:
            if len(self._keys) < len(built.keys):
                new = [self._of(built, slot) for slot in range(len(self._keys), len(built.keys))]
                states, motion, integral = (np.array(part) for part in zip(*new, strict=True))
                old = self._parts
                self._parts = (
                    np.concatenate([old[0], states]),
                    np.concatenate([old[1], motion]),
                    np.concatenate([old[2], integral]),
                )
                self._keys = built.keys
            return self._parts

    def _of(self, built: Tables, slot: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        train, contacts = self._tables.train, self._tables.contacts
        status = np.full(len(train.a), ACTING)
        status[contacts] = built.keys[slot] // 3 ** np.arange(len(contacts)) % 3
        return status, built.motion[slot, :-1].T.copy(), self._integral(built, slot, status)

    def _integral(self, built: Tables, slot: int, status: np.ndarray) -> np.ndarray:
        """The rows of `Setting.integral` for one contact state: from the seat's power series while the seat is apart,
        step by step, and zero otherwise."""
        train, c, steps = self._tables.train, built.steps.shape[2], self._tables.at_once
        rows = np.zeros((steps + 1, c))
        if train.seat < 0 or status[train.seat] != SEPARATED:
            return rows
        w = list(built.element[slot, : built.count[slot]]).index(train.seat)
        one = built.series[slot, w] @ (1.0 / np.arange(1, TERMS + 2)) / train.stiffness[train.seat]
        for i in range(steps):
            rows[i + 1] = rows[i] + built.steps[slot, i] @ one[:-1]
            rows[i + 1, -1] += one[-1]
        return rows


@lru_cache(maxsize=24)
def slot_tables(tables: Propagators) -> SlotTables:
    """The slot tables that belong to a set of propagators."""
    return SlotTables(tables)


@compiled
def follow(train, cam, step, tables, state, revolutions, most, rows, trace):
    """Writes whole revolutions from `state` (2n), which is changed in place, into the trace.

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
