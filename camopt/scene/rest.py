"""Static equilibrium on the base circle, found by going through the sets of closed contacts.

Under nonlinear laws, the rest of the linear stand-ins is where Newton's method starts.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from camopt.scene.errors import InputError
from camopt.scene.laws import Laws
from camopt.scene.train import GROUND, Train

FORCE_SLACK = 1e-9
"""Relative slack on forces and separations at rest: a contact exactly at its touch may count as closed or as open."""
MOST_STEPS = 200
"""Largest number of Newton steps to rest under nonlinear laws; ten are usual."""
GROUNDING = 1e-12
"""Stiffness to ground that a Newton step adds, relative to the largest stiffness of the train."""


def static_matrices(train: Train, closed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness matrix (n, n) [N/m] and load (n) [N] at lift zero when the elements `closed` (e) act."""
    n = len(train.mass)
    stiffness, load = np.zeros((n, n)), train.mass_force.copy()
    for e in np.flatnonzero(closed):
        row = _row(train, int(e))
        stiffness += train.stiffness[e] * np.outer(row, row)
        load -= row * (train.preload[e] - train.stiffness[e] * train.gap[e])
    return stiffness, load


def _row(train: Train, e: int) -> np.ndarray:
    """Derivative of the compression of element e by the positions, shape (n)."""
    row = np.zeros(len(train.mass))
    if train.a[e] != GROUND:
        row[train.a[e]] += 1.0
    if train.b[e] != GROUND:
        row[train.b[e]] -= 1.0
    return row


def rest_position(train: Train) -> np.ndarray:
    """Positions at rest on the base circle [m], shape (n).

    Raises InputError where a mass is not held, or where no set of closed contacts is in equilibrium.
    """
    if train.laws is not None:
        return _balanced(train, train.laws, rest_position(replace(train, laws=None)))
    contacts = np.flatnonzero(train.contact)
    if len(contacts) > 16:
        raise InputError(
            f"the scene has {len(contacts)} contacts and at most 16 are supported: merge stiff parts into one mass"
        )
    floating: set[int] = set()
    for states in product([True, False], repeat=len(contacts)):
        closed = ~train.contact
        closed[contacts] = states
        stiffness, load = static_matrices(train, closed)
        scale = np.sqrt(np.maximum(np.diag(stiffness), np.max(train.stiffness) * 1e-12))
        scaled = stiffness / np.outer(scale, scale)
        values, vectors = np.linalg.eigh(scaled)
        if values[0] < 1e-11:  # a direction that no spring or closed contact resists
            floating.add(int(np.argmax(np.abs(vectors[:, 0]))))
            continue
        x = np.linalg.solve(scaled, load / scale) / scale
        d = train.compression(x, 0.0)
        force = train.preload + train.stiffness * d
        slack = FORCE_SLACK * max(np.max(np.abs(force)), 1.0)
        if np.all(force[closed & train.contact] > slack) and np.all(force[~closed] <= slack):
            return x
    if floating:
        names = ", ".join(sorted(train.mass_names[i] for i in floating))
        raise InputError(
            f"nothing holds the valve train at rest on the base circle (mass: {names}): "
            f"give that mass a force_N that presses it on, or a spring"
        )
    raise InputError(
        "no static equilibrium on the base circle was found for any set of closed contacts: check preloads and gaps"
    )


def static_forces(train: Train, lift: np.ndarray) -> np.ndarray:
    """Forces of the elements (k, e) [N] where the cam stands still at lifts (k) [m]; zero in open contacts.

    The lift closes the gap of what the cam drives. Raises InputError as `rest_position` does.
    """
    forces = np.empty((len(lift), len(train.a)))
    for i, s in enumerate(lift):
        d = train.compression(rest_position(replace(train, gap=train.gap - train.cam_driven * s)), s)
        force = train.preload + train.stiffness * d if train.laws is None else train.laws.force(d, train.preload)
        forces[i] = np.where(train.contact, np.maximum(force, 0.0), force)
    return forces


def _balanced(train: Train, laws: Laws, x: np.ndarray) -> np.ndarray:
    """Rest under nonlinear laws, searched from the rest x (n) [m] of their linear stand-ins.

    Every elastic force rises with its compression, so that rest is the minimum of a convex energy. Newton's method
    finds it, with a step that is halved while it overshoots. A little stiffness to ground lets a step cross contacts
    that are open.
    """
    rows = np.stack([_row(train, e) for e in range(len(train.a))])

    def unbalanced(x):
        d = train.compression(x, 0.0)
        p = laws.force(d, train.preload)
        open_ = train.contact & (p <= 0.0)
        return train.mass_force - rows.T @ np.where(open_, 0.0, p), np.where(open_, 0.0, laws.tangent(d, train.preload))

    slack = FORCE_SLACK * max(np.abs(train.preload).max(), np.abs(train.mass_force).max(), 1.0)
    for _ in range(MOST_STEPS):
        force, tangent = unbalanced(x)
        if np.abs(force).max() <= slack:
            return x
        stiffness = rows.T @ (tangent[:, None] * rows) + np.eye(len(x)) * GROUNDING * train.stiffness.max()
        step = np.linalg.solve(stiffness, force)
        while unbalanced(x + step)[0] @ step < -0.1 * abs(force @ step):
            step = step / 2
        x = x + step
    raise InputError(
        f"no static equilibrium on the base circle was found in {MOST_STEPS} steps under the elements' nonlinear laws: "
        f"check preloads, gaps and stiffness tables"
    )
