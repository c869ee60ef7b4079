"""The raw motion that the second reading reads: SciPy's DOP853 with every switching of a contact located.

Written from "Masses and elements" in docs/model.md and the scene file alone, with an assembly and a contact law of its
own; of camopt it uses the scene's numbers and the lift's polynomial pieces. Between two switchings, and between two
borders of the lift's pieces, the equations are smooth: each such stretch of the motion is kept with its dense output.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import OdeSolution, solve_ivp

from tests.measure.raw_laws import changes_of, first_phase, law_of, remembered

APART, PRESSED, PUSHING = range(3)
"""A contact is open, compressed without force (its damper would have to pull), or pushes."""
LONGEST_STEP = 2e-5
"""Seconds between two looks at the switchings: a quarter of the shortest contact in the built-in scenes."""
FIRST_STEP = 1e-8
"""Seconds: so soon after a switching the motion is looked at again, because a graze turns back within a normal step."""
RELATIVE, ABSOLUTE = 1e-12, 1e-15
MISSED = 1e-9, 1e-2
"""Compression [m] and force [N] on the wrong side of a switching beyond which one was missed."""
TURN = 2 * np.pi


@dataclass
class Equations:
    """The equations of motion of a scene's masses (n) and elements (e) under a cam at one crankshaft speed."""

    scene: object
    lift: object
    speed_rpm: float
    omega: float = field(init=False)

    def __post_init__(self):
        masses, elements = self.scene.mass, self.scene.element
        self.omega = self.speed_rpm * self.scene.operation.cam_per_crank * TURN / 60
        index = {m.name: i for i, m in enumerate(masses)}
        self.mass = np.array([m.mass_kg for m in masses])
        self.drag = np.array([m.damping_N_s_per_m for m in masses])
        self.load = np.array([m.force_N for m in masses])
        self.rows = np.zeros((len(elements), len(masses)))
        for row, element in zip(self.rows, elements, strict=True):
            for end, sign in zip(element.between, (1.0, -1.0), strict=True):
                if end != "ground":
                    row[index[end]] = sign
        self.k = np.array([e.stiffness_N_per_m or 1.0 for e in elements])
        self.c = np.array([e.damping_N_s_per_m for e in elements])
        self.preload = np.array([e.preload_N for e in elements])
        self.gap = np.array([e.gap_mm for e in elements]) * 1e-3
        self.driven = np.array([float(e.cam_driven) for e in elements])
        self.contacts = [i for i, e in enumerate(elements) if e.kind == "contact"]
        self.power = np.array([(e.exponent or 1.5) if e.law == "hertz" else 1.0 for e in elements])
        self.touch = -np.sign(self.preload) * (np.abs(self.preload) / self.k) ** (1 / self.power)
        self.memory = [i for i, e in enumerate(elements) if e.kind == "friction"]  # the state's order: oil comes last
        self.memory += [i for i, e in enumerate(elements) if e.kind == "adjuster"]
        curved = [i for i, e in enumerate(elements) if e.law in ("progressive", "table")]
        self.laws = {i: law_of(elements[i]) for i in (*curved, *self.memory)}
        self.touch[list(self.laws)] = [touch for _, touch in self.laws.values()]
        self.clipped = [*self.contacts, *(i for i in self.memory if elements[i].kind == "adjuster")]
        self.pushes = [(index[f.on], np.array(f.table).T) for f in self.scene.force]
        self.bent = bool(np.any(self.power != 1.0))
        self.pieces = [np.asarray(c)[::-1].tolist() for c in self.lift.coefficients]
        self.borders = self.lift.borders.tolist()

    def cam(self, piece: int, t: float) -> tuple[float, float]:
        """Lift [m] and its rate [m/s] at a time, by the polynomial of a piece, counted over the revolutions."""
        turn, i = divmod(piece, len(self.pieces))
        u = self.omega * t - np.pi - TURN * turn - self.borders[i]
        value = slope = 0.0
        for coefficient in self.pieces[i]:
            slope = slope * u + value
            value = value * u + coefficient
        return value, slope * self.omega

    def border(self, piece: int) -> float:
        """Time at which a piece ends."""
        turn, i = divmod(piece, len(self.pieces))
        return (self.borders[i + 1] + np.pi + TURN * turn) / self.omega

    def push(self, t) -> np.ndarray:
        """Forces by the cam angle [N] on the masses (n) at a time."""
        total = np.zeros(len(self.mass))
        for mass, (angle, force) in self.pushes:
            total[mass] += np.interp(np.degrees(self.omega * t) % 360.0 - 180.0, angle, force)
        return total

    def surfaces(self, y, lift, rate) -> tuple[np.ndarray, ...]:
        """Of every element, (e) or (e, m) in states y (2n + r, ...): compression beyond the touch [m], force of an
        acting one but for its memory [N]; slack beyond the memory [m], and rate of compression [m/s]."""
        n = len(self.mass)
        column = (slice(None), *(None,) * (y.ndim - 1))
        beyond = self.rows @ y[:n] + self.driven[column] * lift - (self.gap + self.touch)[column]
        elastic = beyond
        if self.bent:
            bent = (self.power != 1.0)[column]
            elastic = np.where(bent, np.maximum(beyond, 0.0) ** self.power[column], beyond)
        speed = self.rows @ y[n : 2 * n] + self.driven[column] * rate
        force = self.k[column] * elastic
        slack = np.zeros_like(beyond)
        for i, (law, touch) in self.laws.items():
            force[i] = law(beyond[i] + touch)
        for j, i in enumerate(self.memory):
            slack[i] = beyond[i] + self.touch[i] - y[2 * n + j]
        return beyond, force + self.c[column] * speed, slack, speed

    def elements_forces(self, phase: dict, surfaces: tuple[np.ndarray, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Forces (e) of the elements in their phases, and rates (r) of the memories."""
        force, rates = surfaces[1].copy(), np.zeros(len(self.memory))
        force[[i for i in self.contacts if phase[i] != PUSHING]] = 0.0
        for j, i in enumerate(self.memory):
            force[i] = max(0.0, force[i]) if i in self.clipped else force[i]
            more, rates[j] = remembered(self.scene.element[i], phase[i], surfaces[2][i], surfaces[3][i])
            force[i] += more
        return force, rates

    def phases(self, y: np.ndarray, piece: int, t: float) -> dict[int, int]:
        """The phase of every contact in an arbitrary state."""
        beyond, force, slack, rate = self.surfaces(y, *self.cam(piece, t))
        found = {i: APART if beyond[i] <= 0 else PUSHING if force[i] > 0 else PRESSED for i in self.contacts}
        return found | {i: first_phase(self.scene.element[i], slack[i], rate[i]) for i in self.memory}


@dataclass(frozen=True)
class Stretch:
    """A smooth part of the motion: seconds from -180 degrees of the first revolution."""

    begin: float
    end: float
    piece: int
    phase: dict[int, int]
    steps: np.ndarray  # (m) times of the integrator's steps
    motion: OdeSolution


def raw_motion(equations: Equations, start: np.ndarray, end_angle: float) -> list[Stretch]:
    """All stretches from the state `start` (2n + r: [m], [m/s], [m]) at -180 degrees to `end_angle` [rad]."""
    t, y, piece, found = 0.0, np.array(start, dtype=float), 0, []
    end = (end_angle + np.pi) / equations.omega
    phase = equations.phases(y, piece, t)
    while t < end * (1 - 1e-14):
        stop = min(equations.border(piece), end)
        changes = _changes(equations, phase)
        solution = solve_ivp(
            _rates(equations, phase, piece),
            (t, stop),
            y,
            "DOP853",
            rtol=RELATIVE,
            atol=ABSOLUTE,
            first_step=min(FIRST_STEP, 0.1 * (stop - t)),
            max_step=LONGEST_STEP,
            dense_output=True,
            events=_watches(equations, changes, piece),
        )
        assert solution.success, solution.message
        t, y = solution.t[-1], solution.y[:, -1]
        found.append(Stretch(solution.t[0], t, piece, phase, solution.t, solution.sol))
        _none_missed(equations, phase, *equations.surfaces(y, *equations.cam(piece, t))[:2])
        fired = [j for j, times in enumerate(solution.t_events) if len(times)]
        if fired:
            contact, after, *_ = changes[fired[0]]
            phase = {**phase, contact: after}
        else:
            piece += 1
    return found


def _rates(equations: Equations, phase: dict[int, int], piece: int):
    n = len(equations.mass)
    inverse, rows = 1 / equations.mass, equations.rows.T.copy()

    def rates(t, y):
        force, memory = equations.elements_forces(phase, equations.surfaces(y, *equations.cam(piece, t)))
        v = y[n : 2 * n]
        load = equations.load + equations.push(t) if equations.pushes else equations.load
        return np.concatenate([v, inverse * (load - equations.drag * v - rows @ force), memory])

    return rates


def _none_missed(equations: Equations, phase: dict[int, int], beyond: np.ndarray, force: np.ndarray) -> None:
    """Stops a motion in which a contact has left its phase without a switching."""
    for i in equations.contacts:
        now, damped = phase[i], equations.c[i] > 0
        wrong_by_length = beyond[i] if now == APART else -beyond[i] if now == PRESSED or not damped else 0.0
        wrong_by_force = force[i] if now == PRESSED else -force[i] if now == PUSHING and damped else 0.0
        assert wrong_by_length < MISSED[0] and wrong_by_force < MISSED[1], f"a switching of contact {i} was missed"


def _changes(equations: Equations, phase: dict) -> list[tuple]:
    """(element, phase it may enter, which of `surfaces` passes a level then, direction of passing, level)."""
    found = []
    for i, now in phase.items():
        if i in equations.memory:
            found += [(i, *change) for change in changes_of(equations.scene.element[i], now)]
        elif now == APART:
            found.append((i, PUSHING, 0, 1.0, 0.0))
        elif now == PRESSED:
            found += [(i, PUSHING, 1, 1.0, 0.0), (i, APART, 0, -1.0, 0.0)]
        elif equations.c[i] > 0:
            found.append((i, PRESSED, 1, -1.0, 0.0))
        else:
            found.append((i, APART, 0, -1.0, 0.0))
    return found


def _watches(equations: Equations, changes, piece: int) -> list:
    """Events for `solve_ivp`; all of them read one evaluation per instant."""
    last: dict = {"t": None, "values": None}

    def values(t, y):
        if last["t"] != t:
            last.update(t=t, values=equations.surfaces(y, *equations.cam(piece, t)))
        return last["values"]

    def watch(element, surface, direction, level):
        def value(t, y):
            return values(t, y)[surface][element] - level

        value.terminal, value.direction = True, direction
        return value

    return [watch(element, *rest) for element, _, *rest in changes]


def samples(equations: Equations, stretches: list[Stretch], angles: np.ndarray) -> tuple[np.ndarray, ...]:
    """Lift (k), states (k, 2n + r) and the elements' forces (k, e), none below zero in a contact, at angles [rad]."""
    times, size = (angles + np.pi) / equations.omega, 2 * len(equations.mass) + len(equations.memory)
    lift, y, force = np.empty(len(times)), np.empty((len(times), size)), np.empty((len(times), len(equations.k)))
    ends = np.array([stretch.end for stretch in stretches])
    for i, t in enumerate(times):
        stretch = stretches[min(int(np.searchsorted(ends, t)), len(stretches) - 1)]
        y[i] = stretch.motion(t)
        lift[i], rate = equations.cam(stretch.piece, t)
        force[i] = equations.elements_forces(stretch.phase, equations.surfaces(y[i], lift[i], rate))[0]
        force[i, equations.contacts] = np.maximum(force[i, equations.contacts], 0.0)
    return lift, y, force
