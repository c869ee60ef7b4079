"""Elastic laws beyond the linear one, as data, with what the scene itself evaluates: rest, touch and stand-ins.

Let d be the compression, p the elastic force and P the preload, which is the force at d = 0 under every law. Then

    linear       p = P + k d
    hertz        p = k (d - d_touch)^exponent above the touch, 0 below it; d_touch = -(P / k)^(1 / exponent)
    progressive  p = P + integral of K from 0 to d; K piecewise linear in d, constant beyond its first and last row

so that a contact touches where p falls to zero, whatever its law. A hertz contact without preload touches at d = 0 and
has p = k d^exponent; for two curved bodies that touch in a point the exponent is 3/2 (Hertz 1882).
"""

from dataclasses import dataclass

import numpy as np

LINEAR, HERTZ, PROGRESSIVE = range(3)
KINDS = {"linear": LINEAR, "hertz": HERTZ, "progressive": PROGRESSIVE}
POINT_CONTACT = 1.5
"""Exponent of a hertz contact where the scene gives none."""
STAND_IN_FORCE = 1000.0
"""Force [N] at which the tangent stiffness of a hertz contact stands in for it in modes and in first step sizes."""


@dataclass(frozen=True, eq=False)
class Laws:
    """The elastic laws of the elements (e) of a train."""

    kind: np.ndarray  # (e) int: LINEAR, HERTZ or PROGRESSIVE
    coefficient: np.ndarray  # (e): N/m^exponent of a hertz contact, N/m of a linear element
    exponent: np.ndarray  # (e): 1 unless hertz
    table: np.ndarray  # (e, q, 2): compression [m] in ascending rows and stiffness [N/m]; read where progressive

    def force(self, d: np.ndarray, preload: np.ndarray) -> np.ndarray:
        """Elastic force [N] at compressions d (e) [m] with the preloads (e) [N]."""
        u = np.maximum(0.0, d - self.touch(preload))
        force = np.where(self.kind == HERTZ, self.coefficient * u**self.exponent, preload + self.coefficient * d)
        for e in np.flatnonzero(self.kind == PROGRESSIVE):
            force[e] = preload[e] + _integral(self.table[e], d[e])
        return force

    def tangent(self, d: np.ndarray, preload: np.ndarray) -> np.ndarray:
        """Derivative of `force` by the compression [N/m], shape (e)."""
        u = np.maximum(0.0, d - self.touch(preload))
        tangent = self.coefficient * np.where(self.kind == HERTZ, self.exponent * u ** (self.exponent - 1.0), 1.0)
        for e in np.flatnonzero(self.kind == PROGRESSIVE):
            tangent[e] = np.interp(d[e], *self.table[e].T)
        return tangent

    def touch(self, preload: np.ndarray) -> np.ndarray:
        """Compression at which each elastic force falls to zero [m], shape (e)."""
        touch = -preload / self.coefficient
        hertz = self.kind == HERTZ
        touch[hertz] = -((preload[hertz] / self.coefficient[hertz]) ** (1.0 / self.exponent[hertz]))
        for e in np.flatnonzero(self.kind == PROGRESSIVE):
            touch[e] = _compression(self.table[e], -preload[e])
        return touch

    def stand_in(self) -> np.ndarray:
        """Constant stiffness [N/m] of each element for modes and step sizes, shape (e).

        For a hertz contact it is the tangent at STAND_IN_FORCE, for a progressive element the stiffness at compression
        zero.
        """
        slope = (
            self.exponent * self.coefficient ** (1.0 / self.exponent) * STAND_IN_FORCE ** (1.0 - 1.0 / self.exponent)
        )
        table = np.array([np.interp(0.0, *rows.T) for rows in self.table])
        return np.where(self.kind == PROGRESSIVE, table, slope)


def _integral(table: np.ndarray, d: float) -> float:
    """Integral of a table's stiffness from 0 to d [N]."""
    return _from_first(table, d) - _from_first(table, 0.0)


def _from_first(table: np.ndarray, d: float) -> float:
    """Integral of a table's stiffness from its first row to d, by trapezia, which is exact for straight lines."""
    (c, k), first = table.T, table[0, 0]
    inside = c[(c > min(first, d)) & (c < max(first, d))]
    knots = np.concatenate([[min(first, d)], inside, [max(first, d)]])
    return float(np.sign(d - first) * np.trapezoid(np.interp(knots, c, k), knots))


def _compression(table: np.ndarray, force: float) -> float:
    """Compression [m] at which the integral from 0 equals `force`; between two rows it is the root of a parabola."""
    c, k = table.T
    at_rows = np.array([_integral(table, row) for row in c])
    i = int(np.searchsorted(at_rows, force, "right")) - 1
    slope = (k[i + 1] - k[i]) / (c[i + 1] - c[i]) if 0 <= i < len(c) - 1 else 0.0
    i = max(i, 0)
    rest = force - at_rows[i]
    return float(c[i] + 2.0 * rest / (k[i] + np.sqrt(k[i] ** 2 + 2.0 * slope * rest)))
