"""The state at rest on the base circle, from which the judge's motion begins: Newton's method on the forces."""

import numpy as np

from camopt.verifier.outside.filed import GROUND, FiledElement, FiledTrain, OutsideRefused
from camopt.verifier.outside.forces import elastic

STEP = 1e-9
"""Compression [m] over which a stiffness is taken as a difference of forces."""
BALANCED = 1e-9
"""Force [N] that may be left over, per newton of the largest preload."""


def compression(e: FiledElement, x: np.ndarray, lift=0.0) -> np.ndarray:
    """Compression [m] of an element at positions x (..., n) [m] and lift (...) [m], less its gap."""
    ends = [0.0 * x[..., 0] if end == GROUND else x[..., end] for end in (e.a, e.b)]
    return ends[0] - ends[1] + e.driven * lift - e.gap


def at_rest(train: FiledTrain) -> np.ndarray:
    """Positions (n) [m] where all forces balance: no oil carries any, nothing rubs. Raises OutsideRefused."""
    acting = [e for e in train.elements if not e.has_memory]
    rows = np.zeros((len(acting), len(train.mass)))
    for i, e in enumerate(acting):
        for end, sign in ((e.a, 1.0), (e.b, -1.0)):
            if end != GROUND:
                rows[i, end] += sign

    def forces(x: np.ndarray, further: float = 0.0) -> np.ndarray:
        p = np.array([float(elastic(e, compression(e, x) + further, np.where)) for e in acting])
        return np.where([e.contact for e in acting], np.maximum(p, 0.0), p)

    def left(x: np.ndarray) -> np.ndarray:
        return np.array(train.load) - rows.T @ forces(x)

    x = np.zeros(len(train.mass))
    least = BALANCED * max(1.0, *(abs(e.preload) for e in acting), *map(abs, train.load))
    for _ in range(200):
        residual = left(x)
        if np.abs(residual).max() < least:
            return x
        tangent = (forces(x, STEP) - forces(x, -STEP)) / (2 * STEP)
        stiffness = rows.T @ (tangent[:, None] * rows)
        step = np.linalg.solve(stiffness + np.eye(len(x)) * 1e-12 * np.abs(stiffness).max(), residual)
        while left(x + step) @ step < -0.1 * abs(residual @ step):  # the energy is convex: shorten what overshoots
            step = step / 2
        x = x + step
    raise OutsideRefused("the judge from outside finds no state at rest on the base circle")
