"""Piecewise linear elastic laws: tables are used as given, curved laws are replaced by chords.

The error of a chord of width w under a curvature p'' is at most p'' w^2 / 8. The knots of a law of contacts have the
forces F (i / N)^2, where F is CHORD_FORCE. For p = k u^m all chords then have the same error,
(m - 1) / (2 m) F / N^2, which is F / (6 N^2) for a point contact, m = 3/2. Beyond F, which a contact reaches only in
hard impacts, the force grows by (1 + 1 / N)^4 from knot to knot, so that the error is a constant share of the force,
2 (m - 1) / (m N^2), which is four times that at F. The last chord is continued beyond `REACH` times F. Numbers may be
complex, by which they are differentiated (`camopt.exact.adjoint.slopes`).

For a dissipative law, p (1 + dissipation d'), every chord has the damper that belongs to its mean force. The energy
that it takes from a body that crosses the whole chord at constant speed is then exactly the law's, and its error falls
with the square of the number of chords like that of the elastic force.
"""

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from camopt.scene.laws import CURVED, LINEAR, OF_CONTACTS, TABLE
from camopt.scene.parts import last_slope, lengthened
from camopt.scene.rest import state_at_rest
from camopt.scene.train import Train

CHORDS = 16
"""Default number of chords of a curved law (`with_chords`)."""
CHORD_FORCE = 5000.0
"""Force [N] up to which all chords of a law of contacts have the same error."""
REACH = 20.0
"""Multiple of CHORD_FORCE up to which further chords are used."""


WRITTEN = range(7)
"""Numbers of the laws that chords represent, each with a constant damper. Other laws are refused."""


class Lines(NamedTuple):
    """The r straight lines of an element's elastic force."""

    straight: np.ndarray  # (r, 2) force [N] at zero compression, and slope [N/m]
    borders: np.ndarray  # (r - 1) compressions [m] where they meet
    mean: np.ndarray  # (r) N, mean of the forces at both ends of each line


def lines(kind: int, stiffness, preload, own_number: float, rows: np.ndarray) -> Lines:
    """The lines of an element's law; `rows` are those of its table."""
    if kind == LINEAR:
        return Lines(np.array([[preload, stiffness]]), np.empty(0), np.zeros(1))
    if kind in CURVED:
        rows = chords(kind, stiffness, preload, own_number, rows, CHORDS)
    d, p = rows.T
    slope = np.diff(p) / np.diff(d)
    return Lines(np.stack([p[:-1] - slope * d[:-1], slope], axis=1), d[1:-1], 0.5 * (p[:-1] + p[1:]))


def chords(kind: int, stiffness, preload, own_number: float, rows: np.ndarray, count: int) -> np.ndarray:
    """Rows (compression [m], force [N]) of about `count` chords of a curved law; `rows` are its stiffness table.

    A law of contacts has `count` chords up to CHORD_FORCE and more beyond it.
    """
    if kind in OF_CONTACTS:
        more = int(np.ceil(np.log(REACH) / (4.0 * np.log1p(1.0 / count))))  # chords beyond CHORD_FORCE
        beyond = (1.0 + 1.0 / count) ** (2 * np.arange(1, more + 1))
        share = np.concatenate([np.arange(count + 1) / count, beyond])
        law = OF_CONTACTS[kind](stiffness, own_number)
        touch = law.depth(preload) if np.real(preload) > 0.0 else 0.0
        u = law.depth(CHORD_FORCE * share**2)
        return np.stack([u - touch, CHORD_FORCE * share**2 + 0.0 * u], axis=1)
    d = knots(rows, count)
    beyond = (d[-1] - d[0]) if len(d) > 1 else 1e-3
    d = np.concatenate([[d[0] - beyond], d, [d[-1] + beyond]])
    return np.stack([d, preload + integral(rows, d) - integral(rows, np.zeros(1))], axis=1)


def knots(rows: np.ndarray, count: int) -> np.ndarray:
    """Compressions [m] of the ends of about `count` chords of equal error for a stiffness table, including its rows."""
    d, counts = rows[:, 0], chords_per_row(rows, count)
    inner = [d[i] + (d[i + 1] - d[i]) * np.arange(n) / n for i, n in enumerate(counts)]
    return np.concatenate([*inner, d[-1:]])


def chords_per_row(rows: np.ndarray, count: int) -> np.ndarray:
    """Chords in each interval of a stiffness table, about `count` in all, by width times square root of curvature."""
    d, k = np.real(rows).T
    weight = np.sqrt(np.abs(np.diff(k)) * np.diff(d))
    return np.maximum(1, np.ceil(count * weight / max(weight.sum(), 1e-300) - 1e-9)).astype(int)


def integral(rows: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Integral [N] of a stiffness table from its first row to `at` [m]; the stiffness is constant beyond both ends."""
    d, k = rows.T
    beyond = at[:, None] - d
    bends = np.diff(np.concatenate([[0.0], np.diff(k) / np.diff(d), [0.0]]))
    return k[0] * beyond[:, 0] + 0.5 * np.where(np.real(beyond) > 0.0, beyond, 0.0) ** 2 @ bends


@lru_cache(maxsize=64)
def with_chords(train: Train, count: int = CHORDS) -> Train:
    """The train with every curved law replaced by `count` chords; laws of contacts have more beyond CHORD_FORCE.

    Event-exact itself uses the default number of chords. Give it this train for another number. Raises InputError for
    a law that is not among WRITTEN.
    """
    laws = train.laws
    if laws is None or train.straight:
        return train
    train.require_kinds("event-exact", WRITTEN, "camopt/exact/affine/lines.py")
    tables = []
    for e, kind in enumerate(laws.kind):
        rows = laws.table[e, : laws.rows[e]]
        if kind in CURVED:
            rows = chords(kind, laws.coefficient[e], train.preload[e], laws.own_number[e], rows, count)
        tables.append(rows)
    row_counts = np.array([len(rows) for rows in tables])
    kinds = np.where(np.isin(laws.kind, CURVED), TABLE, laws.kind)
    table = np.stack([lengthened(rows, row_counts.max(), last_slope(rows)) for rows in tables])
    return replace(train, laws=replace(laws, kind=kinds, table=table, rows=row_counts))


def rest_of(train: Train) -> np.ndarray:
    """State (2n + r) at rest of the train as simulated by event-exact, with chords in place of curved laws."""
    return state_at_rest(with_chords(train))
