"""Straight lines that stand for a real train's elements along a motion, so that the no-jump program stays linear.

Along a motion every element is on one piece of its law: on a row of its table, with the ball of its adjuster open or
shut, sticking or sliding. There its force is a straight line of its compression; where the law is curved the tangent is
taken. With these lines, and the forces that repeat with the cam angle, the periodic motion is affine in the cam again.
It is exact as long as the pieces are met at the same angles, so the program is solved again until it stands.
"""

from dataclasses import dataclass

import numpy as np

from camopt.scene.laws import CURVED, FRICTION, LINEAR, OF_CONTACTS, OIL
from camopt.scene.response import Response
from camopt.scene.rest import is_linear
from camopt.scene.train import Train

HELD_N = 20.0
"""Contact force that the program's cam keeps while its tangents are looked for. No tangent of a law of contacts is
softer than there: along a motion that parts, tangents without stiffness would let the motion of closed contacts
grow."""
LEVELS = 20
"""Tangents of curved laws are rounded to so many levels in each factor of e, so that steps share their exponentials."""


@dataclass(frozen=True, eq=False)
class Tangents:
    """force = stiffness * compression + load of every element (e), at k ascending angles [rad] in a revolution; the
    damping is the train's. `push` are the forces (k, n) [N] on the masses that repeat with the cam angle."""

    angle: np.ndarray
    stiffness: np.ndarray  # (k, e) N/m
    load: np.ndarray  # (k, e) N
    push: np.ndarray  # (k, n) N

    def at(self, theta: np.ndarray) -> np.ndarray:
        """Indices (j) of the samples that hold at angles theta (j) [rad]."""
        return np.clip(np.searchsorted(self.angle, theta), 0, len(self.angle) - 1)


def tangents_along(response: Response) -> Tangents | None:
    """The tangents along one revolution of a motion; None for a train that is linear anyway."""
    train, theta = response.train, response.angle
    if is_linear(train):
        return None
    d = train.compression(response.x, response.lift)
    stiffness, load = np.tile(train.stiffness, (len(theta), 1)), np.tile(train.preload, (len(theta), 1))
    if train.laws is not None:
        for e in np.flatnonzero(train.laws.kind != LINEAR):
            stiffness[:, e], load[:, e] = _lines(train, response, int(e), d[:, e])
    push = np.zeros((len(theta), len(train.mass)))
    for forcing in train.forcing:
        push[:, forcing.on] += forcing.at(theta)
    return Tangents(theta, stiffness, load, push)


def _lines(train: Train, response: Response, e: int, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness (k) and load (k) of element e, whose law is not linear, at compressions d (k)."""
    laws = train.laws
    assert laws is not None, "a linear train has no lines"
    if laws.kind[e] == OIL:
        z = response.memory[:, train.memory.index(e)]
        stiffness = np.where(d - z > laws.travel[e], laws.coefficient[e], 0.0)
        return stiffness, -stiffness * (z + laws.travel[e])
    if laws.kind[e] == FRICTION:
        force = response.force[:, e]
        stiffness = np.where(np.abs(force) < laws.slip[e] * (1.0 - 1e-9), laws.coefficient[e], 0.0)
        return stiffness, force - stiffness * d
    force, stiffness = laws.along(e, d, train.preload[e])
    if laws.kind[e] in OF_CONTACTS:  # it has no stiffness where it only just touches
        law = laws.contact_law(e)
        stiffness = np.maximum(stiffness, law.slope(law.depth(HELD_N)))
    if (
        laws.dissipation[e] > 0.0
    ):  # what the law damps is a load along this motion; where the program stands, it is exact
        force = response.force[:, e]
    if laws.kind[e] in CURVED:
        stiffness = np.exp(np.round(np.log(stiffness) * LEVELS) / LEVELS)
    return stiffness, force - stiffness * d
