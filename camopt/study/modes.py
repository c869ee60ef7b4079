"""Natural modes of a valve train with a fixed set of closed contacts, from this file's own assembly of M, C and K."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import eigh

from camopt.scene import InputError, Scene, Train, build_train, rest_position

State = Literal["lifted", "seated"]
OVERDAMPED = 1e-9
"""Imaginary part of an eigenvalue, relative to its magnitude, below which it belongs to no oscillation."""
LEADING = 0.01
"""Share of the largest component that a component needs to decide the sign of its shape."""


@dataclass(frozen=True)
class Modes:
    """Oscillating modes (m) of a train of n masses, by ascending frequency."""

    state: str
    frequency_Hz: np.ndarray  # (m), magnitude of the eigenvalue over 2 pi: the undamped frequency where undamped
    angular: np.ndarray  # (m) rad/s
    damping_ratio: np.ndarray  # (m), zero where undamped
    shape: np.ndarray  # (m, n), unit norm, the last component of any size positive
    mass_names: tuple[str, ...]
    closed: tuple[str, ...]  # the contacts taken as closed

    def as_dict(self) -> dict:
        """The content of `modes --json`."""
        names = ("state", "frequency_Hz", "angular", "damping_ratio", "shape", "mass_names", "closed")
        out = {name: getattr(self, name) for name in names}
        return {"angular_rad_per_s" if k == "angular" else k: v for k, v in out.items()}

    def plot(self):
        """The mode shapes over the masses as a matplotlib Figure."""
        from camopt.plots import modes as figure

        return figure(self.frequency_Hz, self.shape, self.mass_names, self.state)

    def _repr_html_(self) -> str:
        from pandas import DataFrame

        columns = {"frequency [Hz]": self.frequency_Hz, "damping ratio": self.damping_ratio}
        shapes = dict(zip(self.mass_names, self.shape.T, strict=True))
        return DataFrame(columns | shapes).to_html(float_format="{:.5g}".format)


def modes(scene: Scene, state: State = "lifted") -> Modes:
    """Modes of a scene with the valve lifted off its seat or on it.

    The contacts between cam and valve are closed in both states; the seat only when seated. Any other contact (a valve
    spring or a coil clash declared as contact) is closed where it carries force at rest on the base circle, in both
    states: a preloaded spring is, a coil clash with an open gap is not. A scene without valve has all contacts closed.

    With damping the modes are those of the damped train: frequency |lambda| / (2 pi), damping ratio
    -Re(lambda) / |lambda|, shape in the phase in which it is largest; overdamped pairs are left out.
    Returns `Modes`: m frequencies [Hz] ascending, damping ratios (m), shapes (m, n) over the n masses. Raises
    InputError for an unknown state.
    """
    if state not in ("lifted", "seated"):
        raise InputError(f"modes: state {state!r}: expected 'lifted' or 'seated'")
    train = build_train(scene)
    acting = acting_elements(train, state)
    mass, damping, stiffness = train.mass, *assembled(train, acting)
    if np.any(damping):
        angular, ratio, shape = _damped(mass, damping, stiffness)
    else:
        squares, vectors = eigh(stiffness, np.diag(mass))
        angular = np.sqrt(np.maximum(squares, 0.0))  # a free train's rigid mode may come out as -1e-9
        ratio, shape = np.zeros(len(angular)), vectors.T
    closed = tuple(train.element_names[e] for e in np.flatnonzero(acting & train.contact))
    return Modes(state, angular / (2 * np.pi), angular, ratio, _normalised(shape), train.mass_names, closed)


def acting_elements(train: Train, state: State) -> np.ndarray:
    """Which elements act (e): all springs, and the contacts closed in the state (see `modes`)."""
    acting = np.ones(len(train.a), dtype=bool)
    if train.seat < 0:
        return acting
    acting = ~train.contact | (train.compression(rest_position(train), 0.0) > train.touch_compression)
    acting[list(train.cam_side)] = True
    acting[train.seat] = state == "seated"
    return acting


def assembled(train: Train, acting: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Damping (n, n) [N s/m] and stiffness matrix (n, n) [N/m] with the elements `acting` (e)."""
    n = len(train.mass)
    incidence = np.zeros((len(train.a), n + 1))  # the last column is the ground
    rows = np.arange(len(train.a))
    incidence[rows, train.a] += 1.0
    incidence[rows, train.b] -= 1.0
    moving = incidence[acting, :n]
    damping = np.diag(train.mass_damping) + moving.T * train.damping[acting] @ moving
    return damping, moving.T * train.stiffness[acting] @ moving


def highest_rate(train: Train) -> float:
    """Largest eigenvalue magnitude of the motion with every element acting [rad/s]; explicit steps follow it."""
    damping, stiffness = assembled(train, np.ones(len(train.a), dtype=bool))
    return float(np.abs(np.linalg.eigvals(_state_matrix(train.mass, damping, stiffness))).max())


def _state_matrix(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """A (2n, 2n) of y' = A y for y = (x, v)."""
    n = len(mass)
    return np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness / mass[:, None], -damping / mass[:, None]]])


def _damped(mass, damping, stiffness) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angular frequency [rad/s], damping ratio and real shape of the oscillating modes."""
    values, vectors = np.linalg.eig(_state_matrix(mass, damping, stiffness))
    kept = np.flatnonzero(np.imag(values) > OVERDAMPED * np.abs(values))
    kept = kept[np.argsort(np.abs(values[kept]))]
    shape = vectors[: len(mass), kept].T
    phase = np.angle(np.sum(shape**2, axis=1)) / 2  # the phase in which the real part is largest
    shape = np.real(shape * np.exp(-1j * phase)[:, None])
    angular = np.abs(values[kept])
    return angular, -np.real(values[kept]) / angular, shape


def _normalised(shape: np.ndarray) -> np.ndarray:
    """Shapes (m, n) with unit norm; the sign is that of the literature's Table 2, the last sizeable component up."""
    shape = shape / np.linalg.norm(shape, axis=1)[:, None]
    sizeable = np.abs(shape) >= LEADING * np.abs(shape).max(axis=1)[:, None]
    last = shape.shape[1] - 1 - np.argmax(sizeable[:, ::-1], axis=1)
    return shape * np.sign(shape[np.arange(len(shape)), last])[:, None]
