"""Steps over the rest of the base circle, where the lift is constant and a motion is a sum of decaying modes.

Once no contact can switch any more, because the modes are small, the end of the base circle is evaluated directly.
"""

import numpy as np
from numpy.linalg import LinAlgError

from camopt.exact.kernel.advance import apply
from camopt.exact.kernel.arrays import TrainArrays
from camopt.exact.kernel.building import linear_system
from camopt.exact.kernel.elements import classify, form_row
from camopt.exact.kernel.tables import Leap, no_leap
from camopt.programs import njit_no_refcount

REBUILT = 1e-12
"""Largest error of the equations of motion as reconstructed from the modes, relative to the largest eigenvalue."""


def leap_of(train: TrainArrays, rest: np.ndarray) -> Leap:
    """The leap of a train in the pieces that hold at its rest positions (n).

    There is none if the modes are not distinct, if one of them does not decay, or if the train has a memory, which
    settles far more slowly than the modes.
    """
    n, status = len(rest), np.empty(len(train.a), dtype=np.int64)
    if len(train.reach):
        return no_leap(n)
    classify(train, 1.0, np.concatenate([rest, np.zeros(n + 2)]), status)
    motion = linear_system(train, status)
    a, constant = motion[:, : 2 * n], motion[:, -1]
    scale = np.repeat([1.0, np.sqrt(np.abs(a).max())], n)
    rates, vectors = np.linalg.eig(a / scale[:, None] * scale)
    try:
        inverse, equilibrium = np.linalg.inv(vectors), -np.linalg.solve(a / scale[:, None] * scale, constant / scale)
    except LinAlgError:
        return no_leap(n)
    error = np.abs((vectors * rates) @ inverse - a / scale[:, None] * scale).max()
    if np.real(rates).max() >= 0.0 or not error < REBUILT * np.abs(rates).max():
        return no_leap(n)
    chosen = np.flatnonzero(np.imag(rates) >= 0.0)
    twice = np.where(np.imag(rates)[chosen] > 0.0, 2.0, 1.0)
    inverse, vectors = inverse[chosen] / scale, vectors[:, chosen] * scale[:, None] * twice
    equilibrium = equilibrium * scale
    to_modes = np.column_stack([inverse, -inverse @ equilibrium])
    pieces = train.first[:-1] + status
    watched = [(e, w) for e, p in enumerate(pieces) for w in range(train.watched[p], train.watched[p + 1])]
    rows = np.zeros((len(watched), motion.shape[1]))
    for row, (e, w) in zip(rows, watched, strict=True):
        form_row(train, e, train.law[w], row)
    rows = rows[:, [*range(2 * n), -1]]
    arrays = (
        np.array([int(status @ train.place)]),
        np.concatenate([np.real(to_modes), np.imag(to_modes)]).T,
        np.concatenate([np.real(vectors).T, -np.imag(vectors).T, equilibrium[None]]),
        np.stack([np.real(rates), np.imag(rates)])[:, chosen],
        np.abs(rows[:, :-1] @ vectors),
        rows[:, :-1] @ equilibrium + rows[:, -1],
    )
    return Leap(*(np.ascontiguousarray(array) for array in arrays))


@njit_no_refcount
def no_switch_possible(leap, y, modes, size):
    """Whether no contact can switch any more while the lift is constant; writes the modes (2r) of y (2n)."""
    count = len(size)
    apply(leap.to_modes, y, len(y), 2 * count, modes)
    for j in range(count):
        size[j] = np.sqrt(modes[j] * modes[j] + modes[count + j] * modes[count + j])
    for w in range(len(leap.level)):
        margin = leap.level[w]
        for j in range(count):
            margin -= leap.sway[w, j] * size[j]
        if margin <= 0.0:
            return False
    return True


@njit_no_refcount
def modal_step(leap, duration, modes, y):
    """Write to y (2n) the state `duration` [s] after the one with these modes (2r), which are overwritten."""
    count = leap.rate.shape[1]
    for j in range(count):
        size, turn = np.exp(leap.rate[0, j] * duration), leap.rate[1, j] * duration
        cosine, sine = size * np.cos(turn), size * np.sin(turn)
        real, imaginary = modes[j], modes[count + j]
        modes[j] = real * cosine - imaginary * sine
        modes[count + j] = real * sine + imaginary * cosine
    apply(leap.from_modes, modes, len(modes), len(y), y)
