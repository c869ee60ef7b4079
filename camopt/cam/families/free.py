"""The free cam: acceleration as a cubic spline, its joining and ramp conditions solved once as x = x_p + Z z.

The acceleration over the duration is a clamped cubic B-spline (de Boor, A Practical Guide to Splines, 1978) on equal
knot intervals, so the lift is a quintic spline, four times continuously differentiable inside. Every limit of the
design is imposed on Bernstein control points: a polynomial lies between its smallest and largest control point on
the interval (Farin, Curves and Surfaces for CAGD, 2002, ch. 5), so such a row holds at every angle and is linear in z.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import factorial

import numpy as np
from scipy.interpolate import BSpline, PPoly

from camopt.cam.bernstein import from_powers
from camopt.cam.families.free_limits import About, Limits, free_limits
from camopt.cam.families.record import Event, Family, Parameters
from camopt.cam.lift import Lift, with_ramps
from camopt.cam.ramps import Ramp, scene_ramps
from camopt.scene import InputError, Scene
from camopt.scene.design import Design
from camopt.scene.units import DEG, MM_PER_DEG2

DEGREE = 3
"""Polynomial degree of the acceleration."""


@dataclass(frozen=True)
class FreeCam:
    """A spline cam between two ramps: spline coefficients x = x_p + Z z (n) [mm/deg^2], free coefficients z (m).

    `breaks` (k + 1) [rad] are the knots, equally spaced over the duration; Z (n, m) has orthonormal columns. Limits
    that are not linear in the lift are taken `about` a cam.
    """

    breaks: np.ndarray = field(repr=False)
    opening: Ramp
    closing: Ramp
    x_p: np.ndarray = field(repr=False)
    Z: np.ndarray = field(repr=False)
    about: About = field(default_factory=About)

    @property
    def knot_deg(self) -> float:
        """Knot interval [deg]."""
        return float(self.breaks[1] - self.breaks[0]) / DEG

    @cached_property
    def _bases(self) -> tuple[PPoly, ...]:
        """Lift of every basis function and its first six derivatives, each with values (n)."""
        lift = _basis_lift(self.breaks)
        return lift, *(lift.derivative(k) for k in range(1, 7))

    @cached_property
    def _ramps(self) -> tuple[PPoly, ...]:
        """The ramps' lift and its first six derivatives."""
        lift = PPoly(self.without_spline.coefficients[:, ::-1].T, self.without_spline.borders)
        return lift, *(lift.derivative(k) for k in range(1, 7))

    @cached_property
    def without_spline(self) -> Lift:
        """The ramps, with the opening ramp's straight line in place of the spline."""
        line = np.array([[self.opening.height, self.opening.velocity]])
        return with_ramps(self.breaks[[0, -1]], line, self.opening, self.closing, "free", {})

    def ramp_extremes(self, order: int) -> tuple[float, float]:
        """The least and the largest lift^(order) [m/rad^order] on the ramps, which no free coefficient moves."""
        sides = ((-np.pi, self.breaks[0]), (self.breaks[-1], np.pi))
        low, high = zip(*(self.without_spline.extremes(order, *side) for side in sides), strict=True)
        return min(low), max(high)

    def coefficients(self, z: np.ndarray) -> np.ndarray:
        """Spline coefficients x (n) [mm/deg^2] of free coefficients z (m)."""
        return self.x_p + self.Z @ z

    def lift(self, z: np.ndarray) -> Lift:
        """The cam of free coefficients z (m), its pieces exact."""
        parameters = {"knot_deg": self.knot_deg, "coefficients_mm_per_deg2": self.coefficients(z).tolist()}
        return with_ramps(self.breaks, self.pieces(z), self.opening, self.closing, "free", parameters)

    def pieces(self, z):
        """Local coefficients (k, 6) [m/rad^k] of free coefficients z (m), an array of NumPy or JAX."""
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
        """Matrix (k, n) and offset (k) with lift^(order)(theta) = matrix @ x + offset [m/rad^order].

        `theta` (k) [rad] may lie anywhere; derivatives up to the sixth (beyond the fifth only
        the ramps' feet have one), one-sided from the right at the knots.
        """
        theta = np.mod(np.asarray(theta, dtype=float) + np.pi, 2 * np.pi) - np.pi
        inside = (theta >= self.breaks[0]) & (theta < self.breaks[-1])
        matrix = np.zeros((len(theta), len(self.x_p)))
        matrix[inside] = self._bases[order](theta[inside])
        offset = self._ramps[order](theta)
        return matrix, offset

    def area(self) -> tuple[np.ndarray, float]:
        """Row (m) and constant with area = row @ z + constant [m rad]."""
        row = self._bases[0].antiderivative()(self.breaks[-1])
        constant = self.without_spline.area
        return row @ self.Z, float(constant + row @ self.x_p)

    def control_points(self, order: int, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Bernstein control points of lift^(order) between `edges` [rad] and the knots inside them.

        Returns matrix (c, m) and offset (c) with points = matrix @ z + offset [m/rad^order].
        """
        low, high = edges[0], edges[-1]
        inner = self.breaks[(self.breaks > low) & (self.breaks < high)]
        edges = _merged(np.concatenate([edges, inner]))
        start, width, degree = edges[:-1], np.diff(edges), DEGREE + 2 - order
        taylor = np.stack(
            [self._bases[order].derivative(k)(start) * width[:, None] ** k / factorial(k) for k in range(degree + 1)]
        )
        points = np.einsum("ik,ken->ein", from_powers(degree), taylor)
        greville = start[:, None] + width[:, None] * np.arange(degree + 1) / degree
        offset = (
            [
                self.opening.height + self.opening.velocity * (greville - self.breaks[0]),
                np.full_like(greville, self.opening.velocity),
            ][order]
            if order < 2
            else np.zeros_like(greville)
        )
        points = np.concatenate([points[:, :-1].reshape(-1, points.shape[2]), points[-1, -1:]])  # shared ends once
        offset = np.append(offset[:, :-1].ravel(), offset[-1, -1])
        matrix = points @ self.Z
        size = np.abs(matrix).max(axis=1)
        matrix[size < 1e-12 * size.max()] = 0.0  # fixed by the ramps, to round-off
        return matrix, offset + points @ self.x_p

    def weighted_points(
        self, weights: Sequence[float | np.ndarray], start: np.ndarray, width: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Control points of sum_k weights[k] * lift^(k), of degree five, from `start` (k) [rad] over `width` (k).

        A weight is a number, or one for every interval. Returns matrix (k, 6, m) and offset (k, 6); no knot may lie
        inside an interval.
        """
        degree = DEGREE + 2
        inside = start + 1e-9 * width  # a derivative that steps at a knot is that of the interval
        taylor = np.zeros((degree + 1, len(start), len(self.x_p)))
        ramp = np.zeros((degree + 1, len(start)))
        for order, weight in enumerate(weights):
            for k in range(degree + 1 - order if np.any(weight) else 0):
                factor = weight * width**k / factorial(k)
                taylor[k] += self._bases[order + k](inside) * factor[:, None]
                ramp[k] += self._ramps[order + k](inside) * factor
        points = np.einsum("ik,ken->ein", from_powers(degree), taylor)
        offset = np.einsum("ik,ke->ei", from_powers(degree), ramp)
        return points @ self.Z, offset + points @ self.x_p

    def limits(self, design: Design) -> Limits:
        """The design's limits on the shape as rows on z that hold at every angle."""
        return free_limits(self, design)


def free_cam(design: Design, knot_deg: float = 3.0) -> FreeCam:
    """The free cam of a design, whose knot interval is the longest one up to `knot_deg` that divides the duration.

    The spline meets lift, velocity and zero acceleration at both ramp tops; what these conditions leave of its
    coefficients x (n) are the free coefficients z (m) [mm/deg^2]. Raises ValueError for a knot interval that leaves no
    free coefficient.
    """
    half = design.duration_deg / 2 * DEG
    count = int(np.ceil(design.duration_deg / knot_deg - 1e-9))
    if count < 2:
        raise ValueError(
            f"knot_deg must be at most half of duration_deg = {design.duration_deg:g} (given: {knot_deg:g})"
        )
    breaks = np.linspace(-half, half, count + 1)
    opening, closing = scene_ramps(design)
    lift = _basis_lift(breaks)
    n = lift.c.shape[2]
    first, last = np.eye(n)[[0, n - 1]]
    conditions = np.stack([first, last, lift.derivative()(half) / half, lift(half) / half**2])
    velocity = -closing.velocity - opening.velocity
    rise = closing.height - opening.height - opening.velocity * 2 * half
    values = np.array([0.0, 0.0, velocity / half, rise / half**2])
    row_scale = np.abs(conditions).max(axis=1)
    conditions, values = conditions / row_scale[:, None], values / row_scale
    q, r = np.linalg.qr(conditions.T, mode="complete")
    x_p = q[:, :4] @ np.linalg.solve(r[:4].T, values)
    x_p += q[:, :4] @ np.linalg.solve(r[:4].T, values - conditions @ x_p)  # one refinement: equalities to round-off
    return FreeCam(breaks, opening, closing, x_p, q[:, 4:])


def _basis_lift(breaks: np.ndarray) -> PPoly:
    """Lift (n) [m] per spline coefficient [mm/deg^2]: cubic B-splines, integrated twice from zero at the first knot."""
    knots = np.concatenate([np.full(DEGREE, breaks[0]), breaks, np.full(DEGREE, breaks[-1])])
    spline = BSpline(knots, np.eye(len(breaks) - 1 + DEGREE) * MM_PER_DEG2, DEGREE)
    taylor = [spline(breaks[:-1], nu=k) / factorial(k) for k in range(DEGREE, -1, -1)]
    return PPoly(np.stack(taylor), breaks).antiderivative(2)


def _merged(edges: np.ndarray) -> np.ndarray:
    """The edges in ascending order, without those that differ from another by round-off only."""
    edges = np.sort(edges)
    return edges[np.append(True, np.diff(edges) > 1e-12)]


def free_cam_of(design: Design, cam: Lift) -> tuple[FreeCam, np.ndarray]:
    """The free cam, between a design's ramps, of which `cam` is the one of the coefficients z (m), which follow."""
    free = free_cam(design, cam.parameters["knot_deg"])
    return free, free.Z.T @ (np.array(cam.parameters["coefficients_mm_per_deg2"]) - free.x_p)


def _construction(scene: Scene, cam: Lift) -> tuple[Parameters, Event]:
    """The free coefficients z [mm/deg^2], from which the event is built between the scene's ramps."""
    if scene.design is None:
        raise InputError("free: the scene needs [design]")
    free, z = free_cam_of(scene.design, cam)

    def event(p: Parameters, opening: Ramp, closing: Ramp):
        return p["z"].__array_namespace__().asarray(free.breaks), free.pieces(p["z"])

    return {"z": z}, event


FAMILY = Family("free", construction=_construction, symmetric=False)
