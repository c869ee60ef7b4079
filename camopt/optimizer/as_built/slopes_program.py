"""Linear programs of largest area with a penalty on the limit usage of drawn trains, by gradients of the real motions.

Predicted openings (`openings_program`) lead to the neighbourhood of a cam. Here the limit usage of every train near a
limit on the motion is linearised in the cam's coefficients, by the adjoint of its event-exact motion. The program about
a cam maximises the area ratio minus a penalty: the price times the mean, over all trains, of the excess of each train
over a target below its limits. This is the tail expectation of Rockafellar and Uryasev (2000), Journal of Risk 2:21,
which is linear in the program. The tail contains many times as many trains as may fail, so that the cam is not fitted
to the few worst trains alone.
"""

from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from math import comb
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, hstack, vstack

from camopt.cam.lift import Lift
from camopt.exact.adjoint.motion import TracedMotion
from camopt.exact.settled.lift_pieces import lift_between
from camopt.highs import minimise
from camopt.optimizer.as_built.drawn import STORED, TrainEnsemble
from camopt.optimizer.as_built.measured import WORKERS
from camopt.optimizer.program.kinematic import area_ratio_row, peak_angle, spline_rows, with_lift_reached
from camopt.optimizer.program.no_jump import NoJumpProgram
from camopt.optimizer.search.region import first_region
from camopt.scene.errors import MotionRefused
from camopt.storage.journal import StepFiles

TAIL, SPREADS, TARGETS = 10, 2.0, (0.25, 0.9)
"""Parameters of the target of a limit. The target lies SPREADS * (u1 - u2) below the limit. Here u1 is the usage of the
worst train that may not fail, and u2 that of the train with TAIL times as many trains above it as may fail, or of the
best train where there are too few. So the target is far below a limit on the jump, whose usage differs between trains
by large factors, and close to a limit on the seating velocity, whose usage is similar in all trains. The target is at
least the median usage, and is always within TARGETS."""
NEAR, SOON = 0.06, 0.06
"""A train has a row where its usage exceeds the target minus NEAR, and it is traced with every cam at the speeds where
its last usage exceeded the target minus NEAR minus SOON."""
TOP_SCOUTS, OTHER_SCOUTS = 10, 100
"""Of the other trains one in TOP_SCOUTS is traced with each cam at the top, one in OTHER_SCOUTS at all speeds."""
FARTHEST = 10.0
"""Limit usage from which on the motion differs too much for its gradient to be useful."""
STEEP = 10.0
"""Ratio to the median gradient above which a gradient is discarded: contacts graze in such a motion."""
REVOLUTIONS = 2
"""Revolutions for which each motion is continued with each cam: it settles while the cam converges."""
FIRST_WIDTH, NARROWER = 0.1, 0.93
"""First width of the box about the cam, as a fraction of the first width for the programs on forces, and the factor on
it from one program to the next. The width is divided by this factor where the cams must move farther."""
FIRST = 200
"""Number of trains that are traced at all speeds with the first cam. The others are traced only where these come close
to their limits."""
CAMS, MEAN = 2, 4
"""Number of successive cams whose rows are in the program, and number of cams that are averaged. Rows about more than
one cam are needed because a train's largest opening moves from one cam to the next, and because a contact that stays
closed with one cam has no gradient until it opens with the next. The mean cam suits more trains than each."""
SHAPING, TRACED = "shaping", (*STORED, "train", "offset", "slope", "target")
"""Folder of a run in which the results of the trains with each cam are stored, and the names of the arrays: those of
the ensemble and those of the program's rows."""


class YieldCandidate(NamedTuple):
    """A cam of the program: its free coefficients z (m), area ratio and lift."""

    z: np.ndarray
    area_ratio: float
    lift: Lift


class UseRows(NamedTuple):
    """Linearised usages (r): `offset` (r) + `slope` (r, m) @ z, by `train` (r), with the limit's `target` (r)."""

    train: np.ndarray
    offset: np.ndarray
    slope: np.ndarray
    target: np.ndarray


@dataclass
class SlopesProgram:
    """The program about successive cams, on `count` trains of the ensemble `drawn`. `plain` has the limits on the
    shape; the results of the trains with each cam are stored in `journal`."""

    plain: NoJumpProgram
    drawn: TrainEnsemble
    count: int
    lost: float  # fraction of the trains that may fail
    journal: StepFiles
    targets: np.ndarray = field(init=False)  # (l) by limit
    cam: YieldCandidate = field(init=False)  # the present cam, about which the usages are linearised

    def __post_init__(self) -> None:
        self._width = FIRST_WIDTH * first_region(self.plain.design).width
        self._area, self._area_at_zero = area_ratio_row(self.plain.design, self.plain.cam)
        self._basis = self.plain.cam.piece_basis()[0]  # (p, q, m) the pieces' coefficients by the free ones
        self._turn, self._rows, self._last = 0, deque[UseRows](maxlen=CAMS), deque[np.ndarray](maxlen=MEAN)
        self.targets = np.full(len(self.drawn.limits), TARGETS[1])

    @property
    def mean(self) -> YieldCandidate:
        """The mean of the program's last cams."""
        return self.cam_of(np.mean(self._last, axis=0))

    def move_to(self, z: np.ndarray) -> float:
        """Moves to the cam of z (m), and returns the number of the first trains that fail with it, divided by the
        number that may fail. With the first cam they are traced at all speeds, later at the critical ones."""
        drawn, self.cam = self.drawn, self.cam_of(z)
        if not drawn.trains:
            drawn.settle(self.cam.lift)
            drawn.draw(min(FIRST, self.count))
        else:
            drawn.mark_unjudged(drawn.critical_speeds(self.lost))
        self._trace()
        return drawn.failing / max(self.lost * len(drawn.trains), 1.0)

    def set_targets(self) -> None:
        """Draws all trains, and sets the targets from their usage with the present cam. The trains are traced twice,
        since their first motions start in the states of the train as designed."""
        if self.count > len(self.drawn.trains):
            self.drawn.draw(self.count, self.drawn.critical_speeds(self.lost))
        self._trace()
        worst = np.sort(np.minimum(self.drawn.used.max(axis=2), FARTHEST), axis=0)  # (t, l)
        last = (np.array([TAIL, 1]) * self.lost * len(worst) + 1e-9).astype(int)
        tail, most = worst[-1 - np.clip(last, 0, len(worst) - 1)]
        apart = np.maximum(1.0 - SPREADS * (most - tail), np.median(worst, axis=0))
        self.targets = np.clip(apart, *TARGETS)
        self._rows.append(self._trace())
        self._top = peak_angle(self.cam.lift)

    def step(self, price: float, farther: bool = False) -> None:
        """Solves the program with a `price` and moves to its cam, about which the next program is linearised. The next
        box is narrower, or wider where the cams must move `farther`."""
        self.cam = self.cam_of(self._optimum(price))
        self._last.append(self.cam.z)
        self._width *= 1.0 / NARROWER if farther else NARROWER
        self._rows.append(self._trace())

    def cam_of(self, z: np.ndarray) -> YieldCandidate:
        """The cam of free coefficients z (m)."""
        return YieldCandidate(z, float(self._area @ z + self._area_at_zero), self.plain.cam.lift(z))

    def _trace(self) -> UseRows:
        """The rows about the present cam, from trains that were near a target and trains checked in rotation."""
        cam = self.cam
        self._turn += 1
        stored = self.journal.stored(self._turn, cam.z, TRACED)
        if stored is not None:
            self.drawn.restore(stored)
            return UseRows(*(stored[name] for name in UseRows._fields))
        used, turn = self.drawn.used, np.arange(len(self.drawn.trains)) + self._turn
        near = (used > (self.targets - NEAR - SOON)[:, None]).any(axis=1) | (turn % OTHER_SCOUTS == 0)[:, None]
        near[:, -1] |= turn % TOP_SCOUTS == 0
        numbers = np.flatnonzero(near.any(axis=1)).tolist()
        with ThreadPoolExecutor(WORKERS) as pool:
            traced = list(pool.map(lambda t: self._traced_train(cam.lift, t, np.flatnonzero(near[t])), numbers))
        rows = self._about(cam.z, [row for of_train in traced for row in of_train])
        if self.journal.kept:
            self.journal.store(self._turn, cam.z, self.drawn.stored_arrays(near) | rows._asdict())
        return rows

    def _about(self, z: np.ndarray, traced: list[tuple[int, int, float, np.ndarray]]) -> UseRows:
        """The rows about the cam of z (m), without those of grazing motions, whose gradients are too large."""
        train, limit = np.array([row[:2] for row in traced], dtype=int).reshape(-1, 2).T
        use, slope = np.array([row[2] for row in traced]), np.array([row[3] for row in traced]).reshape(-1, len(z))
        size = np.abs(slope).max(axis=1)
        good = size <= STEEP * np.median(size) if len(size) else size > 0.0
        return UseRows(train[good], (use - slope @ z)[good], slope[good], self.targets[limit[good]])

    def _traced_train(self, lift: Lift, t: int, speeds: np.ndarray) -> list[tuple[int, int, float, np.ndarray]]:
        """The results of `_traced` at some of the speeds of train t, whose ground cam is computed once."""
        cam = lift_between(self.drawn.trains[t].cam(lift), lift.borders)
        return [row for s in speeds.tolist() for row in self._traced(cam, lift.borders, t, s)]

    def _traced(self, cam: Lift, plain: np.ndarray, t: int, s: int) -> list[tuple[int, int, float, np.ndarray]]:
        """Evaluates train t with its ground `cam` at its speed s, in the motion from the previous cam's state.

        Returns train, limit, usage and gradient for every limit that the train comes near to. The gradient is by the
        coefficients (m) of the cam as designed, whose pieces lie between the `plain` borders.
        """
        built, limits, start = self.drawn.trains[t], self.drawn.limits, self.drawn.states[t, s]
        try:
            motion = TracedMotion(built.train, cam, self.drawn.speeds(t)[s], start, REVOLUTIONS)
        except MotionRefused:
            self.drawn.used[t, :, s] = np.inf
            self.drawn.reset_state(t, s)
            return []
        values = motion.values([limit.metric for limit in limits], REVOLUTIONS - 2)
        usage = np.array([float(limit.share(value)) for limit, value in zip(limits, values, strict=True)])
        self.drawn.used[t, :, s] = usage
        self.drawn.states[t, s] = motion.end
        if usage.max() >= (1.0 if built.train.memory else FARTHEST):
            self.drawn.reset_state(t, s)
        if usage.max() >= FARTHEST:
            return []
        near = np.flatnonzero(usage > self.targets - NEAR).tolist()
        if not near:
            return []
        gradients = motion.gradient([limits[i].metric for i in near], REVOLUTIONS - 2).by_coefficients
        by_pieces = [_by_pieces(rows, cam.borders, plain)[:, : self._basis.shape[1]] for rows in gradients]
        by_free = [np.einsum("pq,pqm->m", pieces, self._basis) for pieces in by_pieces]
        slopes = [limits[i].share_slope * slope for i, slope in zip(near, by_free, strict=True)]
        return [(t, i, usage[i], slope) for i, slope in zip(near, slopes, strict=True) if np.isfinite(slope).all()]

    def _optimum(self, price: float) -> np.ndarray:
        """The coefficients (m) of the program's cam; further columns are the trains' excesses over their targets."""
        z, columns = self.cam.z, zip(*self._rows, strict=True)
        train, offset, slope, target = (np.concatenate(blocks) for blocks in columns)
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
    """Converts a gradient by the coefficients (g, q) of pieces between `borders` (g + 1) to one by the coefficients of
    the same law's fewer pieces between `plain` borders (p + 1): the transposed shift of a Taylor polynomial."""
    piece = np.searchsorted(plain, 0.5 * (borders[1:] + borders[:-1])) - 1
    step, gradient = borders[:-1] - plain[piece], np.zeros((len(plain) - 1, by_ground.shape[1]))
    for k in range(by_ground.shape[1]):
        np.add.at(gradient[:, k], piece, sum(comb(k, j) * step ** (k - j) * by_ground[:, j] for j in range(k + 1)))
    return gradient
