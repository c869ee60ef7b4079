"""Tables of the kernel: exact propagators over fixed spans, one set for each combination of pieces."""

from typing import NamedTuple

import numpy as np

from camopt.programs import pass_by_pointer

FINE = 16
"""Stored propagators inside a step: an instant is at most 1/32 of a step from one, 0.047 rad of the highest mode."""
TERMS = 22
"""Highest power in the series of a watched quantity: over one step the remainder is below 1e-16 of the motion."""
SEPARATED, COMPRESSED, ACTING = 0, 1, 2
"""States of an element: separated; compressed without force, because the damper cancels it; acting with a force."""


class Leap(NamedTuple):
    """The motion on the base circle in one combination of pieces, by r modes: real ones, and one of conjugate pairs.

    Every mode decays, so that a watch stays above its `level` minus the sum of `sway` times the sizes of the modes.
    """

    key: np.ndarray  # (1) combination of pieces; -1 for none
    to_modes: np.ndarray  # (2n + 1, 2r) real, then imaginary parts by x, v and the constant
    from_modes: np.ndarray  # (2r + 1, 2n)
    rate: np.ndarray  # (2, r) 1/s, real and imaginary part
    sway: np.ndarray  # (w, r)
    level: np.ndarray  # (w) the watches in equilibrium


class Sizes(NamedTuple):
    """Parts of y: x (n), v (n), z (r), the lift's coefficients (q), and two coefficients for each of f forces."""

    masses: int  # n
    state: int  # 2n + r, index of the first coefficient of the lift
    lift: int  # q
    forces: int  # f


@pass_by_pointer
class Tables(NamedTuple):
    """The kernel's data for each of s combinations of pieces.

    The matrices are transposed: their c rows belong to x, v, z, the inputs u (lift and forces over the cam angle) and
    the constant 1. A watch is a quantity of an element that is positive until the element switches; there are at most w
    of them, of which `count` are in use.
    """

    built: np.ndarray  # (1) number of combinations that have been written; these are never changed
    keys: np.ndarray  # (s) numbers of the combinations
    count: np.ndarray  # (s) watches in use
    element: np.ndarray  # (s, w) element that switches when the watch turns negative
    watch: np.ndarray  # (s, w) number of the watch within the train
    pieces: np.ndarray  # (s, e) piece of every element, by its number within the train
    states: np.ndarray  # (s, e) state of every element
    span: np.ndarray  # (s, c, c - 1 + 2 w (m + 1)): x, v, z, u after m steps; then values and slopes at every step
    steps: np.ndarray  # (s, m + 1, c, c - 1): x, v, z, u after every step
    fine: np.ndarray  # (s, FINE, c, c - 1): x, v, z, u after every FINE-th of a step
    motion: np.ndarray  # (s, 2n + r + 3 + f, n + r): rates of v, z by x, v, z, lift, its velocity, forces, 1, in SI
    rates: np.ndarray  # (s, n + r, 2n + r + 2 + f): `motion` without the constants, not transposed
    series: np.ndarray  # (s, w, c, TERMS + 1): the watch's power series in tau
    integral: np.ndarray  # (s, m + 1, c): integral of the seat's distance over 0 to m steps
    distance: np.ndarray  # (s, c, 2 (m + 1)): the seat's distance and its slope by the step at every step
    leap: Leap
    sizes: Sizes


def empty_tables(sizes: Sizes, elements: int, watches: int, at_once: int, combinations: int) -> Tables:
    """Tables with room for a number of combinations of pieces with at most `watches` each, none of them written."""
    n, w, s, m, inputs = sizes.masses, watches, combinations, at_once, sizes.state + 2 + sizes.forces
    c = sizes.state + sizes.lift + 2 * sizes.forces + 1
    return Tables(
        built=np.zeros(1, dtype=np.int64),
        keys=np.empty(s, dtype=np.int64),
        count=np.empty(s, dtype=np.int64),
        element=np.empty((s, w), dtype=np.int64),
        watch=np.empty((s, w), dtype=np.int64),
        pieces=np.empty((s, elements), dtype=np.int64),
        states=np.empty((s, elements), dtype=np.int64),
        span=aligned(s, c, c - 1 + 2 * w * (m + 1)),
        steps=np.empty((s, m + 1, c, c - 1)),
        fine=np.empty((s, FINE, c, c - 1)),
        motion=np.empty((s, inputs + 1, sizes.state - n)),
        rates=np.empty((s, sizes.state - n, inputs)),
        series=np.empty((s, w, c, TERMS + 1)),
        integral=np.empty((s, m + 1, c)),
        distance=np.empty((s, c, 2 * (m + 1))),
        leap=no_leap(n),
        sizes=sizes,
    )


def aligned(*shape: int) -> np.ndarray:
    """An array aligned to cache lines of 64 bytes: loading a vector register across two lines takes twice as long."""
    count = int(np.prod(shape))
    room = np.empty(count + 7)
    first = -(room.ctypes.data // 8) % 8
    return room[first : first + count].reshape(shape)


def no_leap(masses: int) -> Leap:
    """An empty leap, for a train without one."""
    n2 = 2 * masses
    empty = np.zeros((n2 + 1, 0)), np.zeros((1, n2)), np.zeros((2, 0)), np.zeros((0, 0)), np.zeros(0)
    return Leap(np.full(1, -1), *empty)
