"""Train and cam as records of plain arrays for the compiled kernel."""

from typing import NamedTuple

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.affine.inputs import Inputs
from camopt.exact.affine.pieces import Parts, forms_of, numbers_of, parts_of
from camopt.programs import pass_by_pointer
from camopt.scene.errors import InputError
from camopt.scene.train import Train, kept_with_train

MOST_COMBINATIONS = 2**63 - 1
"""Largest number of combinations of pieces, which are numbered by 64-bit integers."""


@pass_by_pointer
class TrainArrays(NamedTuple):
    """A train of n masses, e elements in p pieces with w watches, r memories and f forces over the cam angle, SI units.

    A piece has a number within its element, from 0, and one within the train. A memory is numbered by its position in
    the state (x, v, z), and a watch by its row in `law`. A form is (constant, by_d, by_rate, by_z), see
    `camopt.exact.affine.pieces`.
    """

    mass: np.ndarray  # (n)
    mass_damping: np.ndarray  # (n)
    mass_force: np.ndarray  # (n)
    forced: np.ndarray  # (f) mass on which each force over the cam angle acts
    a: np.ndarray  # (e) mass or GROUND
    b: np.ndarray  # (e) mass or GROUND
    valve: int  # mass, -1 for none
    seat: int  # element, -1 for none
    cam_side: np.ndarray  # contacts between cam and valve
    contact: np.ndarray  # (e) bool
    cam_driven: np.ndarray  # (e) bool
    gap: np.ndarray  # (e)
    memory: np.ndarray  # (e) number of the element's memory, -1 for none
    adjusters: np.ndarray  # (o) indices in the state of the memories of the oil between cam and valve
    reach: np.ndarray  # (r, 2) bounds of d - z of the elements with a memory
    place: np.ndarray  # (e) place value of each element in the number of a combination of pieces
    first: np.ndarray  # (e + 1) first piece of each element
    touch: np.ndarray  # (e) piece whose elastic force begins at the touch of a contact
    state: np.ndarray  # (p) SEPARATED, COMPRESSED or ACTING
    law: np.ndarray  # (2p + w, 4) forms: forces of all pieces, flows of their memories, and all watches
    watched: np.ndarray  # (p + 1) first watch of each piece, by its row in `law`
    then: np.ndarray  # (2p + w) piece of the same element after a watch has turned negative
    kick: np.ndarray  # (2p + w, 2) jumps of force and flow where a watch turns negative, over the watch's rate


class CamArrays(NamedTuple):
    """A lift law of p pieces with f forces over the cam angle on the same pieces, and the cam speed."""

    borders: np.ndarray  # (p + 1) rad
    pieces: np.ndarray  # (p, q + 2f) m/rad^k of the lift, then N and N/rad of every force
    speed: float  # rad/s


@kept_with_train
def train_arrays(train: Train) -> TrainArrays:
    """The train's arrays for the kernel. Raises InputError if there are more than MOST_COMBINATIONS of pieces."""
    elements, e = parts_of(train, numbers_of(train)), len(train.a)
    pieces = [piece for element in elements for piece in element.pieces]
    watches = [watch for piece in pieces for watch in piece.watches]
    first, watched = _starts([p.pieces for p in elements]), _starts([p.watches for p in pieces])
    forms, memory = forms_of(elements), np.full(e, -1)
    memory[list(train.memory)] = np.arange(len(train.memory))
    return TrainArrays(
        mass=train.mass,
        mass_damping=train.mass_damping,
        mass_force=train.mass_force,
        forced=np.array([forcing.on for forcing in train.forcing], dtype=np.int64),
        a=train.a,
        b=train.b,
        valve=train.valve,
        seat=train.seat,
        cam_side=np.array(train.cam_side, dtype=np.int64),
        contact=train.contact,
        cam_driven=train.cam_driven,
        gap=train.gap,
        memory=memory,
        adjusters=2 * len(train.mass) + memory[list(train.adjusters)].astype(np.int64),
        reach=np.array([elements[e].reach for e in train.memory]).reshape(-1, 2),
        place=_places(elements),
        first=first,
        touch=first[:-1] + [p.touch for p in elements],
        state=np.array([p.state for p in pieces]),
        law=forms,
        watched=2 * len(pieces) + watched,
        then=np.array([-1] * 2 * len(pieces) + [w.then for w in watches]),
        kick=np.array([(0.0, 0.0)] * 2 * len(pieces) + [w.kick for w in watches]),
    )


def _starts(groups: list) -> np.ndarray:
    """Index at which each group begins in the concatenation of all groups, and the end of the last one."""
    return np.cumsum([0, *(len(group) for group in groups)])


def _places(elements: list[Parts]) -> np.ndarray:
    """Place values (e) of the mixed-radix number of a combination of pieces."""
    places, total = [], 1
    for element in elements:
        places.append(total)
        total *= len(element.pieces)
    if total > MOST_COMBINATIONS:
        raise InputError(
            f"event-exact: the elements' pieces combine in {total:.1e} ways, and at most {MOST_COMBINATIONS:.1e} are "
            f"numbered: take fewer rows in force tables, or fewer chords"
        )
    return np.array(places)


def cam_arrays(inputs: Inputs, lift: Lift, cam_speed: float) -> CamArrays:
    """The arrays for the kernel of a lift law, divided into the pieces of `inputs`, at a cam speed [rad/s]."""
    return CamArrays(inputs.borders, inputs.pieces(lift.coefficients), float(cam_speed))
