"""Exact propagators over fixed spans, one set per combination of pieces, built only for combinations that occur.

With lift and forces by the cam angle as polynomials in tau = t / step, the motion (x, v), the memories z, these
polynomials' coefficients u and the constant 1 form one linear system; its matrix exponential advances them exactly,
whatever the stiffness. The quantity that decides whether an element switches is linear in them too, so its values,
slopes and power series are rows of matrices.
"""

from functools import lru_cache
from threading import Lock

import numpy as np

from camopt.exact.affine.lines import with_chords
from camopt.exact.kernel.arrays import TrainArrays, train_arrays
from camopt.exact.kernel.building import fill, linear_system
from camopt.exact.kernel.leap import leap_of
from camopt.exact.kernel.tables import Sizes, Tables, empty_tables
from camopt.scene.errors import InputError
from camopt.scene.rest import rest_position
from camopt.scene.train import Train

LARGEST_PHASE = 1.5
"""Product of default step and highest frequency [rad]: switchings are sought well within a quarter period of any mode.
"""
FIRST_COMBINATIONS = 32
"""Number of combinations for which there is room at first; the room doubles when it is used up."""


def highest_frequency(train: Train) -> float:
    """Largest eigenvalue magnitude [rad/s] with every element in its stiffest piece."""
    arrays = train_arrays(train)
    motion = linear_system(arrays, stiffest(arrays))
    return float(np.abs(np.linalg.eigvals(motion[:, : len(motion)])).max())


def stiffest(arrays: TrainArrays) -> np.ndarray:
    """Number (e) within each element of its piece of the largest stiffness, of several the one damped most."""
    pieces = (np.arange(*ends) for ends in zip(arrays.first[:-1], arrays.first[1:], strict=True))
    return np.array([np.lexsort(arrays.law[p, 2:0:-1].T)[-1] for p in pieces])


class Propagators:
    """The tables of one train for one step [s], lift width q (coefficients per piece) and number m of steps at once."""

    def __init__(self, train: Train, step: float, width: int, at_once: int):
        self.train, self.step, self.width, self.at_once = train, step, width, at_once
        self.arrays = arrays = train_arrays(train)
        self.sizes = Sizes(len(train.mass), train.state_size, width, len(train.forcing))
        watches = np.maximum.reduceat(np.diff(arrays.watched), arrays.first[:-1])
        combinations = min(FIRST_COMBINATIONS, int(arrays.place[-1]) * int(arrays.first[-1] - arrays.first[-2]))
        self._buffers = empty_tables(self.sizes, len(train.a), int(watches.sum()), at_once, combinations)
        try:
            self._buffers = self._buffers._replace(leap=leap_of(self.arrays, rest_position(with_chords(train))))
        except InputError:
            pass  # nothing holds the train at rest
        self.built = self._buffers._replace(keys=self._buffers.keys[:0])
        self._lock = Lock()

    def build(self, key: int) -> None:
        """Adds the tables of a combination of pieces, which has the number `key`.

        Tables that stand in `built` are never changed, because another thread may be reading them.
        """
        with self._lock:
            slot = len(self.built.keys)
            if key in self.built.keys:
                return
            if slot == len(self._buffers.keys):
                *parts, leap, sizes = self._buffers
                longer = (np.concatenate([part, np.zeros_like(part)]) for part in parts)
                self._buffers = Tables._make([*longer, leap, sizes])
            fill(self.arrays, self.train.seat, self.step, self._buffers, slot, key)
            self.built = self._buffers._replace(keys=self._buffers.keys[: slot + 1])


@lru_cache(maxsize=24)
def propagators(train: Train, step: float, width: int, at_once: int) -> Propagators:
    """The propagators of a train, shared by all speeds and cams that use the same step and lift width."""
    return Propagators(train, step, width, at_once)


@lru_cache(maxsize=256)
def default_step(train: Train) -> float:
    """Step [s] at which the highest mode turns by `LARGEST_PHASE`."""
    return LARGEST_PHASE / highest_frequency(train)
