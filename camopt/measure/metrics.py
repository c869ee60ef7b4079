"""The metrics of a recorded motion (docs/model.md): one value per revolution, from piecewise cubics in NumPy.

The seat force becomes positive where the signed distance s falls through zero, since from there on the closing contact
is compressed and pushes. The touch is therefore the root of s, not the first sample with a positive force.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.hermite import Hermite
from camopt.scene.quantities import QUANTITIES
from camopt.scene.response import Response
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM

TURN = 2 * np.pi
SERIES = ("angle", "lift", "x", "v", "force", "memory")
BEYOND = 3
"""Additional samples beyond each end of a span for its curves, which drop one of two samples at the same angle."""


def measure(response: Response, lift: Lift) -> dict[str, Float[np.ndarray, " revolutions"]]:
    """Every metric of `camopt.scene.quantities.QUANTITIES` for all revolutions of a record except the last.

    The window of a revolution in which the valve is closed extends into the next revolution, up to the opening foot of
    its event. Bounce, seating and impact velocity are NaN if the valve left its seat and has not touched it again by
    then ("never seats"), and zero if it never left the seat. Excess lift is negative if the valve always stays below
    its kinematic lift, max(0, cam lift - lash). Raises ValueError for a record shorter than two revolutions.
    """
    if response.revolutions < 2:
        raise ValueError("metrics need a record of two revolutions or more: a bounce window runs into the next one")
    motion = _Curves((response,), lift)
    rows = [motion.revolution(TURN * r) for r in range(response.revolutions - 1)]
    return {name: np.array([row[name] for row in rows]) for name in QUANTITIES}


def measure_first(response: Response, after: Response, lift: Lift) -> dict[str, Float[np.ndarray, " 1"]]:
    """The metrics of a revolution, as by `measure` on the record of the revolution and the next one, `after`.

    That record is not built; of `after` only the bounce window is used.
    """
    window = slice(np.searchsorted(after.angle, lift.opening_foot, "right") + BEYOND)
    after = replace(after, **{name: getattr(after, name)[window] for name in SERIES})
    return {name: np.array([value]) for name, value in _Curves((response, after), lift).revolution(0.0).items()}


class _Curves:
    """A record as piecewise cubics over the cam angle: distance from the seat and, within one revolution, contact gaps
    and lift above the lash. The record has consecutive parts, each a whole revolution except possibly the last."""

    def __init__(self, parts: tuple[Response, ...], lift: Lift):
        train, self.speed, self.lift = parts[0].train, parts[0].cam_speed, lift
        self.train, self.lash, oil = train, train.lash, [train.memory.index(e) for e in train.adjusters]

        def whole(series: Callable[[Response], np.ndarray]) -> np.ndarray:
            return np.concatenate([series(part) for part in parts])

        self.angle = np.concatenate([part.angle + TURN * i for i, part in enumerate(parts)])
        self.shortening = whole(lambda part: part.memory[:, oil].sum(axis=1)) if oil else None
        self.forces = whole(lambda part: part.force[:, list(train.cam_side)])
        self.cam, self.cam_rate = whole(lambda part: part.lift), lift(self.angle, 1)
        self.s, self.s_rate = whole(Response.seat_separation), whole(lambda part: part.v[:, train.valve] / self.speed)
        self.seat = Hermite(self.angle, self.s, self.s_rate)
        self.gaps = [
            (
                whole(lambda part, e=e: part.gap(e)),
                -(whole(lambda part, e=e: part.across(part.v, e, self.speed)) + train.cam_driven[e] * self.cam_rate),
            )
            for e in train.cam_side
        ]

    def _within(self, low: float, high: float) -> slice:
        """The samples on which curves over [low, high] depend."""
        first, last = np.searchsorted(self.angle, low, "right"), np.searchsorted(self.angle, high, "right")
        return slice(max(0, first - BEYOND), last + BEYOND)

    def revolution(self, nose: float) -> dict[str, float]:
        """Metrics of the revolution whose nose is at the angle `nose` [rad], in the units of their names."""
        start, end, half = nose - np.pi, nose + np.pi, self.lift.half_duration
        event = nose - half, nose + half
        at = self._within(*event)
        gaps = [Hermite(self.angle[at], gap[at], rate[at]) for gap, rate in self.gaps]
        open_spans = [gap.positive_spans(*event) for gap in gaps]
        forces = [_force_extremes(self.angle, f, *event) for f in self.forces.T]
        spans = self.seat.positive_spans(start, end)
        return {
            **self._closing(nose),
            "jump_mm": max(0.0, *(gap.maximum(*event) for gap in gaps)) / MM,
            "jump_deg": max(float(np.sum(s[:, 1] - s[:, 0])) for s in open_spans) / DEG,
            "contact_force_min_N": min(low for low, _ in forces),
            "contact_force_max_N": max(high for _, high in forces),
            "dynamic_area_mm_deg": float(np.sum(self.seat.integral(spans[:, 0], spans[:, 1]))) / (MM * DEG),
            "excess_lift_mm": self._excess_lift(start, end) / MM,
        }

    def _closing(self, nose: float) -> dict[str, float]:
        """Bounce, seating and impact velocity."""
        names = "bounce_mm", "seating_velocity_m_per_s", "impact_velocity_m_per_s"
        inside = np.flatnonzero((self.seat.angle >= nose - np.pi) & (self.seat.angle <= nose + np.pi))
        peak = inside[np.argmax(self.seat.y[inside])]
        foot = nose + TURN + self.lift.opening_foot
        if self.seat.y[peak] <= 0:
            return dict.fromkeys(names, 0.0)
        touches = self.seat.falls_through_zero(float(self.seat.angle[peak]), foot)
        if len(touches) == 0:
            return dict.fromkeys(names, np.nan)
        start = min(touches[0], nose + self._nominal_closing(nose, touches[0]))
        impacts = np.abs(self.seat.slope(self.seat.falls_through_zero(start, foot))) * self.speed
        bounce = max((self.seat.maximum(*hop) for hop in self.seat.positive_spans(start, foot)), default=0.0) / MM
        seating = abs(float(self.seat.slope(touches[0]))) * self.speed
        return dict(zip(names, (bounce, seating, float(np.max(impacts))), strict=True))

    def _nominal_closing(self, nose: float, touch: float) -> float:
        """Angle from the nose [rad] at which the lift has fallen to the lash plus the length that the adjusters have
        lost by leakage from the opening foot to the touch."""
        if self.shortening is None:
            return _closing_angle(self.lift, self.lash)
        before, after = np.interp([nose + self.lift.opening_foot, touch], self.angle, self.shortening)
        return self.lift.closing_angle(self.lash + max(0.0, after - before))

    def _excess_lift(self, start: float, end: float) -> float:
        """Largest s - max(0, lift - lash) [m], taken separately where the lift is above and below the lash."""
        at = self._within(start, end)
        angle, s, cam = self.angle[at], self.s[at], self.cam[at]
        above_lash = Hermite(angle, cam - self.lash, self.cam_rate[at])
        excess = Hermite(angle, s - cam + self.lash, self.s_rate[at] - self.cam_rate[at])
        lifted = above_lash.positive_spans(start, end)
        seated = np.concatenate([[start], lifted.ravel(), [end]]).reshape(-1, 2)
        best = [excess.maximum(*span) for span in lifted]
        return max(best + [self.seat.maximum(*span) for span in seated])


@lru_cache(maxsize=64)
def _closing_angle(lift: Lift, lash: float) -> float:
    """Angle from the nose [rad] at which the lift has fallen to the lash [m]: the same at every speed."""
    return lift.closing_angle(lash)


def _force_extremes(angle: np.ndarray, force: np.ndarray, low: float, high: float) -> tuple[float, float]:
    """Smallest and largest force over [low, high]; an extreme sample is replaced by the vertex of a parabola about it.

    Parabolas are fitted only to forces above zero, because a contact's force jumps from zero where it closes.
    """
    first, last = np.searchsorted(angle, low, "left"), np.searchsorted(angle, high, "right")
    inside = force[first:last]
    ends = np.interp([low, high], angle, force)
    return (
        float(min(*ends, _vertex(angle, force, int(first + np.argmin(inside)), low, high))),
        float(max(*ends, _vertex(angle, force, int(first + np.argmax(inside)), low, high))),
    )


def _vertex(angle: np.ndarray, force: np.ndarray, k: int, low: float, high: float) -> float:
    """Extreme of the parabola through samples k - 1, k, k + 1, or sample k if it has no extreme between them."""
    if not (0 < k < len(angle) - 1 and np.all(np.diff(angle[k - 1 : k + 2]) > 0) and np.all(force[k - 1 : k + 2] > 0)):
        return force[k]
    before, after = np.diff(force[k - 1 : k + 2]) / np.diff(angle[k - 1 : k + 2])
    if before * after >= 0:
        return force[k]
    curvature = (after - before) / (angle[k + 1] - angle[k - 1])
    slope = before + curvature * (angle[k] - angle[k - 1])
    shift = -slope / (2 * curvature)
    return force[k] - slope**2 / (4 * curvature) if low <= angle[k] + shift <= high else force[k]
