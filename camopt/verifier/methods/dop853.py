"""DOP853, order 8 (Hairer, Norsett, Wanner 1993; SciPy's), with every switching of an element located as a root.

Between switchings the motion is smooth; each switching ends one integration and starts the next. A contact is apart,
pushing, or pressed without force; a table is on one of its rows; oil pushes, is without force while its check valve
shuts, or is refilled; friction sticks or slides (`of_dop853` defines the transitions between these phases). An
integration also ends at the corners of forces that are given over the cam angle.

The method implements every law of a scene. The steps per revolution determine how often the motion is recorded and
searched for switchings, and the permitted relative error, which is the cube of the step [rad].
"""

from bisect import bisect_right
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import root_scalar

from camopt.cam.lift import Lift
from camopt.scene.errors import MotionRefused
from camopt.scene.response import Response, Revolve
from camopt.scene.train import Train
from camopt.verifier.methods.of_dop853 import (
    APART,
    CONTACT,
    PRESSED,
    PUSHING,
    WRITTEN,
    Acting,
    F,
    Phases,
    PieceLaws,
    Switching,
)

LEAST_ERROR = 1e-12
"""Smallest permitted relative error."""
FLOORS = 1e-3, 1.0
"""Length [m] and velocity [m/s] to which the permitted error relates if the motion itself is smaller."""
MOST_SWITCHINGS = 20_000
"""Largest number of switchings in one revolution; a motion with more is refused as chatter."""
ROOT = 1e-18
"""Accuracy with which the time of a switching is located [s], besides the rounding of the time itself."""


def prepare(train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int) -> Revolve:
    """One revolution as a function of its start state (2n + r: [m], [m/s], memories [m]); any laws.

    `cam_speed` [rad/s]. The response has steps_per_revolution + 1 samples and two at every switching, before and after
    it. Raises MotionRefused if there are too many switchings, or if no step meets the permitted error.
    """
    train.require_kinds("DOP853", WRITTEN, "camopt/verifier/methods/of_dop853.py")
    motion = _Motion(train, lift, cam_speed)
    grid = np.linspace(0.0, 2 * np.pi / cam_speed, steps_per_revolution + 1)
    stops = motion.stops(grid[-1])
    error = max((2 * np.pi / steps_per_revolution) ** 3, LEAST_ERROR)

    def revolve(state: np.ndarray) -> Response:
        t, y = 0.0, np.asarray(state, dtype=float)
        phases, spans = motion.phases(y), []
        while t < grid[-1]:
            span, switched = motion.until_switching(t, y, phases, (grid, stops[bisect_right(stops, t)]), error)
            spans.append(span)
            t, y, phases = span[0][-1], span[1][-1], phases | switched
            if len(spans) > MOST_SWITCHINGS:
                raise MotionRefused(
                    f"DOP853 at {cam_speed * 30 / np.pi:g} cam r/min: contacts switch more than {MOST_SWITCHINGS} "
                    f"times in one revolution: give the contacts damping, or check masses and stiffnesses"
                )
        time, states, force = (np.concatenate([p[i] for p in spans]) for i in range(3))
        angle = time * cam_speed - np.pi
        angle[-1] = np.pi
        n = len(train.mass)
        x, v, z = np.split(states, [n, 2 * n], axis=1)
        return Response(train, cam_speed, angle, lift(angle), x, v, force, z)

    return revolve


class _Motion:
    """Equations of motion of a train at one speed; states in columns (2n + r, m), elements in rows (e, m)."""

    def __init__(self, train: Train, lift: Lift, cam_speed: float):
        n, self.memory = len(train.mass), list(train.memory)
        self.cam_speed, self.lift = cam_speed, lift
        self.borders, self.coefficients = lift.borders.tolist(), lift.coefficients[:, ::-1].tolist()
        self.floors = np.repeat((*FLOORS, FLOORS[0]), (n, n, len(self.memory)))
        mass = np.arange(n)
        self.rows = 1.0 * (train.a[:, None] == mass) - 1.0 * (train.b[:, None] == mass)
        elements = train.cam_driven, train.gap, train.damping
        self.driven, self.gap, self.damping = (np.array(q, dtype=float)[:, None] for q in elements)
        self.contacts = np.flatnonzero(train.contact)
        self.mass, self.drag, self.load = train.mass, train.mass_damping, train.mass_force
        self.laws, self.forcing = PieceLaws(train), train.forcing

    def stops(self, end: float) -> list[float]:
        """Times [s] at which an integration ends: the corners of the forces given over the cam angle, and `end`."""
        corners = {float((angle + np.pi) / self.cam_speed) for f in self.forcing for angle in f.angle}
        return [*sorted(t for t in corners if 0.0 < t < end), end]

    def compressions(self, y: np.ndarray, lift, lift_rate) -> tuple[np.ndarray, np.ndarray]:
        """Compressions (e, m) [m] and their rates (e, m) [m/s] in states y (2n + r, m)."""
        n = len(self.mass)
        d = self.rows @ y[:n] + self.driven * lift - self.gap
        return d, self.rows @ y[n : 2 * n] + self.driven * lift_rate

    def surfaces(self, y: np.ndarray, lift, lift_rate, acting: Acting) -> tuple[np.ndarray, ...]:
        """The surfaces that determine the switchings, `of_dop853.U` to SLACK, in states y (2n + r, m)."""
        n, (d, rate) = len(self.mass), self.compressions(y, lift, lift_rate)
        elastic = self.laws.force(d, y[2 * n :], acting)
        force = elastic + (self.damping + self.laws.dissipation * elastic) * rate
        return d - self.laws.touch, force, d, rate, d[self.memory] - y[2 * n :]

    def cam(self, t: float) -> tuple[float, float]:
        """Lift [m] and its rate [m/s] at a time [s]."""
        theta = t * self.cam_speed - np.pi
        i = min(max(bisect_right(self.borders, theta) - 1, 0), len(self.coefficients) - 1)
        s, lift, slope = theta - self.borders[i], 0.0, 0.0
        for c in self.coefficients[i]:
            slope = slope * s + lift
            lift = lift * s + c
        return lift, slope * self.cam_speed

    def given(self, begin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        """The given forces on the masses between two stops [s]: value at time zero (n) [N] and slope (n) [N/s]."""
        value, slope = self.load.copy(), np.zeros(len(self.load))
        for f in self.forcing:
            i = np.searchsorted(f.angle, 0.5 * (begin + end) * self.cam_speed - np.pi, "right") - 1
            by_angle = (f.force[i + 1] - f.force[i]) / (f.angle[i + 1] - f.angle[i])
            value[f.on] += f.force[i] + by_angle * (-np.pi - f.angle[i])
            slope[f.on] += by_angle * self.cam_speed
        return value, slope

    def phases(self, y: np.ndarray) -> Phases:
        """The phases of all elements in a state (2n + r) at -180 degrees."""
        cam = self.cam(0.0)
        d, rate = self.compressions(y[:, None], *cam)
        other_phases = self.laws.first_phases(d[:, 0], rate[:, 0], y[2 * len(self.mass) :])
        u, f, *_ = self.surfaces(y[:, None], *cam, self.laws.acting(other_phases))
        phases = {(int(e), CONTACT): APART if u[e] <= 0 else PUSHING if f[e] > 0 else PRESSED for e in self.contacts}
        return phases | other_phases

    def until_switching(self, t: float, y: np.ndarray, phases: Phases, targets: tuple[np.ndarray, float], error: float):
        """Integrate from t to the first switching or to the stop; `targets` are the times of all samples and the stop.

        Returns times (k), states (k, 2n + r) and forces (k, e), and the phase that begins at the end, by its key.
        """
        n, memory, (grid, stop) = len(self.mass), self.memory, targets
        acting = self.laws.acting(phases)
        watched = self.laws.switchings(phases, error * FLOORS[0], error * FLOORS[1])
        load, ramp = self.given(t, stop)
        if memory:
            d, _ = self.compressions(y[:, None], *self.cam(t))
            y = np.append(y[: 2 * n], self.laws.followed(d[:, 0], y[2 * n :], phases))

        floors: Any = error * self.floors  # SciPy accepts an array here, although its stubs do not
        rate = self.rate_with(acting, load, ramp)
        solver = DOP853(rate, t, y, stop, max_step=grid[-1] / 360, rtol=error, atol=floors)
        times, states, after = [np.array([t])], [y[:, None]], None
        while solver.status == "running" and after is None:
            solver.step()
            if solver.status == "failed":
                raise MotionRefused("DOP853: no step meets the permitted error: check masses and stiffnesses")
            assert solver.t_old is not None, "a step was taken"
            reached = slice(*np.searchsorted(grid, [solver.t_old, solver.t], "right"))
            dense, inside = solver.dense_output(), grid[reached]
            times_in_step = np.array([solver.t_old, *inside, solver.t])
            end, after = self._first(dense, times_in_step, (acting, watched), solver.t_old == t)
            if after is not None or solver.status == "finished":
                inside = np.append(inside[inside < end], end)
            times.append(inside)
            states.append(dense(inside))
        time, state = np.concatenate(times), np.concatenate(states, axis=1)
        force = np.where(acting.acts[:, None], self._surfaces_at(time, state, acting)[F], 0.0)
        pushes = [*self.contacts, *self.laws.oil]
        force[pushes] = np.maximum(force[pushes], 0.0)  # a switching is located to round-off
        return (time, state.T, force.T), {} if after is None else after

    def rate_with(self, acting: Acting, load: np.ndarray, ramp: np.ndarray) -> Callable:
        """The time derivative of the state (2n + r) as a function, for the laws of a set of phases and given forces.

        Linear laws form one matrix on state, lift, lift rate, one and time [s]; the forces of curved laws are added.
        """
        n, size, bent, memory = len(self.mass), len(self.floors), self.laws.bent, self.memory
        x, v, z, lift, slope, unit, time = (slice(0, n), slice(n, 2 * n), slice(2 * n, size), *range(size, size + 4))
        d, rate, force = np.zeros((3, len(self.rows), size + 4))
        d[:, x], d[:, lift], d[:, unit] = self.rows, self.driven[:, 0], -self.gap[:, 0]
        rate[:, v], rate[:, slope] = self.rows, self.driven[:, 0]
        force[:] = acting.slope * d + self.damping * rate
        force[:, z] += acting.by_memory
        force[:, unit] += acting.base[:, 0]
        force[~acting.acts], force[bent] = 0.0, 0.0
        moved = np.zeros((size, size + 4))
        moved[x, v], moved[v] = np.eye(n), -self.rows.T @ force
        moved[v, v] -= np.diag(self.drag)
        moved[v, unit] += load
        moved[v, time] = ramp
        moved[v] /= self.mass[:, None]
        moved[z] = acting.follows[:, None] * rate[memory] + acting.per_leak[:, None] * force[memory]
        pushes = -(acting.acts[:, None] * self.rows)[bent].T / self.mass[:, None]
        observed, damping, dissipation = (
            np.concatenate([d[bent], rate[bent]]),
            self.damping[bent],
            self.laws.dissipation[bent],
        )
        state, count = np.ones(size + 4), len(bent)

        def derivative(t: float, y: np.ndarray) -> np.ndarray:
            state[:size] = y
            state[lift], state[slope] = self.cam(t)
            state[time] = t
            change = moved @ state
            if count:
                u = (observed @ state)[:, None]
                elastic = self.laws.bent_force(u[:count])
                change[v] += pushes @ (elastic + (damping + dissipation * elastic) * u[count:])[:, 0]
            return change

        return derivative

    def _surfaces_at(self, time: np.ndarray, state: np.ndarray, acting: Acting) -> tuple[np.ndarray, ...]:
        theta = time * self.cam_speed - np.pi
        return self.surfaces(state, self.lift(theta), self.lift(theta, 1) * self.cam_speed, acting)

    def _first(self, dense, times: np.ndarray, laws: tuple[Acting, list[Switching]], begins: bool):
        """The time of the first switching within a step, and the phase that it begins, by its key.

        The step is examined at these `times`. If it has no switching, its end and None are returned. At the
        beginning of a phase, round-off may already have moved a surface beyond its zero; if the surface moves further
        away from zero, the switching is at the beginning.
        """
        acting, watched = laws
        surfaces = self._surfaces_at(times, dense(times), acting)
        time, after = times[-1], None
        for w in watched:
            g = w.sign * (surfaces[w.surface][w.row] - w.border)
            crossed = (g[1:] > 0) & (g[:-1] <= 0)
            crossed[0] |= begins and 0 < g[0] < g[1]
            if not crossed.any():
                continue
            i = int(np.argmax(crossed))

            def surface(t, w=w):
                return w.sign * (self.surfaces(dense(t)[:, None], *self.cam(t), acting)[w.surface][w.row, 0] - w.border)

            at = times[i]
            if surface(at) < 0:
                at = root_scalar(surface, bracket=(at, times[i + 1]), xtol=ROOT).root
            if at < time or after is None:
                time, after = at, {w.key: w.phase}
        return time, after
