"""A sampled motion as a piecewise cubic through values and slopes, so that extremes and roots need no fine step."""

from functools import cached_property

import numpy as np

from camopt.measure.cubics import sign_changes, with_stationary_points
from camopt.scene.shapes import Float


class Hermite:
    """Cubic Hermite interpolant of values `y` with slopes `slope` (per rad) at ascending angles [rad].

    One of two samples at the same angle is dropped, because position and velocity are continuous where a force jumps.
    SciPy's CubicHermiteSpline has no extremes, and its `roots` do not distinguish rising from falling.
    """

    def __init__(self, angle: Float[np.ndarray, " k"], y: Float[np.ndarray, " k"], slope: Float[np.ndarray, " k"]):
        keep = np.append(np.diff(angle) > 0, True)
        self.angle, y, slope = angle[keep], y[keep], slope[keep]
        self.step = np.diff(self.angle)
        rise, m0, m1 = np.diff(y), slope[:-1] * self.step, slope[1:] * self.step
        self.c = np.stack([y[:-1], m0, 3 * rise - 2 * m0 - m1, m0 + m1 - 2 * rise])  # in powers of u = 0 to 1
        self.y = y
        self._knots = with_stationary_points(self.angle, self.y, self.step, self.c)

    def __call__(self, angle) -> np.ndarray | np.floating:
        """Value at angles [rad]."""
        i, u = self._locate(angle)
        c = self.c[:, i]
        return c[0] + u * (c[1] + u * (c[2] + u * c[3]))

    def slope(self, angle) -> np.ndarray | np.floating:
        """Derivative with respect to the angle, at angles [rad]."""
        i, u = self._locate(angle)
        c = self.c[:, i]
        return (c[1] + u * (2 * c[2] + 3 * u * c[3])) / self.step[i]

    def maximum(self, low: float, high: float) -> float:
        """Largest value over [low, high]."""
        angle, value = self._knots
        inside = value[np.searchsorted(angle, low, "right") : np.searchsorted(angle, high, "left")]
        return float(max(self(low), self(high), np.max(inside, initial=-np.inf)))

    def falls_through_zero(self, low: float, high: float) -> Float[np.ndarray, " m"]:
        """Angles in [low, high] at which the value falls from above zero to zero or below."""
        roots, falling = self._roots
        return roots[falling & (roots >= low) & (roots <= high)]

    def positive_spans(self, low: float, high: float) -> Float[np.ndarray, "m 2"]:
        """Intervals of angles (m, 2) within [low, high] in which the value is positive."""
        roots, _ = self._roots
        inside = roots[(roots > low) & (roots < high)]
        borders = np.concatenate([[low], inside, [high]])
        spans = np.stack([borders[:-1], borders[1:]], axis=1)
        return spans[self(spans.mean(axis=1)) > 0]

    def integral(self, low, high) -> np.ndarray | np.floating:
        """Integral from `low` to `high` [rad], which may be arrays of any shape."""
        total = np.concatenate([[0.0], np.cumsum(self._partial(slice(None), 1.0))])
        (i, u), (j, w) = self._locate(low), self._locate(high)
        return total[j] + self._partial(j, w) - total[i] - self._partial(i, u)

    def _locate(self, angle):
        i = np.clip(np.searchsorted(self.angle, angle, "right") - 1, 0, len(self.step) - 1)
        return i, (angle - self.angle[i]) / self.step[i]

    def _partial(self, i, u):
        c = self.c[:, i]
        return self.step[i] * u * (c[0] + u * (c[1] / 2 + u * (c[2] / 3 + u * c[3] / 4)))

    @cached_property
    def _roots(self) -> tuple[np.ndarray, np.ndarray]:
        """Angles at which the sign changes, and whether the value falls there; between knots the cubic is monotone."""
        return sign_changes(self.angle, self.step, self.c, *self._knots)
