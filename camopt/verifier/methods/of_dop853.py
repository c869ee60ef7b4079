"""The laws of a train's elements for DOP853: smooth phases, and the switching surfaces between them.

With u the compression beyond the touch, d the compression, p the elastic force, f = p + c d' and z a memory:

    contact    apart -> pushing where u rises through zero (the force jumps by c u'); pushing -> pressed without force
               where f falls through zero; pressed -> pushing where f rises again; pressed -> apart where u falls
               through zero; without damping pushing -> apart there
               under f = p (1 + dissipation d') a contact is pressed without force while d' is below -1 / dissipation;
               otherwise f and p reach zero together
    table      from row to row where d passes a row's compression
    oil        pushing: f = k (d - z - travel), z' = f / leak; waiting: no force, z' = 0; filling: no force, z = d
    friction   sticking: f = k (d - z), z' = 0; forward and backward: f = slip and -slip, z' = d'

A surface of a table or a memory counts as passed only when it exceeds zero by the permitted error: a train at rest lies
on such surfaces, and round-off must not switch it back and forth.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PPoly

from camopt.scene.train import Train

CONTACT, ROW, MEMORY = range(3)
"""Parts of an element that have phases of their own."""
APART, PRESSED, PUSHING = range(3)
PUSHES, WAITS, FILLS = range(3)
STICKS, FORWARD, BACKWARD = range(3)
U, F, D, RATE, SLACK = range(5)
"""Surfaces: compression beyond the touch [m], p + c d' [N], compression [m], its rate [m/s], d - z [m]."""
LINEAR, HERTZ, PROGRESSIVE, TABLE, OIL, FRICTION, HUNT_CROSSLEY = WRITTEN = range(7)
"""Numbers of the laws that are implemented here, as in `camopt.scene.laws.KINDS`."""
FAR = 10.0
"""Compression [m] beyond the ends of a table up to which its first and last stiffness are continued."""

Force = Callable[[np.ndarray], np.ndarray]
"""Elastic forces [N] of some elements as a function of their compressions (b, m) [m]."""
Phases = dict[tuple[int, int], int]
"""Phases by (element, part), where the part is CONTACT, ROW or MEMORY."""


class Switching(NamedTuple):
    """The part of an element named by `key` enters `phase` where sign * (surface - border) rises through zero."""

    key: tuple[int, int]
    row: int  # index of the element or, on the surface SLACK, of the memory
    surface: int
    sign: float
    phase: int
    border: float = 0.0


class Acting(NamedTuple):
    """The laws in one set of phases: f = base + slope d + by_memory z, and z' = follows d' + f / leak."""

    base: np.ndarray  # (e, 1) N
    slope: np.ndarray  # (e, 1) N/m
    by_memory: np.ndarray  # (e, r) N/m
    follows: np.ndarray  # (r) 0 or 1
    per_leak: np.ndarray  # (r) m/(N s)
    acts: np.ndarray  # (e) whether the element's force acts on the masses


class PieceLaws:
    """The laws of one train in every set of phases."""

    def __init__(self, train: Train):
        self.stiffness, self.preload = train.stiffness[:, None], train.preload[:, None]
        self.touch = -self.preload / self.stiffness
        self.contacts, self.damped = np.flatnonzero(train.contact), train.damping > 0
        self.bent, self.lines = (
            [],
            {},
        )  # elements whose force is a curve of the compression; elements with a force table
        self.bends = []  # for each law among `bent`: number of elements, and their force by their compressions
        self.dissipation = np.zeros_like(self.preload)
        self.memory, self.oil = list(train.memory), np.zeros(0, dtype=int)
        if train.laws is None:
            return
        laws = train.laws
        power = np.flatnonzero((laws.kind == HERTZ) | (laws.kind == HUNT_CROSSLEY))
        self._bend(power, *_powers(laws.coefficient[power, None], laws.own_number[power, None], self.preload[power]))
        self.oil, self.dissipation = np.flatnonzero(laws.kind == OIL), laws.dissipation[:, None]
        self.leak, self.travel, self.slip = laws.leak, laws.travel, laws.slip
        for e in np.flatnonzero(laws.kind == PROGRESSIVE):
            work = _curve(laws.table[e], train.preload[e])
            self._bend([e], work.roots(extrapolate=False), work)
        for e in np.flatnonzero(laws.kind == TABLE):
            self.lines[int(e)] = c, base, slope = _lines(laws.table[e])
            row = np.searchsorted(base + slope * np.append(c, np.inf), 0.0)  # first row that ends above zero force
            self.touch[e] = -base[row] / slope[row]

    def _bend(self, elements, touch: np.ndarray, force: Force) -> None:
        """Assign elements (b) the compressions [m] at which they touch, and their force by compressions (b, m)."""
        if len(elements):
            self.touch[elements] = touch
            self.bent += list(elements)
            self.bends.append((len(elements), force))

    def force(self, d: np.ndarray, z: np.ndarray, acting: Acting) -> np.ndarray:
        """Elastic force [N] at compressions d (e, m) and memories z (r, m) [m]."""
        force = acting.base + acting.slope * d
        if self.memory:
            force += acting.by_memory @ z
        if len(self.bent):
            force[self.bent] = self.bent_force(d[self.bent])
        return force

    def bent_force(self, d: np.ndarray) -> np.ndarray:
        """Elastic force [N] of the `bent` elements (b) at their compressions d (b, m) [m]."""
        forces, begin = [], 0
        for count, force in self.bends:
            forces.append(force(d[begin : begin + count]))
            begin += count
        return forces[0] if len(forces) == 1 else np.concatenate(forces)

    def first_phases(self, d: np.ndarray, rate: np.ndarray, z: np.ndarray) -> Phases:
        """The phases of rows and memories at compressions d (e) with rates (e) and memories z (r)."""
        phases = {(e, ROW): int(np.searchsorted(c, d[e], "right")) for e, (c, _, _) in self.lines.items()}
        for j, e in enumerate(self.memory):
            slack = d[e] - z[j]
            if e in self.oil:
                begins = slack == self.travel[e] == 0.0 and rate[e] >= 0.0
                phase = PUSHES if slack > self.travel[e] or begins else WAITS
                phase = FILLS if slack < 0.0 or (slack == 0.0 and rate[e] < 0.0) else phase
            else:
                slides = abs(slack) >= self.slip[e] / self.stiffness[e, 0] and slack * rate[e] > 0.0
                phase = (FORWARD if slack > 0 else BACKWARD) if slides else STICKS
            phases[e, MEMORY] = phase
        return phases

    def acting(self, phases: Phases) -> Acting:
        """The laws in these phases."""
        r, acts = (
            len(self.memory),
            np.array([phases.get((e, CONTACT), PUSHING) == PUSHING for e in range(len(self.preload))]),
        )
        base, slope = self.preload.copy(), self.stiffness.copy()
        by_memory, follows, per_leak = np.zeros((len(base), r)), np.zeros(r), np.zeros(r)
        for e, (_, bases, slopes) in self.lines.items():
            base[e], slope[e] = bases[phases[e, ROW]], slopes[phases[e, ROW]]
        for j, e in enumerate(self.memory):
            phase, k = phases[e, MEMORY], self.stiffness[e, 0]
            holds = phase == (PUSHES if e in self.oil else STICKS)
            slope[e], by_memory[e, j] = (k, -k) if holds else (0.0, 0.0)
            if e in self.oil:
                base[e], per_leak[j] = (-k * self.travel[e], 1.0 / self.leak[e]) if holds else (0.0, 0.0)
                follows[j] = phase == FILLS
            else:
                base[e] = {STICKS: 0.0, FORWARD: self.slip[e], BACKWARD: -self.slip[e]}[phase]
                follows[j] = phase != STICKS
        return Acting(base, slope, by_memory, follows, per_leak, acts)

    def followed(self, d: np.ndarray, z: np.ndarray, phases: Phases) -> np.ndarray:
        """The memories z (r); those that follow their compression d (e) in these phases are set to it exactly."""
        z = z.copy()
        for j, e in enumerate(self.memory):
            phase, reach = phases[e, MEMORY], self.slip[e] / self.stiffness[e, 0]
            if e in self.oil:
                z[j] = d[e] if phase == FILLS else z[j]
            elif phase != STICKS:
                z[j] = d[e] - reach if phase == FORWARD else d[e] + reach
        return z

    def switchings(self, phases: Phases, length: float, velocity: float) -> list[Switching]:
        """The possible next switchings; `length` [m] and `velocity` [m/s] are the permitted errors."""
        next_switchings = []
        for key, phase in phases.items():
            e, part = key
            if part == CONTACT:
                next_switchings += self._of_contact(key, phase)
            elif part == ROW:
                corners = self.lines[e][0]
                if phase < len(corners):
                    next_switchings.append(Switching(key, e, D, 1.0, phase + 1, corners[phase] + length))
                if phase > 0:
                    next_switchings.append(Switching(key, e, D, -1.0, phase - 1, corners[phase - 1] - length))
            elif e in self.oil:
                next_switchings += self._of_oil(key, phase, length, velocity)
            else:
                next_switchings += self._of_friction(key, phase, length, velocity)
        return next_switchings

    def _of_contact(self, key, phase) -> list[Switching]:
        e, dissipation = key[0], self.dissipation[key[0], 0]
        if phase == APART:
            return [Switching(key, e, U, 1.0, PUSHING)]
        if dissipation > 0.0:
            sign, next_phase = (1.0, PUSHING) if phase == PRESSED else (-1.0, PRESSED)
            return [Switching(key, e, U, -1.0, APART), Switching(key, e, RATE, sign, next_phase, -1.0 / dissipation)]
        if phase == PRESSED:
            return [Switching(key, e, F, 1.0, PUSHING), Switching(key, e, U, -1.0, APART)]
        return [Switching(key, e, F, -1.0, PRESSED) if self.damped[e] else Switching(key, e, U, -1.0, APART)]

    def _of_oil(self, key, phase, length, velocity) -> list[Switching]:
        e, travel = key[0], self.travel[key[0]]
        j, shuts = self.memory.index(e), PUSHES if travel == 0.0 else WAITS
        if phase == FILLS:
            return [Switching(key, e, RATE, 1.0, shuts, velocity)]
        empties = Switching(key, j, SLACK, -1.0, FILLS, -length)
        if phase == WAITS:
            return [Switching(key, j, SLACK, 1.0, PUSHES, travel + length), empties]
        return [empties if travel == 0.0 else Switching(key, j, SLACK, -1.0, WAITS, travel - length)]

    def _of_friction(self, key, phase, length, velocity) -> list[Switching]:
        e, reach = key[0], self.slip[key[0]] / self.stiffness[key[0], 0]
        j = self.memory.index(e)
        if phase == STICKS:
            return [
                Switching(key, j, SLACK, 1.0, FORWARD, reach + length),
                Switching(key, j, SLACK, -1.0, BACKWARD, -reach - length),
            ]
        sign = -1.0 if phase == FORWARD else 1.0
        return [Switching(key, e, RATE, sign, STICKS, sign * velocity)]


def _powers(coefficient: np.ndarray, exponent: np.ndarray, preload: np.ndarray) -> tuple[np.ndarray, Force]:
    """Compression at touch (b, 1) [m] and force of contacts whose law is a power of the depth; all arguments (b, 1).

    The force is continued as an odd function about the touch, so that it is smooth enough to locate a root across it.
    """
    touch = -((preload / coefficient) ** (1 / exponent))

    def force(d: np.ndarray) -> np.ndarray:
        u = d - touch
        return coefficient * np.sign(u) * np.abs(u) ** exponent

    return touch, force


def _curve(table: np.ndarray, preload: float) -> PPoly:
    """Elastic force over the compression [m] for a table of stiffnesses (q, 2)."""
    c, k = table.T
    c, k = np.array([c[0] - FAR, *c, c[-1] + FAR]), np.array([k[0], *k, k[-1]])
    work = PPoly(np.stack([np.diff(k) / np.diff(c), k[:-1]]), c).antiderivative()
    work.c[-1] += preload - work(0.0)
    return work


def _lines(table: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compressions [m] of a force table's corners, and force at zero [N] and slope [N/m] of each line between them."""
    c, force = table.T
    slope = np.diff(force) / np.diff(c)
    return c[1:-1], force[:-1] - slope * c[:-1], slope
