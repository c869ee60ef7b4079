"""Parts of Houbolt's method: elements and their forces, the matrices of every set of pieces that occurs, and MOTORI's
explicit form, which is described in `houbolt`."""

from typing import NamedTuple

import numpy as np

from camopt.programs import compiled
from camopt.scene.errors import InputError
from camopt.scene.response import Response, Revolve
from camopt.scene.train import Train

LINEAR, TABLE, OIL, FRICTION = 0, 3, 4, 5
MOST_KEYS = 2**62
"""Largest number of sets of pieces, which are numbered by 64-bit integers."""


class Elements(NamedTuple):
    """The elements for the step h. Memories enter a step by their values `held` (r), from which `forces` updates them.

    Oil that leaks by the trapezoidal rule over the step, z1 = z0 + h (f0 + f1) / (2 leak), has the force
    f1 = soft (d - held - travel) at its end, with held = z0 + flow f0, flow = h / (2 leak) and soft = k / (1 + k flow).
    """

    rows: np.ndarray  # (e, n) compression of each element by position
    contact: np.ndarray  # (e)
    cam_driven: np.ndarray  # (e)
    damping: np.ndarray  # (e)
    preload: np.ndarray  # (e)
    gap: np.ndarray  # (e)
    kind: np.ndarray  # (e)
    pieces: np.ndarray  # (e) number of pieces of its law
    soft: np.ndarray  # (e) N/m: as above for oil, the stiffness for all others
    table: np.ndarray  # (e, q, 3) compression [m], force [N], and slope [N/m] up to the next row
    memory: np.ndarray  # (e) index of the element's memory, -1 if it has none
    reach: np.ndarray  # (e) m: travel for oil, slip / stiffness for friction
    flow: np.ndarray  # (e) m/N, for oil
    forced: np.ndarray  # (q) masses on which the forces given over the cam angle act


def elements_of(train: Train, h: float) -> Elements:
    """The elements of a train for the step h [s]; h = 0 gives the forces in a state without a step.

    Raises InputError if the elastic force of an element is not piecewise linear.
    """
    e, laws = len(train.a), train.laws
    padded = np.eye(len(train.mass) + 1)[:, :-1]  # index -1 (ground) selects the row of zeros
    kind = np.zeros(e, dtype=int) if laws is None else laws.kind
    train.require_straight("Houbolt's method", 'use method "dop853" or "rkg"')
    table = np.array([[[0.0, 0.0], [1.0, 0.0]]] * e) if laws is None else laws.table
    slope = np.diff(table[..., 1], append=1.0) / np.diff(table[..., 0], append=np.inf)
    pieces = {TABLE: table.shape[1] - 1, OIL: 2, FRICTION: 3}
    memory, reach, flow = np.full(e, -1), np.zeros(e), np.zeros(e)
    memory[list(train.memory)] = np.arange(len(train.memory))
    if laws is not None:
        oil = kind == OIL
        reach = np.where(oil, laws.travel, laws.slip / train.stiffness)
        flow[oil] = h / (2.0 * laws.leak[oil])
    return Elements(
        padded[train.a] - padded[train.b],
        *(train.contact, train.cam_driven, train.damping, train.preload, train.gap, kind),
        np.array([pieces.get(int(k), 1) for k in kind]),
        train.stiffness / (1.0 + train.stiffness * flow),
        np.concatenate([table, slope[..., None]], axis=2),
        *(memory, reach, flow, np.array([f.on for f in train.forcing], dtype=int)),
    )


@compiled
def hold(elements, force, z, held):
    """Fill `held` (r) for a step from the forces (e) and memories z (r) at its beginning."""
    for e in range(len(elements.contact)):
        j = elements.memory[e]
        if j >= 0:
            held[j] = z[j] + elements.flow[e] * force[e]


@compiled
def _of_table(table, e, d):
    """Row of element e's table at compression d, and the force there."""
    row = 0
    while row < table.shape[1] - 2 and d >= table[e, row + 1, 0]:
        row += 1
    return row, table[e, row, 1] + table[e, row, 2] * (d - table[e, row, 0])


@compiled
def _returned(oil, soft, reach, flow, d, held):
    """Piece, force and memory of oil or friction at compression d: the trial force, returned to the law's range."""
    trial = d - held
    if oil:
        if trial <= reach:
            return 0, 0.0, min(held, d)
        f = soft * (trial - reach)
        return 1, f, held + flow * f
    if abs(trial) < reach:
        return 0, soft * trial, held
    if trial > 0.0:
        return 1, soft * reach, d - reach
    return 2, -soft * reach, d + reach


@compiled
def forces(x, v, cam, elements, held, force, z):
    """Write forces to `force` (e) and memories to `z` (r) by the laws; returns the number of the set of pieces."""
    key = 0
    for e in range(len(elements.contact)):
        compression, rate = -elements.gap[e], 0.0
        for i in range(len(x)):
            compression += elements.rows[e, i] * x[i]
            rate += elements.rows[e, i] * v[i]
        if elements.cam_driven[e]:
            compression += cam[0]
            rate += cam[1]
        if elements.kind[e] == LINEAR:
            spring = elements.preload[e] + elements.soft[e] * compression
        else:
            if elements.kind[e] == TABLE:
                piece, spring = _of_table(elements.table, e, compression)
            else:
                oil, j = elements.kind[e] == OIL, elements.memory[e]
                piece, spring, z[j] = _returned(
                    oil, elements.soft[e], elements.reach[e], elements.flow[e], compression, held[j]
                )
            key = key * elements.pieces[e] + piece
        force[e] = spring + elements.damping[e] * rate
        if elements.contact[e]:
            key *= 2
            if spring > 0.0 and force[e] > 0.0:
                key += 1
            else:
                force[e] = 0.0
    return key


class Sets(NamedTuple):
    """Masses, elements, and the matrices of every set of pieces that has occurred, in the order of `keys`."""

    mass: np.ndarray  # (n)
    elements: Elements
    keys: np.ndarray  # (s)
    inverse: np.ndarray  # (s, n, n)
    damping: np.ndarray  # (s, n, n)
    load: np.ndarray  # (s, n, 3 + r) factors of 1, lift, lift velocity and the held memories


class PieceSets:
    """Inverse effective stiffness and loads by set of pieces, for x'' = m x + ..., x' = c x + ... at the new point."""

    def __init__(self, train: Train, m: float, c: float, h: float):
        self.train, self.m, self.c = train, m, c
        self.elements = elements_of(train, h)
        n, r = len(train.mass), len(train.memory)
        if np.prod(self.elements.pieces * (1.0 + train.contact)) > MOST_KEYS:
            raise InputError(
                "Houbolt's method cannot number the sets of pieces of so many contacts and tables: "
                'use method "dop853" or "rkg"'
            )
        self.keys = np.zeros(0, dtype=np.int64)
        self.inverse, self.damping, self.load = np.zeros((0, n, n)), np.zeros((0, n, n)), np.zeros((0, n, 3 + r))

    def build(self, key: int) -> int:
        """Index of a set of pieces, whose matrices are built if it is new."""
        places = np.flatnonzero(self.keys == key)
        if len(places):
            return int(places[0])
        t, rows = self.train, self.elements.rows
        acting, piece = self._decoded(key)
        base, line, holding = self._lines(piece)
        k, c = line * acting, t.damping * acting
        damping = np.diag(t.mass_damping) + np.einsum("e,ei,ej->ij", c, rows, rows)
        stiffness = np.einsum("e,ei,ej->ij", k, rows, rows)
        effective = self.m * np.diag(t.mass) + self.c * damping + stiffness
        loads = base * acting - k * t.gap, k * t.cam_driven, c * t.cam_driven, *holding
        load = np.stack([-p @ rows for p in loads], axis=1)
        load[:, 0] += t.mass_force
        self.inverse = np.concatenate([self.inverse, np.linalg.inv(effective)[None]])
        self.damping = np.concatenate([self.damping, damping[None]])
        self.load = np.concatenate([self.load, load[None]])
        self.keys = np.append(self.keys, key)
        return len(self.keys) - 1

    def arrays(self) -> Sets:
        return Sets(self.train.mass, self.elements, self.keys, self.inverse, self.damping, self.load)

    def _decoded(self, key: int) -> tuple[np.ndarray, np.ndarray]:
        """Whether each element acts, and its piece, (e) each."""
        q, contact = self.elements, self.train.contact
        acting, piece = np.ones(len(contact), dtype=bool), np.zeros(len(contact), dtype=int)
        for e in range(len(contact) - 1, -1, -1):
            if contact[e]:
                key, closed = divmod(key, 2)
                acting[e] = closed == 1
            key, piece[e] = divmod(key, int(q.pieces[e]))
        return acting, piece

    def _lines(self, piece: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Elastic force at zero compression and held memory (e); slopes by compression (e) and held memory (r, e)."""
        q, holding = self.elements, np.zeros((len(self.train.memory), len(piece)))
        base, line = q.preload.copy(), q.soft.copy()
        for e in np.flatnonzero(q.kind != LINEAR):
            at, soft, reach = int(piece[e]), q.soft[e], q.reach[e]
            if q.kind[e] == TABLE:
                place, force, line[e] = q.table[e, at]
                base[e] = force - line[e] * place
            elif at == (1 if q.kind[e] == OIL else 0):
                base[e] = -soft * reach if q.kind[e] == OIL else 0.0
                holding[q.memory[e], e] = -soft
            else:
                slides = (0.0, soft * reach, -soft * reach)[at] if q.kind[e] == FRICTION else 0.0
                base[e], line[e] = slides, 0.0
        return base, line, holding


def explicit_form(train: Train, angle, cam, cam_speed: float, h: float) -> Revolve:
    """One revolution on the samples `angle` (k); the columns of `cam` are lift, lift velocity and the given forces."""
    n, r, samples = len(train.mass), len(train.memory), len(angle)
    masses, elements = (train.mass, train.mass_damping, train.mass_force), elements_of(train, h)
    at_once = elements_of(train, 0.0)

    def revolve(state: np.ndarray) -> Response:
        x, v, force = np.zeros((samples + 2, n)), np.zeros((samples, n)), np.zeros((samples, len(train.a)))
        z = np.zeros((samples, r))
        x[2], v[0], held = state[:n], state[n : 2 * n], np.array(state[2 * n :], dtype=float)
        forces(x[2], v[0], cam[0], at_once, held, force[0], z[0])  # x[0], x[1] are the fictitious points before it
        _march((x, v, force, z), cam, h, masses, elements)
        return Response(train, cam_speed, angle, cam[:, 0], x[2:], v, force, z)

    return revolve


@compiled
def _march(motion, cam, h, masses, elements):
    """All steps from x[2], v[0] on; x is two rows ahead of v. Computes the forces at every point but the first."""
    mass, mass_damping, mass_force = masses
    x, v, force, z = motion
    held = np.empty(z.shape[1])
    forcing = np.zeros(len(mass))
    for step in range(len(v)):
        if step > 0:
            hold(elements, force[step - 1], z[step - 1], held)
            forces(x[step + 2], v[step], cam[step], elements, held, force[step], z[step])
        for j in range(len(elements.forced)):
            forcing[elements.forced[j]] = 0.0
        for j in range(len(elements.forced)):
            forcing[elements.forced[j]] += cam[step, 2 + j]
        for i in range(len(mass)):
            acceleration = mass_force[i] - mass_damping[i] * v[step, i]
            for e in range(len(elements.rows)):
                acceleration -= elements.rows[e, i] * force[step, e]
            acceleration = (acceleration + forcing[i]) / mass[i]
            x0 = x[step + 2, i]
            if step == 0:
                x[1, i] = x0 - h * v[0, i] + 0.5 * h**2 * acceleration
                x[0, i] = x0 - 2.0 * h * v[0, i] + 2.0 * h**2 * acceleration
            if step + 1 < len(v):
                x1 = 2.0 * x0 - x[step + 1, i] + h**2 * acceleration
                v[step + 1, i] = (11.0 * x1 - 18.0 * x0 + 9.0 * x[step + 1, i] - 2.0 * x[step, i]) / (6.0 * h)
                x[step + 3, i] = x1
