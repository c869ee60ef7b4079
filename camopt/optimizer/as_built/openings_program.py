"""The linear program of largest area whose predicted contact openings keep their limits in a share of the drawn trains.

There is one row for every train, speed, contact and angle interval, which makes hundreds of thousands. The program
contains only rows that a cam violated, and is solved again whenever rows are added (row generation). Then the trains
that cost most area, by the multipliers of their rows, are dropped until their number reaches the permitted loss of
yield. A least contact force that trains must keep is included in the right-hand sides of the rows.

A tied contact pulls with a force -f where a real contact would separate. Its predicted opening over an interval from
angle a to b is gap(b), which is minus the integral from a to b of h(b - t) f(t) dt. Here h is the opening after a unit
impulse on both sides of the contact, in the train in which this contact is open and the others stay closed. The largest
opening over all a and b is close to the real jump where the contacts separate once and close again. It describes the
jump better than the least contact force: a contact that pulls only for a moment opens next to nothing.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm

from camopt.optimizer.program.force_rows import CLOSING, OPENING, Box, SpeedRows
from camopt.optimizer.program.no_jump import NoJumpOptimum, NoJumpProgram
from camopt.optimizer.program.phases import LIFTED, phase_contacts
from camopt.scene.rest import linearised_at_rest
from camopt.scene.train import Train
from camopt.scene.units import DEG, UM

STEP = 1.0 * DEG
"""Step between the angles at which forces are read [rad]."""
LONG = np.array([6, 9, 12, 16, 20, 26, 34])
"""Lengths of the intervals over which a contact may open, in steps: 6 to 34 degrees."""


def opening_after_impulse(train: Train, contact: int, step: float, count: int) -> np.ndarray:
    """Opening of a `contact` [m per N s] at 0, 1, ... `count` - 1 steps [s] after a unit impulse on both its sides.

    In the train this contact and the seat are open, all others are closed, and curved laws are linearised at rest.
    """
    train = linearised_at_rest(train)
    closed = phase_contacts(train)[LIFTED].copy()
    closed[contact] = False
    d, n = train.incidence, len(train.mass)
    k, c = (closed * q for q in (train.stiffness, train.damping))
    rate = np.zeros((2 * n, 2 * n))
    rate[:n, n:] = np.eye(n)
    rate[n:, :n] = -(d.T * k @ d) / train.mass[:, None]
    rate[n:, n:] = -((d.T * c @ d) + np.diag(train.mass_damping)) / train.mass[:, None]
    state, transition = np.concatenate([np.zeros(n), d[contact] / train.mass]), expm(rate * step)
    opening = np.empty(count)
    for i in range(count):
        opening[i] = d[contact] @ state[:n]
        state = transition @ state
    return opening


def opening_rows(train: Train, contact: int, cam_speed: float, count: int) -> np.ndarray:
    """Rows (w, k, k) with gap = rows @ f [m] for forces f (k) [N] at `count` angles STEP apart.

    The first axis is the interval's length in steps (w), the second the angle (k) at which it ends; trapezoidal rule.
    """
    after = opening_after_impulse(train, contact, STEP / cam_speed, LONG[-1] + 1)
    ends, at = np.arange(count)[:, None], np.arange(count)
    lag = ends - at
    weight = np.where((lag >= 0) & (lag <= LONG[-1]), after[np.clip(lag, 0, LONG[-1])], 0.0)
    rows = np.empty((len(LONG), count, count))
    for w, steps in enumerate(LONG):
        first = np.maximum(ends - steps, 0)
        rows[w] = np.where(at < first, 0.0, weight) * np.where((at == first) | (at == ends), 0.5, 1.0)
    return -STEP / cam_speed * rows


BROKEN = 1.0 * UM
"""Excess of an opening over its limit that is ignored [m]."""
NEARLY = 10.0 * UM
"""Distance from the limit [m] within which openings of a violating case, a train at a speed, get rows."""
WATCHED = 25.0 * UM
"""Cases that stay farther than this from their limit [m] are checked again only when no other case violates it."""
FIRST, AT_ONCE = 100, 400
"""Number of cases that get rows at the start and between two solutions, the worst ones first."""
MOST_SOLUTIONS = 40
"""Largest number of solutions during one row generation."""
DROPPED_AT_ONCE = 3
"""At most one in this number of the trains with positive multipliers is dropped between two solutions."""

Key = tuple[int, int, int, int]


@dataclass
class OpeningsProgram:
    """The program for trains (t), each at its own speeds (s), with the contacts c between cam and valve.

    `forces` (t, s, c, k, 1 + m) are the forces of the tied contacts [N] at the angles `theta` (k) [rad], affine in z.
    Train t has the cam speeds `cam_speeds[t % classes]` (classes, s) [rad/s]. `plain` limits the shape alone.
    """

    plain: NoJumpProgram
    theta: np.ndarray
    cam_speeds: np.ndarray
    forces: np.ndarray
    kept: np.ndarray = field(init=False)  # (t: bool) trains that have not been dropped

    def __post_init__(self) -> None:
        train, count = self.plain.train, len(self.theta)
        # rows (classes, s, c, w * k, k) of the contacts' openings [m] by their forces [N] at the angles
        rows = [opening_rows(train, e, w, count) for w in self.cam_speeds.ravel() for e in train.cam_side]
        shape = *self.cam_speeds.shape, len(train.cam_side), -1, count
        self._openings = np.array(rows, dtype=np.float32).reshape(shape)
        self._margin_N = 0.0
        self.replace_forces(self.forces)

    def replace_forces(self, forces: np.ndarray) -> None:
        """Replaces the forces by those about another cam, and discards rows and dropped trains."""
        self.forces, self._rows, self._work = forces, {}, set()
        self._tight, self._seen, self._tight_limits = set[Key](), set[Key](), np.zeros(0, dtype=int)
        self.kept = np.ones(len(forces), dtype=bool)

    def require_force(self, margin_N: float) -> None:
        """Sets the force [N] that is subtracted from all contact forces before openings are predicted."""
        if margin_N != self._margin_N:
            self._margin_N = margin_N
            self._rows.clear()

    def tied_forces(self, z: np.ndarray) -> np.ndarray:
        """Forces of the tied contacts (t, s, c, k) [N] with the cam of z (m)."""
        return self.forces @ np.append(1.0, z).astype(np.float32)

    def predicted_openings(self, z: np.ndarray, cases: np.ndarray) -> np.ndarray:
        """Predicted openings (i, c, w * k) [m] with the cam of z (m) in `cases` (i, 2), indices of train and speed."""
        t, s = cases.T
        forces = self.tied_forces(z)[t, s] - np.float32(self._margin_N)
        openings = np.empty((len(t), forces.shape[1], len(LONG) * len(self.theta)), dtype=np.float32)
        for same, speed in np.ndindex(self.cam_speeds.shape):
            at = np.flatnonzero((t % len(self.cam_speeds) == same) & (s == speed))
            for c, rows in enumerate(self._openings[same, speed]):  # as products of matrices
                openings[at, c] = forces[at, c] @ rows.T
        return openings

    def largest(self, z: np.ndarray, limits: np.ndarray, dropped: int, box: Box | None = None) -> NoJumpOptimum:
        """The cam of largest area whose predicted openings keep `limits` (classes, s) [m] in all but `dropped` trains.

        Row generation starts from the cam of z (m), with the rows and dropped trains of the previous call. As long as
        no cam keeps the limits in all remaining trains, all limits are raised by the smallest common amount that makes
        the program feasible, until enough trains are dropped.
        """
        while True:
            optimum, multipliers = self._generate_rows(z, limits, box)
            z, left = optimum.z, dropped - int(np.sum(~self.kept))
            if left <= 0 or not multipliers.any():
                return optimum
            count = min((left + 1) // 2, max(1, int(np.sum(multipliers > 0)) // DROPPED_AT_ONCE))
            self.kept[np.argsort(-multipliers, kind="stable")[:count]] = False

    def _generate_rows(self, z: np.ndarray, limits: np.ndarray, box: Box | None) -> tuple[NoJumpOptimum, np.ndarray]:
        """The optimum for the trains that are kept, and the sum of the multipliers of each train's rows (t)."""
        all_cases = np.argwhere(np.broadcast_to(self.kept[:, None], self.forces.shape[:2]))
        new_rows, near = self._violated_rows(z, limits, all_cases, begin=not self._work)
        for _ in range(MOST_SOLUTIONS):
            self._work |= new_rows
            optimum, multipliers, raised = self._optimum(limits, box)
            allowed = limits + raised
            new_rows, near = self._violated_rows(optimum.z, allowed, near)
            if not new_rows - self._work:
                new_rows, near = self._violated_rows(optimum.z, allowed, all_cases)
            if not new_rows - self._work:
                break
        return optimum, multipliers

    def _violated_rows(
        self, z: np.ndarray, limits: np.ndarray, cases: np.ndarray, begin: bool = False
    ) -> tuple[set[Key], np.ndarray]:
        """The rows of `cases` (i, 2) that the cam of z (m) violates most, or with `begin` those closest to their
        limits; and the cases close to their limits, which the next cam may violate."""
        limit = limits[cases[:, 0] % len(limits), cases[:, 1]].astype(np.float32)
        excess = self.predicted_openings(z, cases)
        excess -= limit[:, None, None]
        worst, length = excess.max(axis=(1, 2)), len(self.theta)
        order = np.argsort(-worst, kind="stable")[: FIRST if begin else AT_ONCE]
        order = order[worst[order] > (-np.inf if begin else BROKEN)]
        by_length = excess[order].reshape(len(order), excess.shape[1], len(LONG), length)
        last = by_length.argmax(axis=3)
        near = np.take_along_axis(by_length, last[..., None], axis=3)[..., 0] > (-np.inf if begin else -NEARLY)
        violated = set()
        for i, c, w in np.argwhere(near).tolist():
            t, s = cases[order[i]].tolist()
            violated.add((t, s, c, w * length + int(last[i, c, w])))
        return violated, cases[worst > -WATCHED]

    def _row(self, key: Key) -> np.ndarray:
        """The predicted opening [um] of a row at z = 0 and per coefficient (1 + m)."""
        if key not in self._rows:
            t, s, c, q = key
            row, forces = self._openings[t % len(self.cam_speeds), s, c, q], self.forces[t, s, c].astype(float)
            forces[:, 0] -= self._margin_N
            self._rows[key] = row.astype(float) @ forces / UM
        return self._rows[key]

    def _optimum(self, limits: np.ndarray, box: Box | None) -> tuple[NoJumpOptimum, np.ndarray, float]:
        """The optimum under the present rows, the sum of the multipliers of each train's rows (t), and the amount [m]
        by which all limits were raised to make the program feasible."""
        cases: dict[tuple[int, int], list[Key]] = {}
        for key in sorted(self._work):
            if self.kept[key[0]]:
                cases.setdefault(key[:2], []).append(key)
        blocks = tuple(self._block(keys) for keys in cases.values())
        program = self.plain.with_rows(blocks, box)
        case_index = np.array([(t % len(limits), s) for t, s in cases])
        margins = np.tile(-limits[case_index[:, 0], case_index[:, 1]] / UM, (3, 1))
        first, keys = len(self.plain.limits.bound), [key for block in cases.values() for key in block]
        solution = program.solve_below(margins, self._first_working(first, keys))
        tight = solution.optimum.working
        self._tight_limits, self._seen = tight[tight < first], set(keys)
        self._tight = {keys[i - first] for i in tight if first <= i < first + len(keys)}
        trains, multipliers = np.array([t for t, _ in cases]), np.zeros(len(self.forces))
        np.add.at(multipliers, trains[program.speed], solution.optimum.duals[first : first + len(program.speed)])
        return solution, multipliers, UM * max(0.0, float((margins - solution.margins).max(initial=0.0)))

    def _first_working(self, first: int, keys: list[Key]) -> np.ndarray | None:
        """Indices of the rows that were tight in the previous program and of those that it did not contain, or None if
        there was no previous program. The rows of openings start at index `first`."""
        new = [first + i for i, key in enumerate(keys) if key in self._tight or key not in self._seen]
        return np.concatenate([self._tight_limits, np.array(new, dtype=int)]) if self._seen else None

    def _block(self, keys: list[Key]) -> SpeedRows:
        """The rows of one train at one speed: the negative openings [um], which must be at least minus the limit."""
        rows = np.array([self._row(key) for key in keys])
        angle = self.theta[[key[3] % len(self.theta) for key in keys]]
        element = np.array([self.plain.train.cam_side[key[2]] for key in keys])
        cam_speed = float(self.cam_speeds[keys[0][0] % len(self.cam_speeds), keys[0][1]])
        kind, angles = np.where(angle < 0, OPENING, CLOSING), self.plain.blocks[0].angles
        return SpeedRows(cam_speed, angles, -rows[:, 1:], -rows[:, 0], kind, element, angle)
