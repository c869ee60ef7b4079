"""The room that a piston on crank and rod leaves for the valve, as polynomials of the cam angle with a certain error.

With the crank's radius r, the rod l, the pin offset e and the crank angle phi from the vertical, the piston stands
r cos(phi) + sqrt(l^2 - (r sin(phi) - e)^2) above the crank (Heywood, Internal Combustion Engine Fundamentals, 1988,
ch. 2). It is highest where crank and rod are in line, sin(phi) = e / (l + r), and crank angles count from there.
"""

from math import asin, cos

import numpy as np

from camopt.cam.level import Level
from camopt.scene.design import Piston
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM

PIECE = 1.0 * DEG
"""Longest piece of the polynomials [rad of the cam]: their error is then a few nanometres."""
SERIES_END = 1e-18
"""Size of the terms of a series, relative to its sum, after which it ends; the rest is a geometric series."""


def piston_drop(piston: Piston, crank: Float[np.ndarray, "*k"], order: int = 0) -> Float[np.ndarray, "*k"]:
    """How far the piston is below its highest place [m], or its derivative, at crank angles from there [rad]."""
    r, rod, e = (x * MM for x in (piston.stroke_mm / 2, piston.rod_mm, piston.pin_offset_mm))
    phi = crank + asin(e / (rod + r))
    side = r * np.sin(phi) - e
    upright = np.sqrt(rod**2 - side**2)
    if order == 1:
        return r * np.sin(phi) + side * r * np.cos(phi) / upright
    return np.sqrt((rod + r) ** 2 - e**2) - r * np.cos(phi) - upright


def piston_room(piston: Piston, cam_per_crank: float, half: float) -> Level:
    """The largest lift [m] that keeps the clearance, at cam angles from -half to half [rad].

    Cubic Hermite pieces: their error is width^4 / 384 times a bound on the fourth derivative.
    """
    slope = cos(piston.valve_angle_deg * DEG)
    room = (piston.gap_at_top_mm - piston.clearance_mm) * MM
    edges = np.linspace(-half, half, int(np.ceil(2 * half / PIECE)) + 1)
    crank = piston.lobe_centre_deg * DEG + edges / cam_per_crank
    value = room + slope * piston_drop(piston, crank)
    rate = slope * piston_drop(piston, crank, 1) / cam_per_crank
    h = np.diff(edges)
    rise = np.diff(value) / h
    bend, twist = (3 * rise - 2 * rate[:-1] - rate[1:]) / h, (rate[:-1] + rate[1:] - 2 * rise) / h**2
    pieces = np.stack([value[:-1], rate[:-1], bend, twist], axis=1)
    fourth = slope * largest_fourth_derivative(piston) / cam_per_crank**4
    return Level(edges, pieces, float(h.max()) ** 4 / 384 * fourth)


def largest_fourth_derivative(piston: Piston) -> float:
    """A bound on the fourth derivative of the piston's place by the crank angle [m/rad^4].

    With u = (r sin(phi) - e) / l, the root is l (1 - sum over n of a_n u^(2n)) with positive a_n, and the fourth
    derivative of a trigonometric polynomial of degree 2n is at most (2n)^4 times its largest value (Bernstein 1912).
    """
    r, rod, e = (x * MM for x in (piston.stroke_mm / 2, piston.rod_mm, piston.pin_offset_mm))
    share = ((r + abs(e)) / rod) ** 2
    total, term, n = 0.0, share / 2, 1  # term: a_n u^(2n)
    while True:
        total += term * (2 * n) ** 4
        if share * ((n + 1) / n) ** 4 < 1:  # from here on the terms fall at least as fast as a geometric series
            rest = term * (2 * n) ** 4 / (1 - share * ((n + 1) / n) ** 4)
            if rest < SERIES_END * total or n > 10_000:
                return r + rod * (total + rest)
        term *= share * (2 * n - 1) / (2 * n + 2)
        n += 1
