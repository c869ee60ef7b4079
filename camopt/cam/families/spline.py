"""Spline cams: acceleration as a cubic spline between two ramps, affine in free coefficients, x = x_p + Z z.

The acceleration over the duration is a clamped cubic B-spline (de Boor, A Practical Guide to Splines, 1978) on equal
knot intervals, so the lift is a quintic spline, four times continuously differentiable inside. The Bernstein control
points of a derivative enclose it on their interval (Farin, Curves and Surfaces for CAGD, 2002, ch. 5), so a bound on
them holds at every angle, and it is linear in z.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import factorial

import numpy as np
from scipy.interpolate import BSpline, PPoly

from camopt.cam.lift import Lift, with_ramps
from camopt.cam.polynomials import from_powers
from camopt.cam.ramps import Ramp
from camopt.scene.units import DEG, MM_PER_DEG2

DEGREE = 3
"""Polynomial degree of the acceleration."""


@dataclass(frozen=True)
class SplineCam:
    """A spline cam between two ramps: spline coefficients x = x_p + Z z (n) [mm/deg^2], free coefficients z (m).

    `breaks` (k + 1) [rad] are the knots, equally spaced over the duration; Z (n, m) has orthonormal columns.
    """

    breaks: np.ndarray = field(repr=False)
    opening: Ramp
    closing: Ramp
    x_p: np.ndarray = field(repr=False)
    Z: np.ndarray = field(repr=False)

    @property
    def knot_deg(self) -> float:
        """Knot interval [deg]."""
        return float(self.breaks[1] - self.breaks[0]) / DEG

    @cached_property
    def _bases(self) -> tuple[PPoly, ...]:
        """Lift of every basis function and its first six derivatives, each with values (n)."""
        lift = basis_lift(self.breaks)
        return lift, *(lift.derivative(k) for k in range(1, 7))

    @cached_property
    def without_spline(self) -> Lift:
        """The ramps, with the opening ramp's straight line in place of the spline."""
        line = np.array([[self.opening.height, self.opening.velocity]])
        return with_ramps(self.breaks[[0, -1]], line, self.opening, self.closing, "free", {})

    def ramp_extremes(self, order: int) -> tuple[float, float]:
        """The least and the largest lift^(order) [m/rad^order] on the ramps, which no free coefficient changes."""
        sides = ((-np.pi, self.breaks[0]), (self.breaks[-1], np.pi))
        low, high = zip(*(self.without_spline.extremes(order, *side) for side in sides), strict=True)
        return min(low), max(high)

    def coefficients(self, z: np.ndarray) -> np.ndarray:
        """Spline coefficients x (n) [mm/deg^2] for free coefficients z (m)."""
        return self.x_p + self.Z @ z

    def lift(self, z: np.ndarray) -> Lift:
        """The cam for free coefficients z (m), with exact pieces."""
        parameters = {"knot_deg": self.knot_deg, "coefficients_mm_per_deg2": self.coefficients(z).tolist()}
        return with_ramps(self.breaks, self.pieces(z), self.opening, self.closing, "free", parameters)

    def pieces(self, z):
        """Local coefficients (k, 6) [m/rad^k] for free coefficients z (m), an array of NumPy or JAX."""
        line = np.zeros((len(self.breaks) - 1, DEGREE + 3))
        line[:, 0] = self.opening.height + self.opening.velocity * (self.breaks[:-1] - self.breaks[0])
        line[:, 1] = self.opening.velocity
        return (self._bases[0].c @ self.coefficients(z))[::-1].T + line

    def piece_basis(self) -> tuple[np.ndarray, np.ndarray]:
        """Matrix (p, q, m) and offset (p, q) [m/rad^k]: the pieces of `lift(z)` are matrix @ z + offset."""
        size = self.Z.shape[1]
        offset = self.lift(np.zeros(size)).coefficients
        return np.stack([self.lift(unit).coefficients - offset for unit in np.eye(size)], axis=-1), offset

    def basis(self, theta, order: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Matrix (k, n) and offset (k) with lift^(order)(theta) = matrix @ x + offset [m/rad^order]. `theta` (k) [rad]
        may lie anywhere; derivatives go up to the sixth, one-sided from the right at the knots."""
        theta = np.mod(np.asarray(theta, dtype=float) + np.pi, 2 * np.pi) - np.pi
        inside = (theta >= self.breaks[0]) & (theta < self.breaks[-1])
        matrix = np.zeros((len(theta), len(self.x_p)))
        matrix[inside] = self._bases[order](theta[inside])
        return matrix, self.without_spline(theta, order)

    def samples(self, theta) -> tuple[np.ndarray, np.ndarray]:
        """Lift [m] and its angle derivative [m/rad] at `theta` (k) [rad]: their derivatives by the free coefficients z,
        shape (k, 2, m), and their values at z = 0, shape (k, 2)."""
        orders = [self.basis(theta, order) for order in (0, 1)]
        along = np.stack([matrix @ self.Z for matrix, _ in orders], axis=1)
        return along, np.stack([offset + matrix @ self.x_p for matrix, offset in orders], axis=1)

    def area(self) -> tuple[np.ndarray, float]:
        """Row (m) and constant with area = row @ z + constant [m rad]."""
        row = self._bases[0].antiderivative()(self.breaks[-1])
        constant = self.without_spline.area
        return row @ self.Z, float(constant + row @ self.x_p)

    def control_points(self, order: int, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Matrix (c, m) and offset (c) of the Bernstein control points of lift^(order), matrix @ z + offset
        [m/rad^order], between `edges` [rad] and the knots inside them."""
        low, high = edges[0], edges[-1]
        inner = self.breaks[(self.breaks > low) & (self.breaks < high)]
        edges = merged(np.concatenate([edges, inner]))
        start, width, degree = edges[:-1], np.diff(edges), DEGREE + 2 - order
        taylor = np.stack(
            [self._bases[order].derivative(k)(start) * width[:, None] ** k / factorial(k) for k in range(degree + 1)]
        )
        points = np.einsum("ik,ken->ein", from_powers(degree), taylor)
        greville = start[:, None] + width[:, None] * np.arange(degree + 1) / degree
        straight = np.polynomial.Polynomial([self.opening.height, self.opening.velocity])
        offset = straight.deriv(order)(greville - self.breaks[0])
        points = np.concatenate([points[:, :-1].reshape(-1, points.shape[2]), points[-1, -1:]])  # shared ends once
        offset = np.append(offset[:, :-1].ravel(), offset[-1, -1])
        matrix = points @ self.Z
        size = np.abs(matrix).max(axis=1)
        matrix[size < 1e-12 * size.max()] = 0.0  # fixed by the ramps, to round-off
        return matrix, offset + points @ self.x_p

    def weighted_points(
        self, weights: Sequence[float | np.ndarray], start: np.ndarray, width: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Matrix (k, 6, m) and offset (k, 6) of the control points of sum_k weights[k] * lift^(k), of degree five, from
        `start` (k) [rad] over `width` (k). A weight is a number, or one per interval, which contains no knot."""
        degree = DEGREE + 2
        inside = start + 1e-9 * width  # where a derivative steps at a knot, its value in the interval
        taylor = np.zeros((degree + 1, len(start), len(self.x_p)))
        ramp = np.zeros((degree + 1, len(start)))
        for order, weight in enumerate(weights):
            for k in range(degree + 1 - order if np.any(weight) else 0):
                factor = weight * width**k / factorial(k)
                taylor[k] += self._bases[order + k](inside) * factor[:, None]
                ramp[k] += self.without_spline(inside, order + k) * factor
        points = np.einsum("ik,ken->ein", from_powers(degree), taylor)
        offset = np.einsum("ik,ke->ei", from_powers(degree), ramp)
        return points @ self.Z, offset + points @ self.x_p


def basis_lift(breaks: np.ndarray) -> PPoly:
    """Lift (n) [m] per spline coefficient [mm/deg^2]: cubic B-splines, integrated twice from zero at the first knot."""
    knots = np.concatenate([np.full(DEGREE, breaks[0]), breaks, np.full(DEGREE, breaks[-1])])
    spline = BSpline(knots, np.eye(len(breaks) - 1 + DEGREE) * MM_PER_DEG2, DEGREE)
    taylor = [spline(breaks[:-1], nu=k) / factorial(k) for k in range(DEGREE, -1, -1)]
    return PPoly(np.stack(taylor), breaks).antiderivative(2)


def merged(edges: np.ndarray) -> np.ndarray:
    """The edges in ascending order, without those that differ from another one by rounding only."""
    edges = np.sort(edges)
    return edges[np.append(True, np.diff(edges) > 1e-12)]
