"""Transition matrix method of Kodama et al., Eq. (14): one constant matrix per set of closed contacts.

Explicit. As printed (Taylor up to the fourth derivative of x, hence v up to h^3/6 x'''') its global order is 3; with
the exact exponential the train is propagated without error and the order 3 is that of the force, kept up to its second
derivative. The closed set is the one found at the start of each step, so across a damped closing the order is 1.
Kodama, Honda, Otaka, Paerk: valve train dynamics by the transition matrix method. Their printed [C] and [K] carry
misprints; the matrices here are assembled from Eqs. (5) to (11), that is from the elements. Their separation criterion
(open where x_3 > x_2, the damper pulling until then) is "displacement", for reproduction only; "force" opens a contact
where its force reaches zero.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from camopt.cam.lift import Lift
from camopt.programs import compiled
from camopt.scene.errors import InputError
from camopt.scene.response import Response, Revolve
from camopt.scene.train import GROUND, Train

MAY_PULL = {"force": False, "displacement": True}
"""By separation criterion: whether a compressed contact stays closed while its force is below zero."""


def prepare(
    train: Train,
    lift: Lift,
    cam_speed: float,
    steps_per_revolution: int,
    exponential: bool = False,
    criterion: str = "force",
) -> Revolve:
    """One revolution by the transition matrix method as a function of its start state (2n: [m], then [m/s]).

    `cam_speed` [rad/s]; `exponential` replaces the printed Taylor matrices by the exact ones; `criterion`: a contact
    opens by "force", or by "displacement" alone. Matrices are built for the contact sets that occur. The response has
    steps_per_revolution + 1 samples. Raises InputError for another criterion, or laws that are not linear.
    """
    train.require_linear("the transition matrix method", 'use method "dop853" or "rkg"')
    if criterion not in MAY_PULL:
        raise InputError(f"separation criterion {criterion!r}: expected {' or '.join(MAY_PULL)}")
    steps, n = steps_per_revolution, len(train.mass)
    h = 2 * np.pi / cam_speed / steps
    angle = np.linspace(-np.pi, np.pi, steps + 1)
    cam = np.stack([lift(angle, k) * cam_speed**k for k in range(4)], axis=1)
    transitions = _Transitions(train, h, exponential)

    def revolve(state: np.ndarray) -> Response:
        states = np.empty((steps + 1, 2 * n))
        states[0] = state
        force = np.empty((steps + 1, len(train.a)))
        step = 0
        while step <= steps:
            step, missing = _march(step, states, force, cam, MAY_PULL[criterion], transitions.arrays())
            if missing >= 0:
                transitions.build(missing)
        return Response(train, cam_speed, angle, cam[:, 0], states[:, :n], states[:, n:], force)

    return revolve


class _Matrices(NamedTuple):
    """The elements, and the matrices of every closed set that has occurred, by `slot` of its bit mask."""

    rows: np.ndarray  # (e, n) compression of each element by position
    contact: np.ndarray  # (e)
    cam_driven: np.ndarray  # (e) 1.0 or 0.0
    stiffness: np.ndarray  # (e)
    damping: np.ndarray  # (e)
    preload: np.ndarray  # (e)
    gap: np.ndarray  # (e)
    slot: np.ndarray  # (2^contacts), -1 where nothing is built
    by_state: np.ndarray  # (s, 2n, 2n)
    by_cam: np.ndarray  # (s, 2n, 5)


class _Transitions:
    """Transition matrices of one train and step, by the bit mask of closed contacts."""

    def __init__(self, train: Train, h: float, exponential: bool):
        self.train, self.h, self.exponential = train, h, exponential
        self.rows = _incidence(train)
        self.slot = np.full(2 ** int(train.contact.sum()), -1)
        n = len(train.mass)
        self.by_state = np.zeros((0, 2 * n, 2 * n))
        self.by_cam = np.zeros((0, 2 * n, 5))

    def arrays(self) -> _Matrices:
        t = self.train
        elements = t.contact, t.cam_driven.astype(float), t.stiffness, t.damping, t.preload, t.gap
        return _Matrices(self.rows, *elements, self.slot, self.by_state, self.by_cam)

    def build(self, mask: int) -> None:
        """Matrices of one closed set: state (2n, 2n), and cam (2n, 5) on 1, lift and its three time derivatives."""
        t, n = self.train, len(self.train.mass)
        closed = ~t.contact
        closed[t.contact] = mask >> np.arange(int(t.contact.sum())) & 1 == 1
        rows = self.rows[closed]
        stiffness = rows.T @ (t.stiffness[closed, None] * rows)
        damping = rows.T @ (t.damping[closed, None] * rows) + np.diag(t.mass_damping)
        constant = t.mass_force - rows.T @ (t.preload - t.stiffness * t.gap)[closed]
        by_lift = -rows.T @ (t.stiffness * t.cam_driven)[closed]
        by_rate = -rows.T @ (t.damping * t.cam_driven)[closed]
        matrix = _exact if self.exponential else _printed
        blocks = matrix(np.diag(1 / t.mass), damping, stiffness, self.h)
        of_force = [blocks[:, (2 + j) * n : (3 + j) * n] for j in range(3)]
        cam = np.zeros((2 * n, 5))
        cam[:, 0] = of_force[0] @ constant
        for j, block in enumerate(of_force):  # the force's derivative j reads the lift's derivatives j and j + 1
            cam[:, 1 + j] += block @ by_lift
            cam[:, 2 + j] += block @ by_rate
        self.slot[mask] = len(self.by_state)
        self.by_state = np.concatenate([self.by_state, blocks[None, :, : 2 * n].copy()])
        self.by_cam = np.concatenate([self.by_cam, cam[None]])


def _incidence(train: Train) -> np.ndarray:
    """Compression of each element by position, shape (e, n)."""
    rows = np.zeros((len(train.a), len(train.mass)))
    for e, (a, b) in enumerate(zip(train.a, train.b, strict=True)):
        if a != GROUND:
            rows[e, a] += 1.0
        if b != GROUND:
            rows[e, b] -= 1.0
    return rows


def _printed(inverse_mass, damping, stiffness, h: float) -> np.ndarray:
    """Eq. (14): (x, v) after a step from (x, v, F, F', F''), shape (2n, 5n)."""
    n = len(stiffness)
    x, v, *force = np.split(np.eye(5 * n), 5)
    derivatives = [x, v]
    for f in force:
        derivatives.append(inverse_mass @ (f - damping @ derivatives[-1] - stiffness @ derivatives[-2]))
    series = [h**j / math.factorial(j) for j in range(5)]
    position = sum(s * d for s, d in zip(series, derivatives, strict=True))
    velocity = sum(s * d for s, d in zip(series[:4], derivatives[1:], strict=True))
    return np.concatenate([position, velocity])


def _exact(inverse_mass, damping, stiffness, h: float) -> np.ndarray:
    """As `_printed`, exact in x and v for a force of second degree in time."""
    n = len(stiffness)
    system = np.zeros((5 * n, 5 * n))
    system[:n, n : 2 * n] = np.eye(n)
    system[n : 2 * n, : 3 * n] = np.hstack([-inverse_mass @ stiffness, -inverse_mass @ damping, inverse_mass])
    system[2 * n : 4 * n, 3 * n :] = np.eye(2 * n)
    return expm(h * system)[: 2 * n]


@compiled
def _closed_set(y, cam, may_pull, m, force):
    """Bit mask of the closed contacts in a state, compressed and pushing or `may_pull`; forces go into `force` (e)."""
    n = len(y) // 2
    mask, bit = 0, 1
    for e in range(len(m.contact)):
        d, d_rate = m.cam_driven[e] * cam[0] - m.gap[e], m.cam_driven[e] * cam[1]
        for i in range(n):
            d += m.rows[e, i] * y[i]
            d_rate += m.rows[e, i] * y[n + i]
        p = m.preload[e] + m.stiffness[e] * d
        f = p + m.damping[e] * d_rate
        if m.contact[e]:
            if p > 0.0 and (f > 0.0 or may_pull):
                mask |= bit
            else:
                f = 0.0
            bit <<= 1
        force[e] = f
    return mask


@compiled
def _march(start, states, force, cam, may_pull, m):
    """Steps from sample `start` on; returns the sample reached and the set whose matrices are missing, or -1."""
    last = len(states) - 1
    for step in range(start, last + 1):
        y = states[step]
        mask = _closed_set(y, cam[step], may_pull, m, force[step])
        if step == last:
            break
        if m.slot[mask] < 0:
            return step, mask
        state_matrix, cam_matrix = m.by_state[m.slot[mask]], m.by_cam[m.slot[mask]]
        for i in range(len(y)):
            total = cam_matrix[i, 0]
            for j in range(4):
                total += cam_matrix[i, 1 + j] * cam[step, j]
            for j in range(len(y)):
                total += state_matrix[i, j] * y[j]
            states[step + 1, i] = total
    return last + 1, -1
