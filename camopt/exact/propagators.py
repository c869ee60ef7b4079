"""Exact propagators over one fixed step, one per set of acting contacts, built only for sets that occur.

With the lift over the step as a polynomial in tau = t / step, the state y = (x, v), the lift's coefficients u and the
constant 1 form one linear system; its matrix exponential advances y exactly, whatever the stiffness.
"""

from functools import lru_cache
from threading import Lock

import numpy as np
from scipy.linalg import expm

from camopt.scene.train import GROUND, Train

LARGEST_PHASE = 1.5
"""Default step times highest frequency [rad]: switching is sought well within a quarter period of any mode."""


def linear_system(train: Train, acting: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A (2n, 2n), and the columns of lift, lift velocity and constant (2n) in y' = A y + ... with elements `acting`."""
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
    """Transposed propagators (2n + q + 1, 2n) of one train, step [s] and lift width q (coefficients of a piece)."""

    def __init__(self, train: Train, step: float, width: int):
        self.train, self.step, self.width = train, step, width
        self.contacts = np.flatnonzero(train.contact)
        slots = np.full(2 ** len(self.contacts), -1, dtype=np.int32)
        self.built = slots, np.zeros((0, 2 * len(train.mass) + width + 1, 2 * len(train.mass)))
        self._lock = Lock()

    def build(self, contact_set: int) -> None:
        """Adds the propagator of a set: bit i says that contact i acts.

        `built` is replaced, never changed: another thread may be reading it.
        """
        with self._lock:
            slots, table = self.built
            if slots[contact_set] < 0:
                slots = slots.copy()
                slots[contact_set] = len(table)
                self.built = slots, np.concatenate([table, self._propagator(contact_set)[None]])

    def _propagator(self, contact_set: int) -> np.ndarray:
        n2, q = 2 * len(self.train.mass), self.width
        acting = ~self.train.contact
        acting[self.contacts] = (contact_set >> np.arange(len(self.contacts))) & 1
        a, by_lift, by_velocity, constant = linear_system(self.train, acting)
        system = np.zeros((n2 + q + 1, n2 + q + 1))
        system[:n2, :n2] = a * self.step
        system[:n2, n2] = by_lift * self.step
        if q > 1:
            system[:n2, n2 + 1] = by_velocity  # the coefficient of tau is the lift velocity times the step
        system[:n2, -1] = constant * self.step
        for k in range(q - 1):
            system[n2 + k, n2 + k + 1] = k + 1.0
        return np.ascontiguousarray(expm(system)[:n2].T)


@lru_cache(maxsize=64)
def propagators(train: Train, step: float, width: int) -> Propagators:
    """The propagators of a train, shared by all speeds and cams that use the same step and lift width."""
    return Propagators(train, step, width)


@lru_cache(maxsize=256)
def default_step(train: Train) -> float:
    """Step [s] at which the highest mode turns by `LARGEST_PHASE`."""
    return LARGEST_PHASE / highest_frequency(train)
