"""The cam of largest area at a price of what drawn trains use of their limits, by slopes of their real motions.

Foretold openings (`openings_program`) lead to the neighbourhood of a cam; here every train that comes near a limit on
the motion says how much it uses of it and, by the adjoint of its event-exact motion, how that follows the cam's
coefficients. The program about a cam gains area ratio and pays the price for the mean over all trains of how far each
is beyond a target below its limits: the tail expectation of Rockafellar and Uryasev (2000), Journal of Risk 2:21,
which a linear program holds. The tail has many times as many trains as may fail, so that no cam suits the few worst
ones alone.
"""

from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from math import comb
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, hstack, vstack

from camopt.cam.lift import Lift
from camopt.exact.adjoint.motion import TracedMotion
from camopt.exact.settled.lift_pieces import lift_between
from camopt.highs import minimise
from camopt.optimizer.as_built.drawn import MET, TrainEnsemble
from camopt.optimizer.as_built.measured import WORKERS
from camopt.optimizer.program.kinematic import area_ratio_row, peak_angle, spline_rows, with_lift_reached
from camopt.optimizer.program.no_jump import NoJumpOptimum, NoJumpProgram
from camopt.optimizer.search.region import first_region
from camopt.scene.errors import MotionRefused
from camopt.storage.journal import StepFiles

TAIL, SPREADS, TARGETS = 10, 2.0, (0.25, 0.9)
"""The target of a limit lies SPREADS times as far below it as the first train that may not fail uses more of it than
the one beyond which there are TAIL times as many, or than the one that uses least where there are not: far below a
limit on the jump, of which some trains use many times as much as others, and near to one on seating velocities, which
are much alike. It lies not below what half of the trains use, and in any case within TARGETS."""
NEAR, SOON = 0.06, 0.06
"""A train has rows from so far below the target on, and is judged from SOON below that with every cam."""
TOP_SCOUTS, OTHER_SCOUTS = 10, 100
"""Of the other trains one in so many is judged with every cam at the top of the band, and at other speeds."""
FARTHEST = 10.0
"""Use of a limit from which on a motion is another one, whose slopes lead nowhere."""
STEEP = 10.0
"""Slopes that are so many times as large as the median are those of motions that graze."""
REVOLUTIONS = 2
"""Revolutions that a train goes on with each cam: its motion settles while the cam does."""
FIRST_WIDTH, NARROWER = 0.1, 0.93
"""First width of the box about a cam, as a part of that of the forces' program, and its factor from one to the next, by
which it is divided where the cams are to go farther."""
FIRST = 200
"""Trains that are followed at all speeds with the first cam. The others are followed at the speeds at which these come
near to their limits."""
CAMS, MEAN = 2, 4
"""Rows about so many cams are in the program: a train's largest opening changes its place from one to the next, and
contacts that stay closed with a cam have no slopes, until they open with the next. The mean of so many cams suits more
trains than each of them, which suits those of its own rows."""
SHAPING, TRACED = "shaping", (*MET, "train", "offset", "slope", "target")
"""The folder of a run in which what the trains met with each cam is kept, and the names of the arrays: what the trains
used, and the rows of the program."""


class CamOfSlopes(NamedTuple):
    """A cam of the program: its free coefficients z (m), area ratio and lift."""

    z: np.ndarray
    area_ratio: float
    lift: Lift


class UseRows(NamedTuple):
    """What trains (r) use of a limit: `offset` (r) + `slope` (r, m) @ z, and the `target` (r) of that limit."""

    train: np.ndarray
    offset: np.ndarray
    slope: np.ndarray
    target: np.ndarray


@dataclass
class SlopesProgram:
    """The program about one cam after the other, on `count` trains `drawn` for it; `plain` has the limits on the shape.
    What the trains met with a cam is kept in `journal`."""

    plain: NoJumpProgram
    drawn: TrainEnsemble
    count: int
    journal: StepFiles
    targets: np.ndarray = field(init=False)  # (l) by limit
    cam: CamOfSlopes = field(init=False)  # about which the program is

    def __post_init__(self) -> None:
        self._width = FIRST_WIDTH * first_region(self.plain.design).width
        self._area, self._area_at_zero = area_ratio_row(self.plain.design, self.plain.cam)
        self._turn, self._rows, self._last = 0, deque[UseRows](maxlen=CAMS), deque[np.ndarray](maxlen=MEAN)
        self.targets = np.full(len(self.drawn.limits), TARGETS[1])

    @property
    def mean(self) -> CamOfSlopes:
        """The mean of the program's last cams."""
        return self.cam_of(np.mean(self._last, axis=0))

    def about(self, cam: NoJumpOptimum, lost: float) -> float:
        """Goes on from another cam, and returns how many times as many of the first trains fail with it as may of which
        a part may be `lost`. They are followed at all speeds with the first cam, and then at those that matter."""
        drawn = self.drawn
        if not drawn.trains:
            drawn.settle(cam.lift)
            drawn.draw(min(FIRST, self.count))
        else:
            drawn.doubt(drawn.matters(lost))
        self.cam = self.cam_of(cam.z)
        self._trace()
        return drawn.failing / max(lost * len(drawn.trains), 1.0)

    def begin(self, lost: float) -> None:
        """Draws all trains, a part of which may be `lost`; what they use with the cam from which it goes on says what
        the targets are. They are followed twice, since at first each moves as the train as designed does."""
        if self.count > len(self.drawn.trains):
            self.drawn.draw(self.count, self.drawn.matters(lost))
        self._trace()
        worst = np.sort(np.minimum(self.drawn.used.max(axis=2), FARTHEST), axis=0)  # (t, l)
        last = (np.array([TAIL, 1]) * lost * len(worst) + 1e-9).astype(int)
        tail, most = worst[-1 - np.clip(last, 0, len(worst) - 1)]
        apart = np.maximum(1.0 - SPREADS * (most - tail), np.median(worst, axis=0))
        self.targets = np.clip(apart, *TARGETS)
        self._rows.append(self._trace())
        self._top = peak_angle(self.cam.lift)

    def step(self, price: float, farther: bool = False) -> None:
        """Goes on to the program's cam at a `price`, about which the next program is, in a narrower box, or in a wider
        one where the cams are to go `farther`."""
        self.cam = self.cam_of(self._optimum(price))
        self._last.append(self.cam.z)
        self._width *= 1.0 / NARROWER if farther else NARROWER
        self._rows.append(self._trace())

    def cam_of(self, z: np.ndarray) -> CamOfSlopes:
        """The cam of free coefficients z (m)."""
        return CamOfSlopes(z, float(self._area @ z + self._area_at_zero), self.plain.cam.lift(z))

    def _trace(self) -> UseRows:
        """The rows about the cam, by the trains that are or may soon be near a target, and those whose turn it is."""
        cam = self.cam
        self._turn += 1
        stored = self.journal.stored(self._turn, cam.z, TRACED)
        if stored is not None:
            self.drawn.take(stored)
            return UseRows(*(stored[name] for name in UseRows._fields))
        used, turn = self.drawn.used, np.arange(len(self.drawn.trains)) + self._turn
        near = (used > (self.targets - NEAR - SOON)[:, None]).any(axis=1) | (turn % OTHER_SCOUTS == 0)[:, None]
        near[:, -1] |= turn % TOP_SCOUTS == 0
        numbers = np.flatnonzero(near.any(axis=1)).tolist()
        with ThreadPoolExecutor(WORKERS) as pool:
            traced = list(pool.map(lambda t: self._traced_train(cam.lift, t, np.flatnonzero(near[t])), numbers))
        rows = self._about(cam.z, [row for of_train in traced for row in of_train])
        if self.journal.kept:
            self.journal.store(self._turn, cam.z, self.drawn.met(near) | rows._asdict())
        return rows

    def _about(self, z: np.ndarray, traced: list[tuple[int, int, float, np.ndarray]]) -> UseRows:
        """The rows about the cam of z (m), without those of motions that graze."""
        train, limit = np.array([row[:2] for row in traced], dtype=int).reshape(-1, 2).T
        use, slope = np.array([row[2] for row in traced]), np.array([row[3] for row in traced]).reshape(-1, len(z))
        size = np.abs(slope).max(axis=1)
        good = size <= STEEP * np.median(size) if len(size) else size > 0.0
        return UseRows(train[good], (use - slope @ z)[good], slope[good], self.targets[limit[good]])

    def _traced_train(self, lift: Lift, t: int, speeds: np.ndarray) -> list[tuple[int, int, float, np.ndarray]]:
        """What `_traced` gives at some of the speeds of train t, whose cam is ground once."""
        cam = lift_between(self.drawn.trains[t].cam(lift), lift.borders)
        return [row for s in speeds.tolist() for row in self._traced(cam, lift.borders, t, s)]

    def _traced(self, cam: Lift, plain: np.ndarray, t: int, s: int) -> list[tuple[int, int, float, np.ndarray]]:
        """How much of its limits train t with its ground `cam` uses at its speed s in the motion that goes on from
        where it was with the cam before; for those that it comes near to train, limit, use, and its slope by the
        coefficients (m) of the cam as designed, whose pieces lie between the `plain` borders."""
        one, limits, start = self.drawn.trains[t], self.drawn.limits, self.drawn.states[t, s]
        try:
            motion = TracedMotion(one.train, cam, self.drawn.speeds(t)[s], start, REVOLUTIONS)
        except MotionRefused:
            self.drawn.used[t, :, s] = np.inf
            self.drawn.begin_anew(t, s)
            return []
        values = motion.values([limit.metric for limit in limits], REVOLUTIONS - 2)
        use = np.array([float(limit.share(value)) for limit, value in zip(limits, values, strict=True)])
        self.drawn.used[t, :, s] = use
        self.drawn.states[t, s] = motion.end
        if use.max() >= (1.0 if one.train.memory else FARTHEST):
            self.drawn.begin_anew(t, s)
        if use.max() >= FARTHEST:
            return []
        near = np.flatnonzero(use > self.targets - NEAR).tolist()
        if not near:
            return []
        found = motion.gradient([limits[i].metric for i in near], REVOLUTIONS - 2).by_coefficients
        by_pieces = [_by_pieces(rows, cam.borders, plain)[:, : self._basis.shape[1]] for rows in found]
        by_free = [np.einsum("pq,pqm->m", pieces, self._basis) for pieces in by_pieces]
        slopes = [limits[i].share_slope * slope for i, slope in zip(near, by_free, strict=True)]
        return [(t, i, use[i], slope) for i, slope in zip(near, slopes, strict=True) if np.isfinite(slope).all()]

    @cached_property
    def _basis(self) -> np.ndarray:
        """The coefficients of the cam's pieces by its free ones (p, q, m)."""
        return self.plain.cam.piece_basis()[0]

    def _optimum(self, price: float) -> np.ndarray:
        """The coefficients (m) of the program's cam: its columns are they and, by train with rows, how far it is
        beyond."""
        z, parts = self.cam.z, zip(*self._rows, strict=True)
        train, offset, slope, target = (np.concatenate(part) for part in parts)
        tail, column = np.unique(train, return_inverse=True)
        plain = self.plain
        matrix, bound = with_lift_reached(plain.cam, plain.design, plain.limits.matrix, plain.limits.bound, self._top)
        shape = spline_rows(matrix)
        size, count = shape.column, len(tail)
        beyond = csr_array((np.ones(len(train)), (np.arange(len(train)), column)), shape=(len(train), count))
        rows = vstack(
            [
                hstack([csr_array(shape.scaled), csr_array((len(shape.scaled), count))]),
                hstack([csr_array(slope * size), -beyond]),
            ]
        )
        high = np.concatenate([bound / shape.norm, target - offset])
        cost = np.concatenate([-self._area * size, np.full(count, price / len(self.drawn.trains))])
        box = np.column_stack([z - self._width, z + self._width]) / size[:, None]
        bounds = np.vstack([box, np.tile([0.0, np.inf], (count, 1))])
        return minimise(cost, rows, -np.inf, high, bounds).x[: len(z)] * size


def _by_pieces(by_ground: np.ndarray, borders: np.ndarray, plain: np.ndarray) -> np.ndarray:
    """Gradient by the coefficients of the pieces between `plain` borders (p + 1), of one by the coefficients (g, q) of
    the same law's pieces between more `borders` (g + 1): the transposed shift of a Taylor polynomial."""
    piece = np.searchsorted(plain, 0.5 * (borders[1:] + borders[:-1])) - 1
    step, found = borders[:-1] - plain[piece], np.zeros((len(plain) - 1, by_ground.shape[1]))
    for k in range(by_ground.shape[1]):
        np.add.at(found[:, k], piece, sum(comb(k, j) * step ** (k - j) * by_ground[:, j] for j in range(k + 1)))
    return found
