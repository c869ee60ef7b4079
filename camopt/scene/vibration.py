"""Small vibrations of a valve train with a fixed set of closed contacts: damping and stiffness matrices, eigenvalues.

Nonlinear laws are replaced by their constant stiffness, `train.stiffness`.
"""

from functools import lru_cache
from typing import Literal

import numpy as np
from scipy.linalg import eigh

from camopt.scene.rest import rest_position
from camopt.scene.train import Train

State = Literal["lifted", "seated"]
SEATED_SHARE = 0.5
"""Least share of a revolution during which the valve is seated."""
OVERDAMPED = 1e-9
"""Imaginary part of an eigenvalue, relative to its magnitude, below which the mode does not oscillate."""


def acting_elements(train: Train, state: State) -> np.ndarray:
    """Mask (e) of the elements that act: all springs, and the contacts that are closed in the state.

    The contacts between cam and valve are closed in both states, the seat only when seated. Any other contact (a valve
    spring or a coil clash declared as contact) is closed in both states if it carries force at rest on the base circle:
    a preloaded spring does, a coil clash with an open gap does not. In a train without a valve all contacts are closed.
    """
    acting = np.ones(len(train.a), dtype=bool)
    if train.seat < 0:
        return acting
    acting = ~train.contact | (train.compression(rest_position(train), 0.0) > train.touch_compression)
    acting[list(train.cam_side)] = True
    acting[train.seat] = state == "seated"
    return acting


def assembled(train: Train, acting: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Damping (n, n) [N s/m] and stiffness matrix (n, n) [N/m] with the elements `acting` (e)."""
    moving = train.incidence[acting]
    damping = np.diag(train.mass_damping) + moving.T * train.damping[acting] @ moving
    return damping, moving.T * train.stiffness[acting] @ moving


def oscillations(train: Train, acting: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angular frequencies |lambda| [rad/s] (m), ascending, damping ratios -Re(lambda) / |lambda| (m) and real shapes
    (m, n), not normalised, in their largest phase, of the oscillating modes; overdamped pairs are left out."""
    damping, stiffness = assembled(train, acting)
    if not np.any(damping):
        squares, vectors = eigh(stiffness, np.diag(train.mass))
        angular = np.sqrt(np.maximum(squares, 0.0))  # the rigid mode of a free train may be computed as -1e-9
        return angular, np.zeros(len(angular)), vectors.T
    values, vectors = np.linalg.eig(_state_matrix(train.mass, damping, stiffness))
    oscillating = np.flatnonzero(np.imag(values) > OVERDAMPED * np.abs(values))
    oscillating = oscillating[np.argsort(np.abs(values[oscillating]))]
    shape = vectors[: len(train.mass), oscillating].T
    phase = np.angle(np.sum(shape**2, axis=1)) / 2  # the phase in which the real part is largest
    angular = np.abs(values[oscillating])
    return angular, -np.real(values[oscillating]) / angular, np.real(shape * np.exp(-1j * phase)[:, None])


def highest_rate(train: Train) -> float:
    """Largest magnitude of an eigenvalue with every element acting [rad/s], which determines explicit step sizes."""
    damping, stiffness = assembled(train, np.ones(len(train.a), dtype=bool))
    return float(np.abs(np.linalg.eigvals(_state_matrix(train.mass, damping, stiffness))).max())


def slowest_leak(train: Train) -> float:
    """Least rate [1/s] at which an excess force in the oil of an adjuster decays by leakage; infinite without oil.

    While the valve is seated, for SEATED_SHARE of a revolution, the oil column of stiffness k stands between cam and
    seat, in series with their compliance, and its force decays at the rate 1 / (leak (1/k + compliance)).
    """
    if train.laws is None:
        return np.inf
    acting = acting_elements(train, "seated")
    acting[list(train.memory)] = False
    _, stiffness = assembled(train, acting)
    rates = []
    for e in np.flatnonzero(train.laws.leak > 0.0):
        row = train.incidence[e]
        compliance = row @ np.linalg.lstsq(stiffness, row)[0]
        rates.append(SEATED_SHARE / (train.laws.leak[e] * (1.0 / train.laws.coefficient[e] + compliance)))
    return float(min(rates, default=np.inf))


@lru_cache(maxsize=256)
def slowest_rate(train: Train) -> float:
    """Least rate [1/s] at which a disturbance decays, over the modes of the train with the valve lifted and seated and
    over the leakage of its adjusters; zero if one does not decay."""
    rates = [slowest_leak(train)]
    for state in ("lifted", "seated"):
        damping, stiffness = assembled(train, acting_elements(train, state))
        rates.append(float(-np.real(np.linalg.eigvals(_state_matrix(train.mass, damping, stiffness))).max()))
    return max(0.0, min(rates))


def _state_matrix(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """A (2n, 2n) of y' = A y for y = (x, v)."""
    n = len(mass)
    return np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness / mass[:, None], -damping / mass[:, None]]])
