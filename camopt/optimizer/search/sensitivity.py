"""Slopes of the limited metrics by the free cam's coefficients, from the settled states, by the event-exact adjoint.

A change of the cam also changes the settled state in which the traced revolutions begin. That effect is left out: on
`kodama` it has fallen to a fifth or less after two revolutions (spectral radius 0.32 to 0.44).
"""

from typing import Protocol

import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.exact.batch import value_and_gradient_many
from camopt.optimizer.search.judge import Judged
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

REVOLUTIONS = 2
"""Number of revolutions that run from the settled state; the last one is measured."""


class Sensitivity(Protocol):
    """Values and gradients of metrics by z at the judged speeds `rows`, of which there are at most `width`."""

    width: int

    def __call__(self, z: np.ndarray, judged: Judged, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...


class ExactSensitivity:
    """Values and gradients of metrics by z through the exact motion and its contacts, by the event-exact adjoint."""

    def __init__(self, scene: Scene, cam: FreeCam, names: tuple[str, ...], width: int):
        self.scene, self.cam, self.names, self.width = scene, cam, names, width
        self.train, (self.matrix, _) = build_train(scene), cam.piece_basis()

    def __call__(self, z: np.ndarray, judged: Judged, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Metrics (r, l) and gradients (r, l, m) at the judged speeds `rows`; NaN for a motion that is refused."""
        speeds = [self.scene.cam_speed(s) for s in judged.speeds_rpm[rows]]
        found = value_and_gradient_many(
            self.train, [self.cam.lift(z)] * len(rows), speeds, self.names, judged.states[rows],
            revolutions=REVOLUTIONS + 1, revolution=REVOLUTIONS - 1,
        )  # fmt: skip
        empty = np.full(len(self.names), np.nan), np.full((len(self.names), self.matrix.shape[2]), np.nan)
        answers = [
            empty if g is None else (g.values, np.tensordot(g.by_coefficients, self.matrix, axes=2)) for g in found
        ]
        return np.stack([a[0] for a in answers]), np.stack([a[1] for a in answers])


def path_of(gradient: str) -> str:
    """The path that `gradient` stands for: "auto" is the exact one, which takes every law."""
    return "exact" if gradient == "auto" else gradient
