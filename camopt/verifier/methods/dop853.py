"""DOP853, order 8 (Hairer, Norsett, Wanner 1993; SciPy's), with every switching of a contact located as a root.

A contact is apart, pushing, or pressed without force. Between switchings the motion is smooth; each ends an integration
and starts the next one. With u the compression beyond the touch and f = p + c u':

    apart -> pushing     where u rises through zero (the force jumps by c u')
    pushing -> pressed   where f falls through zero; without damping that is the touch, and the contact is apart
    pressed -> pushing   where f rises through zero
    pressed -> apart     where u falls through zero

The method takes every elastic law of a scene. The steps per revolution decide how often the motion is recorded and how
often it is searched for switchings. They also decide the relative error permitted, which is the cube of the step [rad].
"""

from bisect import bisect_right
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853
from scipy.interpolate import PPoly
from scipy.optimize import root_scalar

from camopt.cam.lift import Lift
from camopt.scene.errors import MotionRefused
from camopt.scene.response import Response, Revolve
from camopt.scene.train import Train

APART, PRESSED, PUSHING = range(3)
U, F = range(2)
LEAST_ERROR = 1e-12
FLOORS = 1e-3, 1.0
"""Length [m] and velocity [m/s] to which the permitted error relates where the motion itself is smaller."""
MOST_SWITCHINGS = 20_000
"""A motion with more contact switchings than this in one revolution is refused as chatter."""
ROOT = 1e-18
"""Accuracy with which the time of a switching is located [s], besides the rounding of the time itself."""
FAR = 10.0
"""The last stiffness of a table is continued up to this compression [m] beyond the table's ends."""


def prepare(train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int) -> Revolve:
    """One revolution as a function of its start state (2n: positions [m], velocities [m/s]); any elastic laws.

    `cam_speed` [rad/s]. The response has steps_per_revolution + 1 samples and two at every switching, before and after
    it. Raises MotionRefused for endless switching, or where no step meets the permitted error.
    """
    motion = _Motion(train, lift, cam_speed)
    grid = np.linspace(0.0, 2 * np.pi / cam_speed, steps_per_revolution + 1)
    error = max((2 * np.pi / steps_per_revolution) ** 3, LEAST_ERROR)

    def revolve(state: np.ndarray) -> Response:
        t, y = 0.0, np.asarray(state, dtype=float)
        phases, parts = motion.phases(y), []
        while t < grid[-1]:
            part, switched = motion.until_switching(t, y, phases, grid, error)
            parts.append(part)
            t, y, phases = part[0][-1], part[1][-1], phases | switched
            if len(parts) > MOST_SWITCHINGS:
                raise MotionRefused(
                    f"DOP853 at {cam_speed * 30 / np.pi:g} cam r/min: contacts switch more than {MOST_SWITCHINGS} "
                    f"times in one revolution: give the contacts damping, or check masses and stiffnesses"
                )
        time, states, force = (np.concatenate([p[i] for p in parts]) for i in range(3))
        angle = time * cam_speed - np.pi
        angle[-1] = np.pi
        n = len(train.mass)
        return Response(train, cam_speed, angle, lift(angle), states[:, :n], states[:, n:], force)

    return revolve


class Switching(NamedTuple):
    """A contact enters `phase` where sign * surface rises through zero.

    The surface U is the compression beyond the touch, F is p + c d'.
    """

    element: int
    surface: int
    sign: float
    phase: int


class _Motion:
    """Equations of motion of a train at one speed; states in columns (2n, m), elements in rows (e, m)."""

    def __init__(self, train: Train, lift: Lift, cam_speed: float):
        n = len(train.mass)
        self.cam_speed, self.lift = cam_speed, lift
        self.borders, self.coefficients = lift.borders.tolist(), lift.coefficients[:, ::-1].tolist()
        self.floors = np.repeat(FLOORS, n)
        mass = np.arange(n)
        self.rows = 1.0 * (train.a[:, None] == mass) - 1.0 * (train.b[:, None] == mass)
        elements = train.cam_driven, train.gap, train.damping
        self.driven, self.gap, self.damping = (np.array(q, dtype=float)[:, None] for q in elements)
        self.contacts = np.flatnonzero(train.contact)
        self.mass, self.drag, self.load = train.mass, train.mass_damping, train.mass_force
        self.elastic = _Elastic(train)

    def elements(self, y: np.ndarray, lift, lift_rate) -> tuple[np.ndarray, np.ndarray]:
        """Compression beyond the touch [m] and p + c d' [N] in states y (2n, m), each (e, m)."""
        n = len(self.mass)
        d = self.rows @ y[:n] + self.driven * lift - self.gap
        damper = self.damping * (self.rows @ y[n:] + self.driven * lift_rate)
        return d - self.elastic.touch, self.elastic.force(d) + damper

    def cam(self, t: float) -> tuple[float, float]:
        """Lift [m] and its rate [m/s] at a time [s]."""
        theta = t * self.cam_speed - np.pi
        i = min(max(bisect_right(self.borders, theta) - 1, 0), len(self.coefficients) - 1)
        s, lift, slope = theta - self.borders[i], 0.0, 0.0
        for c in self.coefficients[i]:
            slope = slope * s + lift
            lift = lift * s + c
        return lift, slope * self.cam_speed

    def phases(self, y: np.ndarray) -> dict[int, int]:
        """Phase of every contact in a state (2n) at -180 degrees."""
        u, f = self.elements(y[:, None], *self.cam(0.0))
        return {int(e): APART if u[e] <= 0 else PUSHING if f[e] > 0 else PRESSED for e in self.contacts}

    def switchings(self, phases: dict[int, int]) -> list[Switching]:
        """The switchings that each contact may make next."""
        found = []
        for e, phase in phases.items():
            if phase == APART:
                found.append(Switching(e, U, 1.0, PUSHING))
            elif phase == PRESSED:
                found += [Switching(e, F, 1.0, PUSHING), Switching(e, U, -1.0, APART)]
            elif self.damping[e, 0] > 0:
                found.append(Switching(e, F, -1.0, PRESSED))
            else:
                found.append(Switching(e, U, -1.0, APART))
        return found

    def until_switching(self, t: float, y: np.ndarray, phases: dict[int, int], grid: np.ndarray, error: float):
        """Integrates from t to the first switching or to the end of `grid`.

        Returns times (k), states (k, 2n), forces (k, e) and the phase that begins at the end.
        """
        n, acts = len(self.mass), np.array([phases.get(e, PUSHING) == PUSHING for e in range(len(self.rows))])
        watched = self.switchings(phases)

        def rate(t, y):
            force = acts * self.elements(y[:, None], *self.cam(t))[F][:, 0]
            return np.concatenate([y[n:], (self.load - self.drag * y[n:] - force @ self.rows) / self.mass])

        floors: Any = error * self.floors  # SciPy takes an array here, its stubs do not say so
        solver = DOP853(rate, t, y, grid[-1], max_step=grid[-1] / 360, rtol=error, atol=floors)
        times, states, after = [np.array([t])], [y[:, None]], None
        while solver.status == "running" and after is None:
            solver.step()
            if solver.status == "failed":
                raise MotionRefused("DOP853: no step meets the permitted error: check masses and stiffnesses")
            assert solver.t_old is not None, "a step was taken"
            reached = slice(*np.searchsorted(grid, [solver.t_old, solver.t], "right"))
            dense, inside = solver.dense_output(), grid[reached]
            end, after = self._first(dense, np.array([solver.t_old, *inside, solver.t]), watched, solver.t_old == t)
            if after is not None or solver.status == "finished":
                inside = np.append(inside[inside < end], end)
            times.append(inside)
            states.append(dense(inside))
        time, state = np.concatenate(times), np.concatenate(states, axis=1)
        force = np.where(acts[:, None], self._elements_at(time, state)[F], 0.0)
        force[self.contacts] = np.maximum(force[self.contacts], 0.0)  # a switching is located to round-off
        return (time, state.T, force.T), {} if after is None else after

    def _elements_at(self, time: np.ndarray, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        theta = time * self.cam_speed - np.pi
        return self.elements(state, self.lift(theta), self.lift(theta, 1) * self.cam_speed)

    def _first(self, dense, look: np.ndarray, watched: list[Switching], begins: bool):
        """The time of the first switching within a step, and the phase that it begins (contact -> phase).

        The step is examined at the times `look`. Where it has no switching, its end and None are returned. Where a
        phase begins, round-off may already have put a surface beyond its zero; if it moves on from there, the switching
        is at the beginning.
        """
        found = self._elements_at(look, dense(look))
        time, after = look[-1], None
        for w in watched:
            g = w.sign * found[w.surface][w.element]
            crossed = (g[1:] > 0) & (g[:-1] <= 0)
            crossed[0] |= begins and 0 < g[0] < g[1]
            if not crossed.any():
                continue
            i = int(np.argmax(crossed))

            def surface(t, w=w):
                return w.sign * self.elements(dense(t)[:, None], *self.cam(t))[w.surface][w.element, 0]

            at = look[i]
            if surface(at) < 0:
                at = root_scalar(surface, bracket=(at, look[i + 1]), xtol=ROOT).root
            if at < time or after is None:
                time, after = at, {w.element: w.phase}
        return time, after


class _Elastic:
    """Touch (e, 1) and elastic force of every element, from the train's numbers alone."""

    def __init__(self, train: Train):
        self.stiffness, self.preload = train.stiffness[:, None], train.preload[:, None]
        self.touch = -self.preload / self.stiffness
        self.hertz, self.tables = np.zeros(0, dtype=int), {}
        if train.laws is None:
            return
        self.hertz = np.flatnonzero(train.laws.kind == 1)
        self.coefficient, self.exponent = (q[self.hertz, None] for q in (train.laws.coefficient, train.laws.exponent))
        self.touch[self.hertz] = -((self.preload[self.hertz] / self.coefficient) ** (1 / self.exponent))
        for e in np.flatnonzero(train.laws.kind == 2):
            c, k = train.laws.table[e].T
            c, k = np.array([c[0] - FAR, *c, c[-1] + FAR]), np.array([k[0], *k, k[-1]])
            work = PPoly(np.stack([np.diff(k) / np.diff(c), k[:-1]]), c).antiderivative()
            work.c[-1] += train.preload[e] - work(0.0)
            self.tables[int(e)] = work
            self.touch[e] = work.roots(extrapolate=False)

    def force(self, d: np.ndarray) -> np.ndarray:
        """Elastic force [N] at compressions d (e, m) [m].

        That of a hertz contact is continued as an odd function about its touch, so that it is smooth enough to locate a
        root across it.
        """
        force = self.preload + self.stiffness * d
        u = d[self.hertz] - self.touch[self.hertz]
        force[self.hertz] = self.coefficient * np.sign(u) * np.abs(u) ** self.exponent if len(self.hertz) else u
        for e, work in self.tables.items():
            force[e] = work(d[e])
        return force
