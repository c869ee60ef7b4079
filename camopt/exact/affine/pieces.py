"""The elements of a train as pieces: data by which the kernel handles all kinds of elements alike.

Let d be the compression of an element, d' its rate and z its memory. In a piece the force and the rate of the memory
are affine forms, constant + by_d d + by_rate d' + by_z z, and so are the piece's watches: each is positive while the
piece holds, and where it turns negative another piece follows. Force and rate of the memory are continuous where two
pieces meet, with three exceptions, whose jump is given by the watch's `kick`, per rate of the watch: the force of a
damped contact jumps at its closing, the damper of a dissipative law changes from chord to chord, and the rate of a
memory jumps where an element begins to slide or to refill.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from camopt.exact.affine.lines import lines
from camopt.exact.kernel.tables import ACTING, COMPRESSED, SEPARATED
from camopt.scene.laws import FRICTION, LINEAR, OIL
from camopt.scene.train import Train

Form = tuple  # of four numbers: constant, by_d, by_rate, by_z
NOTHING: Form = (0.0, 0.0, 0.0, 0.0)
FOLLOWING: Form = (0.0, 0.0, 1.0, 0.0)
"""Flow of a memory that follows the compression."""


class Watch(NamedTuple):
    """A quantity that is positive while a piece holds."""

    form: Form
    then: int  # piece that follows when it turns negative, by its number within the element
    kick: tuple = (0.0, 0.0)  # jumps of the force and of the memory's rate there, over the rate of the form


class Piece(NamedTuple):
    """A piece of an element's law."""

    state: int  # SEPARATED (no force), COMPRESSED or ACTING
    force: Form  # N
    watches: tuple[Watch, ...] = ()
    flow: Form = NOTHING  # m/s, rate of the memory


class Parts(NamedTuple):
    """The pieces of an element."""

    pieces: list[Piece]
    touch: int = 0  # piece whose elastic force begins at the touch of a contact
    reach: tuple = (-np.inf, np.inf)  # bounds of d - z [m]


@dataclass(frozen=True)
class Numbers:
    """The parameters of the laws of all elements (e), real or complex; their units are stated in `Train` and `Laws`."""

    stiffness: np.ndarray  # (e) coefficient of the law
    damping: np.ndarray  # (e)
    preload: np.ndarray  # (e)
    dissipation: np.ndarray  # (e)
    table: np.ndarray  # (e, q, 2)
    leak: np.ndarray  # (e)
    travel: np.ndarray  # (e)
    slip: np.ndarray  # (e)


def numbers_of(train: Train) -> Numbers:
    """The parameters of a train's laws."""
    laws, none = train.laws, np.zeros(len(train.a))
    if laws is None:
        tables = np.zeros((len(none), 1, 2))
        return Numbers(train.stiffness, train.damping, train.preload, none, tables, none, none, none)
    of_laws = laws.dissipation, laws.table, laws.leak, laws.travel, laws.slip
    return Numbers(laws.coefficient, train.damping, train.preload, *of_laws)


def parts_of(train: Train, numbers: Numbers) -> list[Parts]:
    """The pieces of every element of a train, with these parameters."""
    return [_element(train, numbers, e) for e in range(len(train.a))]


def forms_of(elements: list[Parts]) -> np.ndarray:
    """The forms (2p + w, 4) of p pieces with w watches: forces, then flows, then watches."""
    pieces = [piece for element in elements for piece in element.pieces]
    watches = [watch.form for piece in pieces for watch in piece.watches]
    return np.array([*(p.force for p in pieces), *(p.flow for p in pieces), *watches])


def _element(train: Train, numbers: Numbers, e: int) -> Parts:
    kind = LINEAR if train.laws is None else train.laws.kind[e]
    own_number = 1.0 if train.laws is None else train.laws.own_number[e]
    k = numbers.stiffness[e]
    if kind == OIL:
        return oil(k, numbers.leak[e], numbers.travel[e])
    if kind == FRICTION:
        return friction(k, numbers.slip[e])
    row_count = 1 if train.laws is None else train.laws.rows[e]
    straight, borders, mean = lines(kind, k, numbers.preload[e], own_number, numbers.table[e, :row_count])
    damping = numbers.damping[e] + numbers.dissipation[e] * mean
    return (contact if train.contact[e] else spring)(straight, borders, damping)


def spring(straight: np.ndarray, borders: np.ndarray, damping: np.ndarray) -> Parts:
    """The pieces of an element that pushes and pulls: one per line."""
    pieces = []
    for i, (constant, slope) in enumerate(straight):
        force = constant, slope, damping[i], 0.0
        pieces.append(Piece(ACTING, force, _neighbours(borders, i, 0, np.real(damping))))
    return Parts(pieces)


def contact(straight: np.ndarray, borders: np.ndarray, damping: np.ndarray) -> Parts:
    """The pieces of a contact: separated, and acting on every line above the touch; with a damper also compressed
    without force, because the damper cancels it. Each of the r lines has its own damper (r)."""
    zero = np.real(-straight[:, 0] / straight[:, 1])
    first = int(np.sum(zero[:-1] > np.real(borders)))  # line on which the force falls to zero
    straight, borders, damping, r = straight[first:], borders[first:], damping[first:], len(straight) - first
    damped = bool(np.real(damping[0]) > 0.0)
    pressed, acting = 1, 1 + r * damped
    (c0, k0) = straight[0]
    closing = Watch((-c0, -k0, 0.0, 0.0), acting, (-np.real(damping[0] / k0), 0.0))
    pieces = [Piece(SEPARATED, NOTHING, (closing,))]
    for i in range(r) if damped else ():
        c, k = straight[i]
        lower = () if i else (Watch((c, k, 0.0, 0.0), 0),)
        closes = Watch((-c, -k, -damping[i], 0.0), acting + i)
        pieces.append(Piece(COMPRESSED, NOTHING, (*lower, closes, *_neighbours(borders, i, pressed))))
    for i in range(r):
        c, k = straight[i]
        opens = Watch((c, k, damping[i], 0.0), pressed + i if damped else 0)
        pieces.append(Piece(ACTING, opens.form, (opens, *_neighbours(borders, i, acting, np.real(damping)))))
    return Parts(pieces, touch=acting)


def _neighbours(borders: np.ndarray, i: int, base: int, damping: np.ndarray | None = None) -> tuple[Watch, ...]:
    """The watches of line i at the compressions where it meets its neighbouring lines. `base` is the piece of line 0;
    `damping` (r) is given for pieces that act."""
    step = np.zeros(len(borders)) if damping is None else np.diff(damping)
    below = (Watch((-borders[i - 1], 1.0, 0.0, 0.0), base + i - 1, (-step[i - 1], 0.0)),) if i else ()
    above = (Watch((borders[i], -1.0, 0.0, 0.0), base + i + 1, (-step[i], 0.0)),) if i < len(borders) else ()
    return (*below, *above)


def oil(stiffness, leak, travel) -> Parts:
    """The pieces of the oil column of a hydraulic adjuster: the check ball is within its travel, or on its seat while
    the column leaks, or open while oil refills the column without force."""
    between, seated, refill = range(3)
    force = -stiffness * travel, stiffness, 0.0, -stiffness
    leaking = tuple(f / leak for f in force)
    return Parts(
        [
            Piece(
                SEPARATED,
                NOTHING,
                (Watch((travel, -1.0, 0.0, 1.0), seated), Watch((0.0, 1.0, 0.0, -1.0), refill, (0.0, 1.0))),
            ),
            Piece(ACTING, force, (Watch((-travel, 1.0, 0.0, -1.0), between),), leaking),
            Piece(SEPARATED, NOTHING, (Watch((0.0, 0.0, -1.0, 0.0), between),), FOLLOWING),
        ],
        reach=(0.0, np.inf),
    )


def friction(stiffness, slip) -> Parts:
    """The pieces of dry friction in series with a spring (Jenkins element): sticking, sliding in either direction."""
    stick, forward, back = range(3)
    follows = np.real(1.0 / stiffness)
    onward = Watch((slip, -stiffness, 0.0, stiffness), forward, (0.0, -follows))
    backward = Watch((slip, stiffness, 0.0, -stiffness), back, (0.0, follows))
    most = np.real(slip / stiffness)
    return Parts(
        [
            Piece(ACTING, (0.0, stiffness, 0.0, -stiffness), (onward, backward)),
            Piece(ACTING, (slip, 0.0, 0.0, 0.0), (Watch((0.0, 0.0, 1.0, 0.0), stick),), FOLLOWING),
            Piece(ACTING, (-slip, 0.0, 0.0, 0.0), (Watch((0.0, 0.0, -1.0, 0.0), stick),), FOLLOWING),
        ],
        reach=(-most, most),
    )
