"""Elastic force and energy of a train's elements along a record, for the energy balance: the laws written once more."""

import numpy as np
from scipy.interpolate import PPoly

from camopt.scene.laws import FRICTION, HERTZ, OIL, PROGRESSIVE, TABLE, Laws
from camopt.scene.shapes import Float
from camopt.scene.train import Train

BEYOND = 1.0
"""The outer lines of a table are continued by this compression [m]."""


class Elastic:
    """Elastic force p [N] of every element by its compression d, and the energy [J] from where p is zero."""

    def __init__(self, train: Train):
        self.train, self.curves = train, {}
        self.laws = laws = _linear(train) if train.laws is None else train.laws
        kind = laws.kind
        self.hertz, self.oil, self.friction = (np.flatnonzero(kind == k).tolist() for k in (HERTZ, OIL, FRICTION))
        for e in np.flatnonzero((kind == PROGRESSIVE) | (kind == TABLE)):
            force = _curve(laws.table[e], train.preload[e] if kind[e] == PROGRESSIVE else None)
            energy = force.antiderivative()
            energy.c[-1] -= energy(force.roots(extrapolate=False)[0])
            self.curves[int(e)] = force, energy

    def force(self, d: Float[np.ndarray, "k e"]) -> Float[np.ndarray, "k e"]:
        """Elastic forces [N] at compressions [m]; zero for elements with a memory."""
        t, laws = self.train, self.laws
        force = t.preload + t.stiffness * d
        for e, (curve, _) in self.curves.items():
            force[:, e] = curve(d[:, e])
        for e in self.hertz:
            force[:, e] = laws.coefficient[e] * self._pressed(d, e) ** laws.exponent[e]
        force[:, t.memory] = 0.0
        return force

    def stored(self, d: Float[np.ndarray, "k e"], memory: Float[np.ndarray, "k r"]) -> Float[np.ndarray, "k e"]:
        """Elastic energies [J]; a contact that is apart has none."""
        t, laws = self.train, self.laws
        pressed = t.preload + t.stiffness * d
        pressed = np.where(t.contact, np.maximum(pressed, 0.0), pressed)
        energy = 0.5 * pressed**2 / t.stiffness
        for e, (force, curve) in self.curves.items():
            energy[:, e] = np.where(~t.contact[e] | (force(d[:, e]) > 0.0), curve(d[:, e]), 0.0)
        for e in self.hertz:
            higher = laws.exponent[e] + 1.0
            energy[:, e] = laws.coefficient[e] * self._pressed(d, e) ** higher / higher
        for j, e in enumerate(t.memory):
            energy[:, e] = 0.5 * self.kept(d[:, e], memory[:, j], e) ** 2 / t.stiffness[e]
        return energy

    def kept(self, d: np.ndarray, z: np.ndarray, e: int) -> np.ndarray:
        """Force [N] of an element with a memory z [m]."""
        t, laws = self.train, self.laws
        if e in self.oil:
            return t.stiffness[e] * np.maximum(0.0, d - z - laws.travel[e])
        return np.clip(t.stiffness[e] * (d - z), -laws.slip[e], laws.slip[e])

    def _pressed(self, d: np.ndarray, e: int) -> np.ndarray:
        """Compression of a hertz contact beyond its touch [m]."""
        t, laws = self.train, self.laws
        return np.maximum(0.0, d[:, e] + (t.preload[e] / laws.coefficient[e]) ** (1.0 / laws.exponent[e]))


def _linear(train: Train) -> Laws:
    """The laws of a train that gives none."""
    zero = np.zeros(len(train.a))
    kind, rows, table = zero.astype(int), np.ones(len(zero), int), np.zeros((len(zero), 1, 2))
    return Laws(kind, train.stiffness, zero + 1.0, table, zero, zero, zero, rows)


def _curve(table: np.ndarray, preload: float | None) -> PPoly:
    """Force by the compression, from rows (q, 2) of itself or, where it begins with a preload, of the stiffness."""
    c, value = table.T
    slope = np.diff(value) / np.diff(c)
    ends = np.array([c[0] - BEYOND, *c, c[-1] + BEYOND])
    if preload is None:
        slope = np.array([slope[0], *slope, slope[-1]])
        return PPoly(np.stack([slope, np.array([value[0] - slope[0] * BEYOND, *value])]), ends)
    stiffness = PPoly(np.stack([np.array([0.0, *slope, 0.0]), np.array([value[0], *value])]), ends)
    force = stiffness.antiderivative()
    force.c[-1] += preload - force(0.0)
    return force
