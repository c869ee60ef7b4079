"""Static equilibrium on the base circle, as the minimum of the elements' energy, and linearisation of a train about it.

Every elastic force rises with its compression and contacts only push, so the energy is convex, and piecewise quadratic
under linear laws. Newton's method therefore converges after a few changes of the set of closed contacts, however many
there are (Qi and Sun 1993, Mathematical Programming 58, for the nonsmooth method; Armijo's step halving).
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from camopt.scene.errors import InputError
from camopt.scene.laws import FRICTION
from camopt.scene.train import Train, kept_with_train

FORCE_SLACK = 1e-9
"""Relative tolerance on forces and separations at rest; a contact exactly at its touch may count as open or closed."""
HELD = 1e-11
"""Least eigenvalue of the scaled stiffness matrix at which every mass counts as held."""
NAMED_SHARE = 0.1
"""Component of an unsupported direction, relative to its largest one, from which a mass is named in the error."""
MOST_CONTACTS = 39
"""Largest number of contacts: event-exact numbers the sets of contact states in 64 bits, three states each."""
MOST_NEWTON_STEPS = 200
"""Largest number of Newton steps to the rest position; ten are usual."""
NOT_FOUND = (
    f"no static equilibrium on the base circle was found in {MOST_NEWTON_STEPS} steps: check preloads, gaps and, under "
    f"nonlinear laws, stiffness tables"
)
GROUNDING = 1e-12
"""Stiffness to ground that a Newton step adds, relative to the largest stiffness of the train."""


def static_matrices(train: Train, closed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness matrix (n, n) [N/m] and load (n) [N] at zero lift of the acting elements (e) without a memory."""
    acting = np.setdiff1d(np.flatnonzero(closed), train.memory)
    rows, k = train.incidence[acting], train.stiffness[acting]
    load = train.mass_force - rows.T @ (train.preload[acting] - k * train.gap[acting])
    return rows.T @ (k[:, None] * rows), load


def rest_position(train: Train) -> np.ndarray:
    """Positions at rest on the base circle [m], shape (n). Raises InputError if a mass is not held, or if none is
    found."""
    return _rest_of(train).copy()


@kept_with_train
def _rest_of(train: Train) -> np.ndarray:
    """`rest_position`, cached because tables, modes and initial states of a train all need it."""
    contacts = int(np.sum(train.contact))
    if contacts > MOST_CONTACTS:
        raise InputError(
            f"the scene has {contacts} contacts and at most {MOST_CONTACTS} are supported: "
            f"merge stiff parts into one mass"
        )
    without = np.isin(np.arange(len(train.a)), train.memory)
    linear = replace(train, laws=None, stiffness=np.where(without, 0.0, train.stiffness))
    x, converged = _equilibrium(linear, np.zeros(len(train.mass)))
    force = train.preload + train.stiffness * train.compression(x, 0.0)
    closed = ~train.contact | (force > FORCE_SLACK * max(np.max(np.abs(force)), 1.0))
    stiffness, load = static_matrices(train, closed)
    scale = np.sqrt(np.maximum(np.diag(stiffness), np.max(train.stiffness) * 1e-12))
    values, vectors = np.linalg.eigh(stiffness / np.outer(scale, scale))
    if values[0] < HELD:
        share = np.abs(vectors[:, 0] / scale)  # of each mass in the direction without stiffness
        names = sorted(train.mass_names[i] for i in np.flatnonzero(share > NAMED_SHARE * share.max()))
        raise InputError(
            f"nothing holds the valve train at rest on the base circle (mass: {', '.join(names)}): "
            f"give that mass a force_N that presses it on, or a spring"
        )
    if not converged:
        raise InputError(NOT_FOUND)
    x = np.linalg.solve(stiffness / np.outer(scale, scale), load / scale) / scale
    if train.laws is None:
        return x
    x, converged = _equilibrium(train, x)
    if not converged:
        raise InputError(NOT_FOUND)
    return x


def state_at_rest(train: Train) -> np.ndarray:
    """State (2n + r: [m], [m/s], [m]) at rest on the base circle with all memories relaxed: the plunger spring alone
    carries an adjuster, and friction exerts no force. Raises InputError if there is no equilibrium."""
    position = rest_position(train)
    memory = train.compression(position, 0.0)[list(train.memory)]
    return np.concatenate([position, np.zeros_like(position), memory])


def static_forces(train: Train, lift: np.ndarray) -> np.ndarray:
    """Forces of the elements (k, e) [N] with the cam at rest at lifts (k) [m]; errors as for `rest_position`."""
    forces, (heights, where) = [], np.unique(lift, return_inverse=True)  # all angles on the base circle share one lift
    for height in heights:
        d = train.compression(rest_position(replace(train, gap=train.gap - train.cam_driven * height)), height)
        force = train.preload + train.stiffness * d if train.laws is None else train.laws.force(d, train.preload)
        forces.append(np.where(train.contact, np.maximum(force, 0.0), force))
    return np.array(forces)[where]


def _equilibrium(train: Train, x: np.ndarray) -> tuple[np.ndarray, bool]:
    """(positions (n) [m], whether forces balance there) by Newton's method on the convex energy from positions x (n),
    its step halved while it overshoots. A small stiffness to ground keeps the matrix regular with open contacts."""
    rows = train.incidence

    def residual(x):
        d = train.compression(x, 0.0)
        if train.laws is None:
            p, tangent = train.preload + train.stiffness * d, train.stiffness
        else:
            p, tangent = train.laws.force(d, train.preload), train.laws.tangent(d, train.preload)
        open_ = train.contact & (p <= 0.0)
        return train.mass_force - rows.T @ np.where(open_, 0.0, p), np.where(open_, 0.0, tangent)

    slack = FORCE_SLACK * max(np.abs(train.preload).max(), np.abs(train.mass_force).max(), 1.0)
    force, tangent = residual(x)
    for _ in range(MOST_NEWTON_STEPS):
        if np.abs(force).max() <= slack:
            return x, True
        stiffness = rows.T @ (tangent[:, None] * rows) + np.eye(len(x)) * GROUNDING * train.stiffness.max()
        step = np.linalg.solve(stiffness, force)
        accepted = -0.1 * abs(force @ step)
        force, tangent = residual(x + step)
        while force @ step < accepted:
            step = step / 2
            force, tangent = residual(x + step)
        x = x + step
    return x, False


NO_STIFFNESS = 1.0
"""Stiffness [N/m] that replaces a friction element; it is negligible beside any other stiffness of a train."""


def is_linear(train: Train) -> bool:
    """Whether every law of a train is linear and the cam is its only excitation."""
    return train.laws is None and not train.forcing


@lru_cache(maxsize=64)
def linearised_at_rest(train: Train) -> Train:
    """The train with linear laws, by `Laws.stand_in`; oil does not leak, and friction has almost no stiffness."""
    laws = train.laws
    if laws is None:
        return replace(train, forcing=()) if train.forcing else train
    stiffness = np.where(laws.kind == FRICTION, NO_STIFFNESS, train.stiffness)
    at_rest = train.compression(rest_position(train), 0.0)
    preload = np.where(laws.has_memory, -stiffness * at_rest, train.preload)
    losing = laws.dissipation * np.maximum(laws.force(at_rest, train.preload), 0.0)  # of p (1 + dissipation d')
    return replace(train, laws=None, forcing=(), stiffness=stiffness, preload=preload, damping=train.damping + losing)
