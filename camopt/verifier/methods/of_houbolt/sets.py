"""Effective stiffness and loads of Houbolt's method, for every set of pieces that occurs."""

from typing import NamedTuple

import numpy as np

from camopt.scene.errors import InputError
from camopt.scene.train import Train
from camopt.verifier.methods.of_houbolt.elements import FRICTION, LINEAR, OIL, TABLE, Elements, elements_of

MOST_KEYS = 2**62
"""Sets of pieces are numbered in 64 bits."""


class Sets(NamedTuple):
    """Masses, elements, and the matrices of every set of pieces that has occurred, in the order of `keys`."""

    mass: np.ndarray  # (n)
    elements: Elements
    keys: np.ndarray  # (s)
    inverse: np.ndarray  # (s, n, n)
    damping: np.ndarray  # (s, n, n)
    load: np.ndarray  # (s, n, 3 + r) by 1, lift, lift velocity and what is held of the memories


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
        """Place of a set of pieces, built if it is new."""
        known = np.flatnonzero(self.keys == key)
        if len(known):
            return int(known[0])
        t, rows = self.train, self.elements.rows
        acting, piece = self._decoded(key)
        base, line, holding = self._lines(piece)
        k, c = line * acting, t.damping * acting
        damping = np.diag(t.mass_damping) + np.einsum("e,ei,ej->ij", c, rows, rows)
        stiffness = np.einsum("e,ei,ej->ij", k, rows, rows)
        effective = self.m * np.diag(t.mass) + self.c * damping + stiffness
        parts = base * acting - k * t.gap, k * t.cam_driven, c * t.cam_driven, *holding
        load = np.stack([-p @ rows for p in parts], axis=1)
        load[:, 0] += t.mass_force
        self.inverse = np.concatenate([self.inverse, np.linalg.inv(effective)[None]])
        self.damping = np.concatenate([self.damping, damping[None]])
        self.load = np.concatenate([self.load, load[None]])
        self.keys = np.append(self.keys, key)
        return len(self.keys) - 1

    def arrays(self) -> Sets:
        return Sets(self.train.mass, self.elements, self.keys, self.inverse, self.damping, self.load)

    def _decoded(self, key: int) -> tuple[np.ndarray, np.ndarray]:
        """(which elements act, the piece of each), each (e)."""
        q, contact = self.elements, self.train.contact
        acting, piece = np.ones(len(contact), dtype=bool), np.zeros(len(contact), dtype=int)
        for e in range(len(contact) - 1, -1, -1):
            if contact[e]:
                key, closed = divmod(key, 2)
                acting[e] = closed == 1
            key, piece[e] = divmod(key, int(q.pieces[e]))
        return acting, piece

    def _lines(self, piece: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Force where compression and what is held are zero (e), its slope by the compression (e) and by the latter
        (r, e)."""
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
