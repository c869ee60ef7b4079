"""A second reading of every declared metric, from the raw motion of `raw_motion`: formulas of its own.

Written from the text "The metrics" of docs/model.md and from nothing else: what `camopt.measure` and `camopt.exact`
compute from samples and from power series is read here from the integrator's dense output and from the instants at
which it located the switchings.
"""

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from tests.measure.raw_motion import APART, PUSHING, TURN, Equations, Stretch

BETWEEN = 4
"""Looks per step of the integrator in search of an extreme, which is then polished between its neighbours."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)
MM, DEG = 1e-3, np.pi / 180


class Reading:
    """The first revolution of a raw motion that reaches to the next event's opening foot: `figures` by name."""

    def __init__(self, equations: Equations, stretches: list[Stretch]):
        scene = equations.scene
        names = [e.name for e in scene.element]
        self.equations, self.stretches = equations, stretches
        self.seat = names.index(scene.seat)
        self.cam_side = [
            i
            for i, e in enumerate(scene.element)
            if e.kind == "contact" and (e.cam_driven or "ground" not in e.between)
        ]
        self.lash = sum(equations.gap[i] for i in self.cam_side)
        self.half = 0.5 * scene.design.duration_deg * DEG

    def time(self, angle: float) -> float:
        return (angle + np.pi) / self.equations.omega

    def at(self, stretch: Stretch, t):
        """(compressions beyond the touch, forces of acting elements, lift, state) at times (m)."""
        t = np.atleast_1d(t)
        y = stretch.motion(t)
        cam = np.array([self.equations.cam(stretch.piece, u) for u in t]).T
        return *self.equations.surfaces(y, *cam)[:2], cam[0], y

    def opening_foot(self) -> float:
        """The angle at which the lift leaves zero [rad]."""
        grid = np.linspace(-np.pi, 0.0, 20_001)
        above = int(np.argmax(self.equations.lift(grid) > 0))
        low, high = grid[above - 1], grid[above]
        while high - low > 1e-14:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.equations.lift(middle) > 0 else (middle, high)
        return high

    def leaked(self, touch: float) -> float:
        """By how much adjusters between masses are shorter at the time of the touch than at the opening foot [m]."""
        equations, ends = self.equations, []
        for t in (self.time(self.opening_foot()), touch):
            stretch = next(s for s in self.stretches if s.begin <= t <= s.end)
            ends.append(stretch.motion(t)[2 * len(equations.mass) :])
        way = [equations.scene.element[i].kind == "adjuster" for i in equations.memory]
        return max(0.0, float(np.dot(ends[1] - ends[0], way)))

    def nominal_closing(self, touch: float) -> float:
        """The angle at which the lift has fallen, on the closing side, to the lash and what adjusters leaked [rad]."""
        grid, level = np.linspace(0.0, np.pi, 20_001), self.lash + self.leaked(touch)
        last = int(np.flatnonzero(self.equations.lift(grid) > level)[-1])
        return brentq(lambda angle: float(self.equations.lift(angle)) - level, grid[last], grid[last + 1])

    def largest(self, value, low: float, high: float, phase: tuple[int, int] | None = None) -> float:
        """Largest `value(stretch, times)` between two angles [rad], in stretches in which a contact has a phase."""
        best = -np.inf
        for stretch in self.stretches:
            begin, end = max(stretch.begin, self.time(low)), min(stretch.end, self.time(high))
            if end <= begin or (phase is not None and stretch.phase[phase[0]] != phase[1]):
                continue
            knots = np.unique(np.clip(stretch.steps, begin, end))
            times = np.append((knots[:-1, None] + np.diff(knots)[:, None] * np.arange(BETWEEN) / BETWEEN).ravel(), end)
            values = value(stretch, times)
            top = int(np.argmax(values))
            best = max(best, values[top])
            if 0 < top < len(times) - 1:
                polished = minimize_scalar(
                    lambda t, s=stretch: -value(s, t)[0],
                    bounds=(times[top - 1], times[top + 1]),
                    method="bounded",
                    options={"xatol": 1e-12},
                )
                best = max(best, -polished.fun)
        return float(best)

    def distance(self, stretch: Stretch, t):
        """Distance s of the valve from where its seat touches [m]."""
        return -self.at(stretch, t)[0][self.seat]

    def closings(self) -> list[tuple[float, float]]:
        """(time, approach speed) at which the seat begins to push after it was apart."""
        found = []
        for before, after in zip(self.stretches[:-1], self.stretches[1:], strict=True):
            if before.phase[self.seat] == APART and after.phase[self.seat] == PUSHING:
                n = len(self.equations.mass)
                velocities = after.motion(after.begin)[n : 2 * n]
                found.append((after.begin, float(self.equations.rows[self.seat] @ velocities)))
        return found

    def figures(self) -> dict[str, float]:
        """Every declared metric, in the unit of its name."""
        return {**self._seat(), **self._contacts(), **self._revolution()}

    def _seat(self) -> dict[str, float]:
        names = "bounce_mm", "seating_velocity_m_per_s", "impact_velocity_m_per_s"
        highest, when = self._greatest_lift()
        if highest <= 0:
            return dict.fromkeys(names, 0.0)
        foot = TURN + self.opening_foot()
        later = [(t, v) for t, v in self.closings() if when < t <= self.time(foot)]
        if not later:
            return dict.fromkeys(names, np.nan)
        start = min(later[0][0], self.time(self.nominal_closing(later[0][0])))
        bounce = self.largest(self.distance, start * self.equations.omega - np.pi, foot)
        impacts = [v for t, v in later if t >= start]
        return dict(zip(names, (max(0.0, bounce) / MM, abs(later[0][1]), max(impacts)), strict=True))

    def _greatest_lift(self) -> tuple[float, float]:
        """(s [m], time) where the valve is highest in the revolution; the time to an integrator's step."""
        inside = [s for s in self.stretches if s.begin < self.time(np.pi)]
        peaks = []
        for stretch in inside:
            times = stretch.steps[stretch.steps <= self.time(np.pi)]
            s = self.distance(stretch, times)
            peaks.append((float(s.max()), float(times[np.argmax(s)])))
        return max(peaks)

    def _contacts(self) -> dict[str, float]:
        low, high = -self.half, self.half
        jump = [self.largest(lambda s, t, e=e: -self.at(s, t)[0][e], low, high) for e in self.cam_side]
        angle = [
            sum(
                max(0.0, min(s.end, self.time(high)) - max(s.begin, self.time(low)))
                for s in self.stretches
                if s.phase[e] == APART
            )
            * self.equations.omega
            for e in self.cam_side
        ]
        force = [self.largest(lambda s, t, e=e: self.at(s, t)[1][e], low, high, (e, PUSHING)) for e in self.cam_side]
        least = [-self.largest(lambda s, t, e=e: -self.at(s, t)[1][e], low, high, (e, PUSHING)) for e in self.cam_side]
        quiet = any(
            s.phase[e] != PUSHING and s.end > self.time(low) and s.begin < self.time(high)
            for s in self.stretches
            for e in self.cam_side
        )
        return {
            "jump_mm": max(0.0, *jump) / MM,
            "jump_deg": max(angle) / DEG,
            "contact_force_min_N": 0.0 if quiet else min(least),
            "contact_force_max_N": max(0.0, *force),
        }

    def _revolution(self) -> dict[str, float]:
        area = 0.0
        for stretch in self.stretches:
            if stretch.phase[self.seat] != APART or stretch.begin >= self.time(np.pi):
                continue
            knots = np.unique(np.minimum(stretch.steps, self.time(np.pi)))
            half, middle = 0.5 * np.diff(knots), 0.5 * (knots[1:] + knots[:-1])
            s = self.distance(stretch, (middle[:, None] + half[:, None] * NODES).ravel()).reshape(-1, len(NODES))
            area += float(np.sum(half * (s @ WEIGHTS))) * self.equations.omega

        def excess(stretch, t):
            beyond, _, lift, _ = self.at(stretch, t)
            return -beyond[self.seat] - np.maximum(0.0, lift - self.lash)

        return {
            "dynamic_area_mm_deg": area / (MM * DEG),
            "excess_lift_mm": self.largest(excess, -np.pi, np.pi) / MM,
        }
