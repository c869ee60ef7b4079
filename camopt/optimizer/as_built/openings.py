"""By how much a contact would open, foretold from the forces of a motion whose contacts are tied: linear in the cam.

A tied contact pulls with a force -f where a real one would part. From an angle a on it then opens by gap(b), minus the
integral from a to b of h(b - t) f(t) dt, with h the opening after a unit impulse on either side of it, of the train in
which it is open and the others stay closed. The forces are affine in the cam's coefficients, and so is the gap; the
largest one over all a and b is near the real jump where the contacts part once and come back, and says more of it than
the least force does: a force that pulls for a moment opens next to nothing.
"""

import numpy as np
from scipy.linalg import expm

from camopt.optimizer.program.phases import LIFTED, phase_contacts
from camopt.scene.rest import linearised_at_rest
from camopt.scene.train import Train
from camopt.scene.units import DEG

STEP = 1.0 * DEG
"""Step between the angles at which forces are read."""
LONG = np.array([6, 9, 12, 16, 20, 26, 34])
"""Steps over which a contact opens, from the first one that counts on: 6 to 34 degrees."""


def opening_after_impulse(train: Train, contact: int, step: float, count: int) -> np.ndarray:
    """Opening of a `contact` [m per N s] at 0, 1, ... `count` - 1 steps [s] after a unit impulse on either side of it.

    The train has this contact and the seat open and all others closed, with the laws that stand in for curved ones.
    """
    train = linearised_at_rest(train)
    closed = phase_contacts(train)[LIFTED].copy()
    closed[contact] = False
    d, n = train.incidence, len(train.mass)
    k, c = (closed * q for q in (train.stiffness, train.damping))
    rate = np.zeros((2 * n, 2 * n))
    rate[:n, n:] = np.eye(n)
    rate[n:, :n] = -(d.T * k @ d) / train.mass[:, None]
    rate[n:, n:] = -((d.T * c @ d) + np.diag(train.mass_damping)) / train.mass[:, None]
    state, whole = np.concatenate([np.zeros(n), d[contact] / train.mass]), expm(rate * step)
    opening = np.empty(count)
    for i in range(count):
        opening[i] = d[contact] @ state[:n]
        state = whole @ state
    return opening


def opening_rows(train: Train, contact: int, cam_speed: float, count: int) -> np.ndarray:
    """Rows (w, k, k) with gap = rows @ f [m] for forces f (k) [N] at `count` angles STEP apart, by the number of steps
    (w) over which it opens and the angle (k) at which that ends; by the trapezoidal rule."""
    after = opening_after_impulse(train, contact, STEP / cam_speed, LONG[-1] + 1)
    ends, at = np.arange(count)[:, None], np.arange(count)
    past = ends - at
    weight = np.where((past >= 0) & (past <= LONG[-1]), after[np.clip(past, 0, LONG[-1])], 0.0)
    rows = np.empty((len(LONG), count, count))
    for w, long in enumerate(LONG):
        first = np.maximum(ends - long, 0)
        rows[w] = np.where(at < first, 0.0, weight) * np.where((at == first) | (at == ends), 0.5, 1.0)
    return -STEP / cam_speed * rows


def contact_openings(train: Train, cam_speeds: np.ndarray, count: int) -> np.ndarray:
    """Rows (s, c, w * k, k) of the openings [m] of the contacts between cam and valve (c) at cam speeds (s) [rad/s], by
    their forces [N] at `count` angles (k) STEP apart."""
    found = [[opening_rows(train, e, w, count) for e in train.cam_side] for w in cam_speeds]
    return np.array(found).reshape(len(cam_speeds), len(train.cam_side), -1, count)
