"""Transition matrix method of Kodama et al., Eq. (14): one constant matrix per set of closed contacts.

Explicit. As printed (Taylor up to the fourth derivative of x, hence v up to h^3/6 x'''') its global order is 3; with
the exact exponential the train is propagated without error and the order 3 is that of the force, kept up to its second
derivative. The closed set is the one found at the start of each step, so across a damped closing the order is 1.
Kodama, Honda, Otaka, Paerk: valve train dynamics by the transition matrix method. Their printed [C] and [K] carry
misprints; the matrices here are assembled from Eqs. (5) to (11), that is from the elements. Their separation criterion
(open where x_3 > x_2, the damper pulling until then) is "displacement", for reproduction only; "force" opens a contact
where its force reaches zero.

Laws whose force is piecewise linear have a matrix per set of pieces: the row of each table, oil that pushes or not,
friction that sticks or slides. All are found at the start of a step, so across a corner the order is 2. A memory z is a
component of the state: oil that pushes has z' = k (d - z - travel) / leak, and the other memories stand still within a
step, at the end of which oil falls to d where it is beyond d, and friction follows d where its force is beyond slip.
"""

from typing import NamedTuple

import numpy as np

from camopt.cam.lift import Lift
from camopt.programs import compiled
from camopt.scene.errors import InputError
from camopt.scene.response import Response, Revolve
from camopt.scene.train import GROUND, Train
from camopt.verifier.methods.of_tmm import Memories, exact, printed

MAY_PULL = {"force": False, "displacement": True}
"""By separation criterion: whether a compressed contact stays closed while its force is below zero."""
LINEAR, TABLE, OIL, FRICTION = 0, 3, 4, 5
MOST_SETS = 2**62
"""Sets of pieces are numbered in 64 bits."""
CAM_INPUTS = 4
"""The lift and its three time derivatives."""


def prepare(
    train: Train,
    lift: Lift,
    cam_speed: float,
    steps_per_revolution: int,
    exponential: bool = False,
    criterion: str = "force",
) -> Revolve:
    """One revolution by the transition matrix method as a function of its start state (2n + r: [m], [m/s], [m]).

    `cam_speed` [rad/s]; `exponential` replaces the printed Taylor matrices by the exact ones; `criterion`: a contact
    opens by "force", or by "displacement" alone. Matrices are built for the sets of pieces that occur. The response has
    steps_per_revolution + 1 samples. Raises InputError for another criterion, or laws that are no straight lines.
    """
    train.require_straight("the transition matrix method", 'use method "dop853" or "rkg"')
    if criterion not in MAY_PULL:
        raise InputError(f"separation criterion {criterion!r}: expected {' or '.join(MAY_PULL)}")
    steps, n = steps_per_revolution, len(train.mass)
    h = 2 * np.pi / cam_speed / steps
    angle = np.linspace(-np.pi, np.pi, steps + 1)
    cam = np.stack([lift(angle, k) * cam_speed**k for k in range(CAM_INPUTS)], axis=1)
    given = [np.interp(angle, f.angle, f.force) for f in train.forcing]
    inputs = np.column_stack([cam, *(q for g in given for q in (g, np.append(np.diff(g), 0.0) / h))])
    transitions = _Transitions(train, h, exponential)

    def revolve(state: np.ndarray) -> Response:
        states = np.empty((steps + 1, train.state_size))
        states[0] = state
        force = np.empty((steps + 1, len(train.a)))
        step = 0
        while step <= steps:
            step, missing = _march(step, states, force, inputs, MAY_PULL[criterion], transitions.arrays)
            if missing >= 0:
                transitions.build(missing)
        x, v, z = states[:, :n], states[:, n : 2 * n], states[:, 2 * n :]
        return Response(train, cam_speed, angle, cam[:, 0], x, v, force, z)

    return revolve


class _Matrices(NamedTuple):
    """The elements, and the matrices of every set of pieces that has occurred, by their number in `keys`."""

    rows: np.ndarray  # (e, n) compression of each element by position
    contact: np.ndarray  # (e)
    cam_driven: np.ndarray  # (e) 1.0 or 0.0
    damping: np.ndarray  # (e)
    gap: np.ndarray  # (e)
    kind: np.ndarray  # (e)
    memory: np.ndarray  # (e) which memory is its own, -1 where it has none
    stiffness: np.ndarray  # (e)
    preload: np.ndarray  # (e)
    table: np.ndarray  # (e, q, 3) compression [m], force [N], and slope [N/m] up to the next row
    reach: np.ndarray  # (e) m, of oil its travel, of friction slip / stiffness
    pieces: np.ndarray  # (e) number of pieces of its law
    keys: np.ndarray  # (s)
    by_state: np.ndarray  # (s, 2n + r, 2n + r)
    by_cam: np.ndarray  # (s, 2n + r, 1 + inputs)


class _Transitions:
    """Transition matrices of one train and step, by the number of the set of pieces."""

    def __init__(self, train: Train, h: float, exponential: bool):
        self.train, self.h, self.matrix = train, h, exact if exponential else printed
        e, size = len(train.a), train.state_size
        self.memory = np.full(e, -1)
        self.memory[list(train.memory)] = np.arange(len(train.memory))
        laws = train.laws
        self.kind = np.zeros(e, dtype=int) if laws is None else laws.kind
        self.table = np.array([[[0.0, 0.0], [1.0, 0.0]]] * e) if laws is None else laws.table
        self.leak, self.travel, self.slip = np.zeros((3, e)) if laws is None else (laws.leak, laws.travel, laws.slip)
        rows_of_table = self.table.shape[1] - 1
        self.pieces = np.array([{TABLE: rows_of_table, OIL: 2, FRICTION: 3}.get(int(k), 1) for k in self.kind])
        if np.prod(self.pieces * (1.0 + train.contact)) > MOST_SETS:
            raise InputError(
                "the transition matrix method cannot number the sets of pieces of so many contacts and tables: "
                'use method "dop853" or "rkg"'
            )
        self.rows = _incidence(train)
        inputs = 1 + CAM_INPUTS + 2 * len(train.forcing)
        self.arrays = _Matrices(
            *(self.rows, train.contact, train.cam_driven.astype(float), train.damping, train.gap),
            *(self.kind, self.memory, train.stiffness, train.preload),
            np.concatenate([self.table, _slopes(self.table)], axis=2),
            np.where(self.kind == OIL, self.travel, self.slip / train.stiffness),
            *(self.pieces, np.zeros(0, dtype=np.int64), np.zeros((0, size, size)), np.zeros((0, size, inputs))),
        )

    def decoded(self, key: int) -> tuple[np.ndarray, np.ndarray]:
        """(which elements act, the piece of each) in a set, each (e)."""
        acts, piece = np.ones(len(self.kind), dtype=bool), np.zeros(len(self.kind), dtype=int)
        for e in range(len(self.kind) - 1, -1, -1):
            if self.train.contact[e]:
                key, closed = divmod(key, 2)
                acts[e] = closed == 1
            key, piece[e] = divmod(key, int(self.pieces[e]))
        return acts, piece

    def lines(self, piece: np.ndarray) -> tuple[np.ndarray, np.ndarray, Memories]:
        """Stiffness (e) and force at compression and memory zero (e) of the elements on their pieces, and memories."""
        t, n, r = self.train, len(self.train.mass), len(self.train.memory)
        stiffness, base = t.stiffness.copy(), t.preload.copy()
        memories = Memories(np.zeros((n, r)), np.zeros((r, n)), np.zeros(r), np.zeros(r), np.zeros(r))
        for e in np.flatnonzero(self.kind == TABLE):
            (c0, f0), (c1, f1) = self.table[e, piece[e] : piece[e] + 2]
            stiffness[e] = (f1 - f0) / (c1 - c0)
            base[e] = f0 - stiffness[e] * c0
        for j, e in enumerate(t.memory):
            k, oil = t.stiffness[e], self.kind[e] == OIL
            if piece[e] == (1 if oil else 0):
                memories.by_memory[:, j] = k * self.rows[e]
                base[e] = -k * self.travel[e]
            else:
                stiffness[e], base[e] = 0.0, (0.0, self.slip[e], -self.slip[e])[piece[e]]
            if oil and piece[e] == 1:
                memories.decay[j] = k / self.leak[e]
                memories.by_position[j] = k / self.leak[e] * self.rows[e]
                memories.constant[j] = -k / self.leak[e] * (t.gap[e] + self.travel[e])
                memories.by_lift[j] = k / self.leak[e] * t.cam_driven[e]
        return stiffness, base, memories

    def build(self, key: int) -> None:
        """Matrices of one set: state (2n + r, 2n + r), and cam on 1, lift, its derivatives, and given forces."""
        t, n, size = self.train, len(self.train.mass), self.train.state_size
        closed, piece = self.decoded(key)
        rows = self.rows[closed]
        line, base, memories = self.lines(piece)
        stiffness = rows.T @ (line[closed, None] * rows)
        damping = rows.T @ (t.damping[closed, None] * rows) + np.diag(t.mass_damping)
        constant = t.mass_force - rows.T @ (base - line * t.gap)[closed]
        by_lift = -rows.T @ (line * t.cam_driven)[closed]
        by_rate = -rows.T @ (t.damping * t.cam_driven)[closed]
        blocks = self.matrix(np.diag(1 / t.mass), damping, stiffness, self.h, memories)
        of_force, of_memory = (np.split(q, 3, axis=1) for q in np.split(blocks[:, size:], [3 * n], axis=1))
        cam = np.zeros((size, 1 + CAM_INPUTS + 2 * len(t.forcing)))
        cam[:, 0] = of_force[0] @ constant + of_memory[0] @ memories.constant
        for j, (block, feed) in enumerate(zip(of_force, of_memory, strict=True)):
            cam[:, 1 + j] += block @ by_lift + feed @ memories.by_lift  # the force's derivative j reads the lift's
            cam[:, 2 + j] += block @ by_rate  # derivatives j and j + 1
        for j, f in enumerate(t.forcing):
            for derivative in range(2):
                cam[:, 1 + CAM_INPUTS + 2 * j + derivative] = of_force[derivative][:, f.on]
        built = self.arrays
        self.arrays = built._replace(
            keys=np.append(built.keys, key),
            by_state=np.concatenate([built.by_state, blocks[None, :, :size].copy()]),
            by_cam=np.concatenate([built.by_cam, cam[None]]),
        )


def _slopes(table: np.ndarray) -> np.ndarray:
    """Slopes (e, q, 1) of tables (e, q, 2) from each row to the next; the last is never read."""
    return (np.diff(table[..., 1], append=1.0) / np.diff(table[..., 0], append=np.inf))[..., None]


def _incidence(train: Train) -> np.ndarray:
    """Compression of each element by position, shape (e, n)."""
    rows = np.zeros((len(train.a), len(train.mass)))
    for e, (a, b) in enumerate(zip(train.a, train.b, strict=True)):
        if a != GROUND:
            rows[e, a] += 1.0
        if b != GROUND:
            rows[e, b] -= 1.0
    return rows


@compiled
def _of_table(table, e, d):
    """Row of the table of element e at compression d, and its force there."""
    row = 0
    while row < table.shape[1] - 2 and d >= table[e, row + 1, 0]:
        row += 1
    return row, table[e, row, 1] + table[e, row, 2] * (d - table[e, row, 0])


@compiled
def _remembering(oil, stiffness, reach, d, d_rate, z):
    """Piece, force and memory of an element whose memory was z; `reach` as of `_Matrices`."""
    if oil:
        z = min(z, d)
        pressed = d - z - reach
        pushes = pressed > 0.0 or (pressed == 0.0 and d_rate > 0.0)
        return (1 if pushes else 0), stiffness * max(0.0, pressed), z
    if abs(d - z) < reach:
        return 0, stiffness * (d - z), z
    reach = reach if d > z else -reach
    piece = 0 if reach * d_rate <= 0.0 else (1 if d > z else 2)
    return piece, stiffness * reach, d - reach


@compiled
def _set_of_pieces(y, cam, may_pull, m, force, memory):
    """Number of the set of pieces in a state: closed contacts are compressed and pushing or `may_pull`; forces go into
    `force` (e), and memories that have followed their compressions into `memory` (r)."""
    n, key = m.rows.shape[1], 0
    for e in range(len(m.contact)):
        d, d_rate = m.cam_driven[e] * cam[0] - m.gap[e], m.cam_driven[e] * cam[1]
        for i in range(n):
            d += m.rows[e, i] * y[i]
            d_rate += m.rows[e, i] * y[n + i]
        if m.kind[e] == LINEAR:
            p = m.preload[e] + m.stiffness[e] * d
        else:
            if m.kind[e] == TABLE:
                piece, p = _of_table(m.table, e, d)
            else:
                r, oil = m.memory[e], m.kind[e] == OIL
                piece, p, memory[r] = _remembering(oil, m.stiffness[e], m.reach[e], d, d_rate, y[2 * n + r])
            key = key * m.pieces[e] + piece
        f = p + m.damping[e] * d_rate
        if m.contact[e]:
            key *= 2
            if p > 0.0 and (f > 0.0 or may_pull):
                key += 1
            else:
                f = 0.0
        force[e] = f
    return key


@compiled
def _march(start, states, force, cam, may_pull, m):
    """Steps from sample `start` on; returns the sample reached and the set whose matrices are missing, or -1."""
    last, slot = len(states) - 1, -1
    begin, memory = 2 * m.rows.shape[1], np.empty(states.shape[1] - 2 * m.rows.shape[1])
    for step in range(start, last + 1):
        y = states[step]
        key = _set_of_pieces(y, cam[step], may_pull, m, force[step], memory)
        if step < last and (slot < 0 or m.keys[slot] != key):
            slot = -1
            for s in range(len(m.keys)):
                if m.keys[s] == key:
                    slot = s
            if slot < 0:
                return step, key  # y is as it was, so that the same set is found once its matrices are there
        for r in range(len(memory)):
            y[begin + r] = memory[r]
        if step == last:
            break
        state_matrix, cam_matrix = m.by_state[slot], m.by_cam[slot]
        for i in range(len(y)):
            total = cam_matrix[i, 0]
            for j in range(cam.shape[1]):
                total += cam_matrix[i, 1 + j] * cam[step, j]
            for j in range(len(y)):
                total += state_matrix[i, j] * y[j]
            states[step + 1, i] = total
    return last + 1, -1
