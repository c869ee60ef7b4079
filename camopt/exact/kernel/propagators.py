"""Exact propagators over fixed spans, one set per state of the contacts, built only for states that occur.

With the lift as a polynomial in tau = t / step, the motion (x, v), the lift's coefficients u and the constant 1 form
one linear system; its matrix exponential advances them exactly, whatever the stiffness. The quantity that decides
whether a contact switches is linear in them too, so its values, slopes and power series are rows of matrices.
"""

from functools import lru_cache
from threading import Lock
from typing import NamedTuple

import numpy as np

from camopt.scene.train import GROUND, Train

LARGEST_PHASE = 1.5
"""Product of default step and highest frequency [rad]: switchings are sought well within a quarter period of any mode.
"""
FINE = 32
"""Number of ready propagators inside a step: any instant is at most 1/64 of a step from one, which is 0.024 rad of the
highest mode."""
TERMS = 22
"""Highest power in the series of a watched quantity: over one step the remainder is below 1e-16 of the motion."""
FIRST_STATES = 8
"""Number of contact states for which there is room at first; the room doubles when it is used up."""
SEPARATED, COMPRESSED, ACTING = 0, 1, 2
"""States of a contact: it is apart; it is pressed in, but its damper has cancelled the force; it pushes."""


class Tables(NamedTuple):
    """Everything that the kernel reads for each of s contact states.

    The matrices are transposed: their c rows belong to x, v, u (q) and the constant. A watch is a quantity of a contact
    that stays positive until the contact switches; there are at most w of them, of which `count` are in use.
    """

    keys: np.ndarray  # (s) contact states in base 3
    count: np.ndarray  # (s) watches in use
    element: np.ndarray  # (s, w) the element whose state changes when the watch turns negative
    new: np.ndarray  # (s, w) the state that it changes to
    span: np.ndarray  # (s, c, c - 1 + 2 w (m + 1)): x, v, u after m steps; then values and slopes at every step
    steps: np.ndarray  # (s, m + 1, c, c - 1): x, v, u after every step
    fine: np.ndarray  # (s, FINE, c, c - 1): x, v, u after every FINE-th of a step
    motion: np.ndarray  # (s, 2n + 3, n): accelerations by x, v, lift, lift velocity, and their constants, in SI
    series: np.ndarray  # (s, w, c, TERMS + 1): the watch's power series in tau


def linear_system(train: Train, acting: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A (2n, 2n), and the columns (2n) of lift, lift velocity and constant, of y' = A y + ... for elements `acting`."""
    n = len(train.mass)
    a = np.zeros((2 * n, 2 * n))
    by_lift, by_velocity, constant = np.zeros(2 * n), np.zeros(2 * n), np.zeros(2 * n)
    a[:n, n:] = np.eye(n)
    a[n:, n:] = -np.diag(train.mass_damping / train.mass)
    constant[n:] = train.mass_force / train.mass
    for e in np.flatnonzero(acting):
        push = np.zeros(n)  # acceleration of the masses by a unit force in the element
        ends = [(train.a[e], -1.0), (train.b[e], 1.0)]
        for mass, sign in ends:
            if mass != GROUND:
                push[mass] += sign / train.mass[mass]
        for mass, sign in ends:
            if mass != GROUND:
                a[n:, mass] -= sign * train.stiffness[e] * push
                a[n:, n + mass] -= sign * train.damping[e] * push
        constant[n:] += push * (train.preload[e] - train.stiffness[e] * train.gap[e])
        if train.cam_driven[e]:
            by_lift[n:] += push * train.stiffness[e]
            by_velocity[n:] += push * train.damping[e]
    return a, by_lift, by_velocity, constant


def highest_frequency(train: Train) -> float:
    """Largest eigenvalue magnitude [rad/s] with every element acting."""
    return float(np.abs(np.linalg.eigvals(linear_system(train, np.ones(len(train.a), bool))[0])).max())


class Propagators:
    """The tables of one train for one step [s], lift width q (coefficients per piece) and number m of steps at once."""

    def __init__(self, train: Train, step: float, width: int, at_once: int):
        self.train, self.step, self.width, self.at_once = train, step, width, at_once
        self.contacts = np.flatnonzero(train.contact)
        c, w, s = 2 * len(train.mass) + width + 1, 2 * len(self.contacts), FIRST_STATES
        self._buffers = Tables(
            keys=np.empty(s, dtype=np.int64),
            count=np.empty(s, dtype=np.int64),
            element=np.empty((s, w), dtype=np.int64),
            new=np.empty((s, w), dtype=np.int64),
            span=np.empty((s, c, c - 1 + 2 * w * (at_once + 1))),
            steps=np.empty((s, at_once + 1, c, c - 1)),
            fine=np.empty((s, FINE, c, c - 1)),
            motion=np.empty((s, 2 * len(train.mass) + 3, len(train.mass))),
            series=np.empty((s, w, c, TERMS + 1)),
        )
        self.built = self._buffers._replace(keys=self._buffers.keys[:0])
        self._lock = Lock()

    def build(self, key: int) -> None:
        """Adds the tables of a state of the contacts: digit i of `key` in base 3 is the state of contact i.

        Tables that stand in `built` are never changed, because another thread may be reading them.
        """
        with self._lock:
            slot = len(self.built.keys)
            if key in self.built.keys:
                return
            if slot == len(self._buffers.keys):
                self._buffers = Tables(*(np.concatenate([part, np.empty_like(part)]) for part in self._buffers))
            for part, new in zip(self._buffers, self._tables(key), strict=True):
                part[slot] = new
            self.built = self._buffers._replace(keys=self._buffers.keys[: slot + 1])

    def _tables(self, key: int) -> tuple[np.ndarray, ...]:
        c, m, most = 2 * len(self.train.mass) + self.width + 1, self.at_once, 2 * len(self.contacts)
        status = np.full(len(self.train.a), ACTING)
        status[self.contacts] = key // 3 ** np.arange(len(self.contacts)) % 3
        linear = linear_system(self.train, status == ACTING)
        system = self._system(*linear)
        fine = _powers(_exponential(system / FINE), FINE)
        steps = _powers(fine[-1], m)
        watched = [(int(e), law) for e in self.contacts for law in _laws(status[e])]
        rows = np.array([self._watch(e, law, status[e]) for e, law in watched]).reshape(-1, c)
        series = [rows]
        for k in range(1, TERMS + 1):
            series.append(series[-1] @ system / k)
        looks = [np.concatenate(series[:2]) @ steps[i] for i in range(m + 1)]
        span = np.concatenate([steps[-1][:-1], *looks]).T
        tables = np.zeros((most, c, TERMS + 1))
        tables[: len(rows)] = np.stack(series, axis=-1)
        element, new = np.zeros((2, most), dtype=np.int64)
        element[: len(rows)] = [e for e, _ in watched]
        new[: len(rows)] = [self._after(e, law, status[e]) for e, law in watched]
        padded = np.zeros((c, c - 1 + 2 * most * (m + 1)))
        padded[:, : span.shape[1]] = span
        propagators = (powers[:, :-1].transpose(0, 2, 1) for powers in (steps, fine[:-1]))
        motion = np.column_stack(linear)[len(self.train.mass) :].T
        return np.array(key), np.array(len(rows)), element, new, padded, *propagators, motion, tables

    def _system(self, a, by_lift, by_velocity, constant) -> np.ndarray:
        """d/dtau of (x, v, u, 1), shape (c, c), from `linear_system`."""
        n2, q, h = 2 * len(self.train.mass), self.width, self.step
        system = np.zeros((n2 + q + 1, n2 + q + 1))
        system[:n2, :n2] = a * h
        system[:n2, n2] = by_lift * h
        if q > 1:
            system[:n2, n2 + 1] = by_velocity  # the coefficient of tau is the lift velocity times the step
        system[:n2, -1] = constant * h
        for k in range(q - 1):
            system[n2 + k, n2 + k + 1] = k + 1.0
        return system

    def _watch(self, e: int, law: int, status: int) -> np.ndarray:
        """Row (c) of a contact's elastic force (law 0) or whole force (law 1), with the sign that makes it positive."""
        t, n, q = self.train, len(self.train.mass), self.width
        row = np.zeros(2 * n + q + 1)
        for mass, sign in ((t.a[e], 1.0), (t.b[e], -1.0)):
            if mass != GROUND:
                row[mass] += sign * t.stiffness[e]
                row[n + mass] += sign * t.damping[e] * law
        if t.cam_driven[e]:
            row[2 * n] += t.stiffness[e]
            if q > 1:
                row[2 * n + 1] += t.damping[e] * law / self.step
        row[-1] = t.preload[e] - t.stiffness[e] * t.gap[e]
        return row if status == ACTING or (status, law) == (COMPRESSED, 0) else -row

    def _after(self, e: int, law: int, status: int) -> int:
        """State of a contact after the watched quantity has turned negative."""
        if status == ACTING:
            return COMPRESSED if self.train.damping[e] > 0.0 else SEPARATED
        return SEPARATED if (status, law) == (COMPRESSED, 0) else ACTING


def _exponential(matrix: np.ndarray) -> np.ndarray:
    """exp(matrix) by its plain power series, for a spectral radius below 0.1.

    The elements have very different sizes (a position by a velocity, a coefficient of the lift by another). The series
    keeps the relative accuracy of each; scaling and squaring would lose it.
    """
    total = term = np.eye(len(matrix))
    for k in range(1, 17):
        term = term @ matrix / k
        total = total + term
    return total


def _powers(leap: np.ndarray, most: int) -> np.ndarray:
    """leap^i for i = 0 to most, by doubling, so that rounding grows with the logarithm of `most` only."""
    powers = np.eye(len(leap))[None]
    while len(powers) <= most:
        powers = np.concatenate([powers, leap @ powers])
        leap = leap @ leap
    return powers[: most + 1]


def _laws(status: int) -> tuple[int, ...]:
    """What is watched in a state of a contact: 0 stands for the elastic force, 1 for the whole force."""
    return {SEPARATED: (0,), COMPRESSED: (0, 1), ACTING: (1,)}[int(status)]


@lru_cache(maxsize=24)
def propagators(train: Train, step: float, width: int, at_once: int) -> Propagators:
    """The propagators of a train, shared by all speeds and cams that use the same step and lift width."""
    return Propagators(train, step, width, at_once)


@lru_cache(maxsize=256)
def default_step(train: Train) -> float:
    """Step [s] at which the highest mode turns by `LARGEST_PHASE`."""
    return LARGEST_PHASE / highest_frequency(train)
