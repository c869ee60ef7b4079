"""Linearisation of a train about its rest state."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from camopt.scene.laws import FRICTION
from camopt.scene.rest import rest_position
from camopt.scene.train import Train

NO_STIFFNESS = 1.0
"""Stiffness [N/m] that stands for an element which rubs: next to nothing beside any other of a train."""


def is_linear(train: Train) -> bool:
    """Whether every force of a train is linear and nothing acts on it but the cam."""
    return train.laws is None and not train.forcing


@lru_cache(maxsize=64)
def linearised_at_rest(train: Train) -> Train:
    """The train with a linear law in place of every other: itself, where it has none.

    Tables and curved laws count with their tangents at rest, or `Laws.stand_in`; oil does not leak; nothing rubs.
    """
    laws = train.laws
    if laws is None:
        return replace(train, forcing=()) if train.forcing else train
    stiffness = np.where(laws.kind == FRICTION, NO_STIFFNESS, train.stiffness)
    at_rest = train.compression(rest_position(train), 0.0)
    preload = np.where(laws.has_memory, -stiffness * at_rest, train.preload)
    losing = laws.dissipation * np.maximum(laws.force(at_rest, train.preload), 0.0)  # of p (1 + dissipation d')
    return replace(train, laws=None, forcing=(), stiffness=stiffness, preload=preload, damping=train.damping + losing)
