"""Exact propagators over fixed spans, one set per combination of pieces, built only for combinations that occur.

If lift and forces over the cam angle are polynomials in tau = t / step, the motion (x, v), the memories z, the
polynomials' coefficients u and the constant 1 form one linear system. Its matrix exponential advances them exactly,
whatever the stiffness. The quantity that decides whether an element switches is linear in them too, so that its values,
slopes and power series are rows of matrices.
"""

from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock, local
from typing import Any

import numpy as np

from camopt.exact.affine.lines import with_chords
from camopt.exact.kernel.arrays import train_arrays
from camopt.exact.kernel.building import linear_system
from camopt.exact.kernel.leap import leap_of
from camopt.exact.kernel.revolution import TABLES_FULL
from camopt.exact.kernel.tables import Leap, Sizes, Tables, empty_tables, no_leap
from camopt.exact.kernel.trace import NO_TRACE, Trace, empty_trace
from camopt.memory import give_memory_back, trim_heaps
from camopt.scene.errors import InputError
from camopt.scene.rest import rest_position
from camopt.scene.train import Train, kept_with_train

LARGEST_PHASE = 1.5
"""Product of default step and highest frequency [rad]: a step is well below a quarter period of any mode."""
FIRST_COMBINATIONS = 256
"""Initial capacity of the tables in combinations; the operating system provides the memory only as it is written to."""
FIRST_SEGMENTS = 1024
"""Initial capacity of a trace in segments per revolution."""
GROWTH = 4
"""Factor by which a full buffer is enlarged."""
KEPT, KEPT_BYTES = 24, 500_000_000
"""Largest number of sets of tables that are cached for later motions, and their largest total memory [bytes]: three
progressive springs replaced by chords have thousands of combinations, and each takes a seventh of a megabyte."""


def highest_frequency(train: Train) -> float:
    """Largest eigenvalue magnitude [rad/s] with every element in its stiffest piece, the most damped of several."""
    arrays = train_arrays(train)
    pieces = (np.arange(*ends) for ends in zip(arrays.first[:-1], arrays.first[1:], strict=True))
    motion = linear_system(arrays, np.array([np.lexsort(arrays.law[p, 2:0:-1].T)[-1] for p in pieces]))
    return float(np.abs(np.linalg.eigvals(motion[:, : len(motion)])).max())


@kept_with_train
def _leap(train: Train) -> Leap:
    """The leap of a train; an empty one if the train has no position of rest."""
    try:
        return leap_of(train_arrays(train), rest_position(with_chords(train)))
    except InputError:
        return no_leap(len(train.mass))


_ROOM = local()
"""Trace buffer of every thread."""


class Propagators:
    """The tables of one train for one step [s], lift width q (coefficients per piece) and m steps per span.

    The kernel adds the combinations of pieces that occur in a motion, so that only one thread at a time may use them.
    """

    def __init__(self, train: Train, step: float, width: int, at_once: int):
        give_memory_back()
        self.step, self.arrays, self._segments = step, train_arrays(train), FIRST_SEGMENTS
        arrays, sizes = self.arrays, Sizes(len(train.mass), train.state_size, width, len(train.forcing))
        watches = np.maximum.reduceat(np.diff(arrays.watched), arrays.first[:-1])
        combinations = min(FIRST_COMBINATIONS, int(arrays.place[-1]) * int(arrays.first[-1] - arrays.first[-2]))
        self.tables = empty_tables(sizes, len(train.a), int(watches.sum()), at_once, combinations)
        self.tables = self.tables._replace(leap=_leap(train))

    @property
    def size(self) -> int:
        """Memory of the written combinations [bytes]."""
        return int(self.tables.built[0]) * sum(array[0].nbytes for array in self.tables[1:-2])

    def trace(self, revolutions: int) -> Trace:
        """A trace buffer for a number of revolutions. All motions of a thread share it, so that it is overwritten by
        the next one: a new buffer costs as much as a short motion, because the system has to clear it."""
        self._segments = max(self._segments, FIRST_SEGMENTS * revolutions)
        width, buffer = self.tables.steps.shape[3], vars(_ROOM).get("trace", NO_TRACE)
        looks = self.tables.span.shape[2] - width
        if len(buffer.length) < self._segments or (buffer.y.shape[1], buffer.looks.shape[1]) != (width, looks):
            buffer = _ROOM.trace = empty_trace(self._segments, width, looks)
        return buffer

    def grow(self, code: int) -> None:
        """Enlarge what is full by a `code` of `camopt.exact.kernel.revolution`: the tables or the trace buffer."""
        if code != TABLES_FULL:
            self._segments *= GROWTH
            return
        built, *arrays, leap, sizes = self.tables
        longer = [np.empty((GROWTH * len(array), *array.shape[1:]), array.dtype) for array in arrays]
        for new, array in zip(longer, arrays, strict=True):
            new[: len(array)] = array
        self.tables = Tables._make([built, *longer, leap, sizes])


class Lending:
    """A pool of tables of one train, step, lift width and steps per span, each used by one thread at a time."""

    def __init__(self, *of: Any) -> None:
        self._of, self._free = of, list[Propagators]()

    @property
    def size(self) -> int:
        """Memory of the tables that are not in use [bytes]."""
        return sum(tables.size for tables in self._free)

    @contextmanager
    def lent(self) -> Iterator[Propagators]:
        """Tables for exclusive use within the context; those of an earlier motion if any are free."""
        try:
            tables = self._free.pop()
        except IndexError:
            tables = Propagators(*self._of)
        try:
            yield tables
        finally:
            self._free.append(tables)


_kept: OrderedDict[tuple, Lending] = OrderedDict()
_lock = Lock()


def propagators(train: Train, step: float, width: int, at_once: int) -> Lending:
    """The propagators of a train, shared by all speeds and cams that use the same step and lift width.

    The most recently used ones are cached, at most `KEPT` and `KEPT_BYTES`.
    """
    key = train, step, width, at_once
    with _lock:
        if key in _kept:
            _kept.move_to_end(key)
        else:
            _kept[key] = Lending(*key)
            size = sum(lending.size for lending in _kept.values())
            while len(_kept) > 1 and (len(_kept) > KEPT or size > KEPT_BYTES):
                size -= _kept.popitem(last=False)[1].size
        return _kept[key]


def forget_propagators() -> None:
    """Free all cached tables, for example after motions of many drawn trains that are not simulated again."""
    with _lock:
        _kept.clear()
    trim_heaps()


@kept_with_train
def default_step(train: Train) -> float:
    """Step [s] in which the phase of the highest mode advances by `LARGEST_PHASE`."""
    return LARGEST_PHASE / highest_frequency(train)
