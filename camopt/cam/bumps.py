"""Directions in which any cam can be changed: bumps on its lift, between the ramp tops."""

from dataclasses import replace

import numpy as np

from camopt.cam.lift import Lift
from camopt.cam.polynomials import recentred
from camopt.scene.shapes import Float

DEGREE = 5
SAME = 1e-9
"""Angle [rad] below which a knot of a bump takes the place of a border of the cam's pieces."""


def with_bumps(lift: Lift, count: int) -> tuple[Lift, Float[np.ndarray, "count p q"]]:
    """The cam on the union of its pieces with those of `count` bumps, and the bumps as changes of its
    coefficients [m/rad^k] per metre of height.

    The bumps are quintic B-splines of height 1 on equal knots over the duration, each six of its intervals wide: four
    times continuously differentiable, zero outside, so that ramps and feet stay. `count` >= 1.
    """
    knots = np.linspace(-lift.half_duration, lift.half_duration, count + DEGREE + 1)
    nearest = lift.borders[np.argmin(np.abs(lift.borders[:, None] - knots), axis=0)]
    knots = np.where(np.abs(nearest - knots) < SAME, nearest, knots)
    edges = np.concatenate([[-np.pi], knots, [np.pi]])
    flat = Lift(edges, np.zeros((len(edges) - 1, DEGREE + 1)), lift.half_duration)
    whole = lift.shifted(flat)
    piece = np.searchsorted(edges, 0.5 * (whole.borders[1:] + whole.borders[:-1])) - 1
    bumps = [recentred(_bump(flat, i), piece, whole.borders[:-1]) for i in range(count)]
    missing = whole.coefficients.shape[1] - DEGREE - 1
    return whole, np.pad(np.array(bumps), ((0, 0), (0, 0), (0, missing)))


def moved(lift: Lift, directions: Float[np.ndarray, "m p q"], heights: Float[np.ndarray, " m"]) -> Lift:
    """The cam with `heights` [m] of the changes `directions` added to its coefficients."""
    return replace(lift, coefficients=lift.coefficients + np.tensordot(heights, directions, 1))


def _bump(flat: Lift, i: int) -> Lift:
    """The i-th bump on the pieces of `flat`, whose first and last lie outside the knots."""
    from scipy.interpolate import BSpline, PPoly

    knots = flat.borders[1 + i : 3 + i + DEGREE]
    spline = BSpline.basis_element(knots)
    pieces = PPoly.from_spline(spline.tck)
    inside = [int(np.searchsorted(pieces.x, left, "right")) - 1 for left in knots[:-1]]
    rows = np.zeros_like(flat.coefficients)
    rows[1 + i : 2 + i + DEGREE] = pieces.c[::-1, inside].T / spline(0.5 * (knots[0] + knots[-1]))
    return replace(flat, coefficients=rows)
