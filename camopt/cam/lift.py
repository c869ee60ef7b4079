"""The lift law: 2 pi periodic polynomial pieces, evaluated by SciPy's piecewise polynomials.

Angle zero is the middle of the duration. Lift is total lift above the base circle [m], and derivatives are by cam angle
[rad]. The pieces are exact: lift, velocity, acceleration and jerk at any angle, their extremes and the area are
computed from the coefficients and not from a table.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np

from camopt.cam.polynomials import recentred
from camopt.cam.ramps import Ramp
from camopt.scene.errors import InputError
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from scipy.interpolate import PPoly

    from camopt.scene.design import Design

JOINING = 1e-6
"""Step of lift or velocity at a border, relative to the largest value there, that counts as rounding."""
ROUNDING = 1e-9
APART = 1e-12
"""Angle [rad] within which two borders count as one."""
MOST_ROWS = 360_000
"""Largest number of rows of a lift table, a step of 0.001 deg."""


@dataclass(frozen=True, eq=False)  # compared by identity, since arrays have no single truth value
class Lift:
    """A cam's lift law.

    `borders` (p + 1) [rad] run from -pi to pi; `coefficients` (p, q) [m/rad^k] hold piece i as
    lift = sum_k c[i, k] (theta - borders[i])^k. `half_duration` [rad] is half the angle between the ramp tops.
    """

    borders: Float[np.ndarray, " edges"]
    coefficients: Float[np.ndarray, "p q"]
    half_duration: float
    family: str = "lift"
    parameters: dict = field(default_factory=dict)

    def __post_init__(self):
        if abs(self.borders[0] + np.pi) > 1e-12 or abs(self.borders[-1] - np.pi) > 1e-12:
            raise ValueError("pieces must cover -pi to pi")
        if not np.all(np.diff(self.borders) > 0) or len(self.coefficients) != len(self.borders) - 1:
            raise ValueError("pieces need ascending borders and one row of coefficients each")
        if not np.all(np.isfinite(self.coefficients)):
            raise ValueError("piece coefficients must be finite")

    @cached_property
    def _derivatives(self) -> list["PPoly"]:
        from scipy.interpolate import PPoly  # imported here so that bad input is reported before SciPy loads

        lift = PPoly(self.coefficients[:, ::-1].T, self.borders)
        return [lift, *(lift.derivative(k) for k in range(1, 7))]

    def __call__(self, theta, order: int = 0) -> np.ndarray:
        """Lift (order 0) or its derivative by angle up to the sixth at angles `theta` [rad], any shape."""
        return self._derivatives[order](np.mod(np.asarray(theta) + np.pi, 2 * np.pi) - np.pi)

    def of_piece(self, piece: np.ndarray, theta: np.ndarray, order: int) -> np.ndarray:
        """Derivative `order` of the pieces with the indices `piece` (k) at angles `theta` (..., k) [rad]."""
        value, local = np.zeros(np.shape(theta)), theta - self.borders[piece]
        for c in self._derivatives[order].c[:, piece]:
            value = value * local + c
        return value

    def roots(self, order: int, value: float = 0.0) -> Float[np.ndarray, " k"]:
        """Angles [rad] at which the derivative `order` equals `value`; the start of a piece on which it always does."""
        angles = self._derivatives[order].solve(value, discontinuity=False, extrapolate=False)
        return angles[np.isfinite(angles)]

    def extremes(self, order: int, low: float = -np.pi, high: float = np.pi) -> tuple[float, float]:
        """Exact smallest and largest value of the derivative `order` over [low, high], from the roots of the next
        derivative; at a step at a border the values on both sides count."""
        values, roots = self._derivatives[order], self.roots(order + 1)
        inside = roots[(roots >= low) & (roots <= high)]
        start, end = self.borders[:-1], self.borders[1:]
        within = np.flatnonzero((start < high) & (end > low))
        at_ends = self.of_piece(within, np.clip([[low], [high]], start[within], end[within]), order)
        samples = np.concatenate([values(np.concatenate([inside, [low, high]])), at_ends.ravel()])
        return float(samples.min()), float(samples.max())

    @cached_property
    def area(self) -> float:
        """Integral of the lift over the duration [m rad]."""
        return float(self._derivatives[0].integrate(-self.half_duration, self.half_duration))

    @cached_property
    def max_lift(self) -> float:
        """Largest lift [m]."""
        return self.extremes(0)[1]

    def area_ratio(self, max_lift: float) -> float:
        """Area over the product of a scene's maximum lift [m] and the cam's duration."""
        return self.area / (max_lift * 2 * self.half_duration)

    def area_ratio_in(self, design: "Design") -> float:
        """Area within a design's duration over the product of its maximum lift and duration, not those of the cam."""
        half = design.duration_deg * DEG / 2
        return float(self._derivatives[0].integrate(-half, half)) / (design.max_lift_mm * MM * 2 * half)

    @cached_property
    def opening_foot(self) -> float:
        """Angle at which the lift leaves zero [rad]; pi, the end of the revolution, if it never does."""
        lifted = np.flatnonzero(np.any(self.coefficients != 0, axis=1))
        return float(self.borders[lifted[0]]) if len(lifted) else np.pi

    def closing_angle(self, height: float) -> float:
        """Angle on the closing side at which the lift has fallen to `height` [m] (the lash: nominal closing)."""
        if height <= 0.0 and np.any(self.coefficients):
            last = np.flatnonzero(np.any(self.coefficients != 0, axis=1))[-1]
            return float(self.borders[last + 1])
        roots = self.roots(0, height)
        if len(roots) == 0:
            raise ValueError(f"the lift never reaches {height / MM:g} mm")
        return float(np.max(roots))

    def plot(self, design: "Design | None" = None) -> "Figure":
        """Lift, velocity, acceleration and jerk as a matplotlib Figure, with the limits of a design if one is given."""
        from camopt.plots import profiles

        return profiles([(self.family, lift_table(self, 0.1))], design)

    def __repr__(self) -> str:
        return (
            f"Lift({self.family}: duration {2 * self.half_duration / DEG:.6g} deg, "
            f"maximum lift {self.max_lift / MM:.6g} mm, area {self.area / (MM * DEG):.6g} mm deg, "
            f"{len(self.coefficients)} pieces)"
        )

    def _repr_html_(self) -> str:
        from pandas import DataFrame

        low, high = self.extremes(2)
        rows = {
            "family": self.family,
            **self.parameters,
            "duration [deg]": 2 * self.half_duration / DEG,
            "maximum lift [mm]": self.max_lift / MM,
            "area [mm deg]": self.area / (MM * DEG),
            "acceleration [mm/deg²]": f"{low / MM_PER_DEG2:.5g} to {high / MM_PER_DEG2:.5g}",
            "jerk [mm/deg³], at most": np.abs(self.extremes(3)).max() / MM_PER_DEG3,
        }
        return DataFrame([rows.keys(), rows.values()]).T.to_html(
            index=False, header=False, float_format="{:.6g}".format
        )

    def shifted(self, error: "Lift") -> "Lift":
        """This lift plus a small lift `error` (a grinding error), on the borders of both."""
        borders = without_narrow(np.union1d(self.borders, error.borders))
        middles = 0.5 * (borders[1:] + borders[:-1])
        width = max(self.coefficients.shape[1], error.coefficients.shape[1])
        total = np.zeros((len(middles), width))
        for law in (self, error):
            piece = np.searchsorted(law.borders, middles) - 1
            total[:, : law.coefficients.shape[1]] += recentred(law, piece, borders[:-1])
        return Lift(borders, total, self.half_duration, self.family, self.parameters)


def without_narrow(borders: np.ndarray) -> np.ndarray:
    """Borders from -pi on without those of pieces that are only as wide as a rounding error."""
    remaining = borders[np.append(np.diff(borders) > APART, True)]
    remaining[0] = -np.pi
    return remaining


def steps_at_borders(borders, coefficients) -> Any:
    """Largest steps of lift [m] and velocity [m/rad] (2) between successive pieces of a turn; in NumPy or JAX."""
    xp = coefficients.__array_namespace__()
    widths, order = xp.diff(borders)[:, None], np.arange(coefficients.shape[1])
    lift = xp.sum(coefficients * widths**order, axis=1)
    velocity = xp.sum(coefficients[:, 1:] * order[1:] * widths ** order[:-1], axis=1)
    return xp.stack([abs(end - xp.roll(coefficients[:, k], -1)).max() for k, end in enumerate((lift, velocity))])


def permitted_steps(cam: Lift) -> np.ndarray:
    """Steps of lift [m] and velocity [m/rad] (2) permitted to pieces that replace a cam's: its own plus rounding."""
    return steps_at_borders(cam.borders, cam.coefficients) + JOINING * np.abs(cam.coefficients[:, :2]).max(axis=0)


def lift_with(cam: Lift, numbers: Mapping[str, Any]) -> Lift:
    """The cam with its "lift" (p, q) [m/rad^k], "borders" (p + 1) [rad] and "half_duration" [rad] replaced by those in
    `numbers`. Raises InputError for borders that do not ascend from -pi to pi, or pieces that join less well than
    those."""
    names = {"lift": "coefficients", "borders": "borders", "half_duration": "half_duration"}
    changes: dict[str, Any] = {
        field: np.asarray(numbers[name], float) for name, field in names.items() if name in numbers
    }
    if not changes:
        return cam
    try:
        lift = replace(cam, **changes)
    except ValueError as error:
        raise InputError(f"lift: {error}") from error
    if np.any(steps_at_borders(lift.borders, lift.coefficients) > permitted_steps(cam)):
        raise InputError(
            "lift: the pieces do not join at the borders of the cam: where these move, give the borders of the pieces "
            "too, as motion_parameters of a differentiable cam does"
        )
    return lift


def with_ramps(borders, coefficients, opening: Ramp, closing: Ramp, family: str, parameters: dict) -> Lift:
    """The cam of an event, whose borders (p + 1) run from -half to +half duration [rad], with ramps and base circle.
    Raises InputError for a ramp that is lower than the rise of its foot, and for ramps longer than the base circle."""
    for name, ramp in (("opening", opening), ("closing", closing)):
        foot_rise = 0.5 * ramp.velocity * ramp.foot
        if ramp.height < foot_rise * (1 - ROUNDING):
            raise InputError(
                f"{family}: the {name} ramp's height is {ramp.height / MM:.4g} mm and must not be less than the "
                f"{foot_rise / MM:.4g} mm that its foot rises by (velocity times half the foot)"
            )
    turn = opening.length + closing.length + float(borders[-1] - borders[0])
    if max(opening.length - borders[0], closing.length + borders[-1]) >= np.pi:
        raise InputError(
            f"{family}: duration and ramps together take {turn / DEG:.4g} cam degrees and reach past half a turn: "
            f"give lower or faster ramps, or a shorter duration"
        )
    edges, pieces = whole_turn(np.asarray(borders), np.asarray(coefficients), opening, closing)
    keep = np.diff(edges) > 0  # a ramp without foot leaves an empty piece
    return Lift(edges[np.append(keep, True)], pieces[keep], float(borders[-1]), family, parameters)


def whole_turn(borders, coefficients, opening: Ramp, closing: Ramp) -> tuple[np.ndarray, np.ndarray]:
    """Borders and pieces from -pi to pi of an event between ramps, for arrays of NumPy or JAX; pieces may be empty."""
    xp = coefficients.__array_namespace__()
    width = max(7, coefficients.shape[1])
    up_borders, up = opening.opening_pieces(borders[0], xp)
    mirrored, down = closing.opening_pieces(-borders[-1], xp)
    down_borders = -mirrored[::-1]
    down = mirrored_pieces(down, xp.diff(mirrored))
    base_circle = np.zeros((1, width))
    parts = [xp.pad(c, ((0, 0), (0, width - c.shape[1]))) for c in (up, coefficients, down)]
    edges = xp.concatenate([np.array([-np.pi]), up_borders, borders[1:-1], down_borders, np.array([np.pi])])
    return edges, xp.concatenate([base_circle, *parts, base_circle])


def mirrored_pieces(coefficients, widths) -> np.ndarray:
    """Coefficients (p, q) of lift(-theta), its pieces in ascending order, from those of lift and their widths (p)."""
    xp = coefficients.__array_namespace__()
    k = np.arange(coefficients.shape[1])
    binomial = np.array([[comb(i, j) * (-1.0) ** j for i in k] for j in k])  # of p(width - u), by the binomial theorem
    widths = widths[::-1, None, None] ** np.maximum(k - k[:, None], 0)
    return xp.einsum("pjk,pk->pj", binomial * widths, coefficients[::-1])


def lift_table(lift: Lift, step_deg: float) -> dict[str, np.ndarray]:
    """Columns of `lift.csv`: angle from -180 to 180 deg and the lift's first three derivatives in mm and deg."""
    degrees = angles_deg(step_deg)
    names = ("lift_mm", "velocity_mm_per_deg", "acceleration_mm_per_deg2", "jerk_mm_per_deg3")
    columns = {n: lift(degrees * DEG, k) / MM * DEG**k for k, n in enumerate(names)}
    return {"cam_angle_deg": degrees, **columns}


def angles_deg(step_deg: float) -> np.ndarray:
    """Cam angles from -180 to 180 deg; those with few decimals are rounded to them, without the error of a binary step.
    Raises InputError for a step that does not divide the turn."""
    count = round(360 / step_deg) if 180 / MOST_ROWS < step_deg <= 360 else 0
    if not 1 <= count <= MOST_ROWS or abs(count * step_deg - 360) > 1e-9 * count:
        raise InputError(f"lift table: step {step_deg} deg: a step that divides 360 deg, 0.001 or more, is needed")
    degrees = np.linspace(-180.0, 180.0, count + 1)
    short = np.round(degrees, 9)
    return np.where(np.abs(short - degrees) < 1e-12, short, degrees)  # a few units in the last place at 180
