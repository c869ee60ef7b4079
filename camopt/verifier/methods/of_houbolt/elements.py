"""The elements of a train as the compiled code of Houbolt's method reads them, and their forces."""

from typing import NamedTuple

import numpy as np

from camopt.programs import compiled
from camopt.scene.train import Train

LINEAR, TABLE, OIL, FRICTION = 0, 3, 4, 5


class Elements(NamedTuple):
    """The elements for one step h. A memory z (r) was `held` at its beginning; what its law makes of it is in `forces`.

    Oil that leaks by the trapezoidal rule over the step, z1 = z0 + h (f0 + f1) / (2 leak), has at the end of it the
    force f1 = soft (d - held - travel) with held = z0 + flow f0, flow = h / (2 leak) and soft = k / (1 + k flow).
    """

    rows: np.ndarray  # (e, n) compression of each element by position
    contact: np.ndarray  # (e)
    cam_driven: np.ndarray  # (e)
    damping: np.ndarray  # (e)
    preload: np.ndarray  # (e)
    gap: np.ndarray  # (e)
    kind: np.ndarray  # (e)
    pieces: np.ndarray  # (e) number of pieces of its law
    soft: np.ndarray  # (e) N/m: the stiffness but for oil
    table: np.ndarray  # (e, q, 3) compression [m], force [N], and slope [N/m] up to the next row
    memory: np.ndarray  # (e) which memory is its own, -1 where it has none
    reach: np.ndarray  # (e) m, of oil its travel, of friction slip / stiffness
    flow: np.ndarray  # (e) m/N, of oil
    forced: np.ndarray  # (q) masses of the forces by the cam angle


def elements_of(train: Train, h: float) -> Elements:
    """The elements of a train for the step h [s]; zero, for the forces of a state by themselves.

    Raises InputError where the elastic force of an element follows no straight lines.
    """
    e, laws = len(train.a), train.laws
    padded = np.eye(len(train.mass) + 1)[:, :-1]  # index -1 (ground) reads the row of zeros
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
    """`held` (r) at the beginning of a step, from forces (e) and memories z (r) there."""
    for e in range(len(elements.contact)):
        j = elements.memory[e]
        if j >= 0:
            held[j] = z[j] + elements.flow[e] * force[e]


@compiled
def _of_table(table, e, d):
    """Row of the table of element e at compression d, and its force there."""
    row = 0
    while row < table.shape[1] - 2 and d >= table[e, row + 1, 0]:
        row += 1
    return row, table[e, row, 1] + table[e, row, 2] * (d - table[e, row, 0])


@compiled
def _returned(oil, soft, reach, flow, d, held):
    """Piece, force and memory of oil or friction at compression d: the trial force, returned to what the law admits."""
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
    """Forces into `force` (e) and memories into `z` (r) by the laws; returns the number of the set of pieces."""
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
