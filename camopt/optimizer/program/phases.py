"""The phases of a motion whose contacts switch at given cam angles, and the tangents of nonlinear laws along a motion.

The phases are seated, shared (seat and cam side both loaded) and lifted. This module determines the contacts that act
in each phase, and the angles of the quasi-static load transfer between them. Laws that are not linear are replaced by
their tangents along a motion. With the tangents, and with forces that repeat with the cam angle, the periodic motion is
affine in the cam again, as long as the pieces of the laws are traversed at the same angles. The program is therefore
linearised and solved repeatedly until it converges.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PPoly

from camopt.cam.families.free import FreeCam
from camopt.cam.ramps import Ramp
from camopt.scene.errors import NoCamFound
from camopt.scene.laws import CURVED, FRICTION, LINEAR, OF_CONTACTS, OIL
from camopt.scene.response import Response
from camopt.scene.rest import is_linear, linearised_at_rest, rest_position, static_forces, static_matrices
from camopt.scene.train import Train, kept_with_train
from camopt.scene.units import MM

SEAT_LOAD_N = 250.0
"""Force on the seat at rest [N] in the reference train to which the forces of searches refer."""
HELD_N = 20.0
"""Default margin of contact forces [N] in the reference train, used for instance until tangents have converged. The
tangent of a contact law is never softer than at this force: along a motion with separation, tangents without stiffness
would make the motion with closed contacts grow."""
LEVELS = 20
"""Levels per factor of e to which tangents of curved laws are rounded, so that steps share matrix exponentials."""


@kept_with_train
def force_unit(train: Train) -> float:
    """Factor on the forces of searches [N] in a train: its load on the seat over SEAT_LOAD_N, rounded to 1, 3, 10 and
    so on, since only the order of magnitude matters."""
    load = float(static_forces(train, np.zeros(1))[0, train.seat]) if train.seat >= 0 else 0.0
    powers, half = divmod(round(2.0 * np.log10(load / SEAT_LOAD_N)), 2) if load > 0.0 else (0, 0)
    return 10.0**powers * (3.0 if half else 1.0)


def usual_margin(train: Train) -> float:
    """The default margin of contact forces [N] in a train: HELD_N times its `force_unit`."""
    return HELD_N * force_unit(train)


@dataclass(frozen=True, eq=False)
class Tangents:
    """Tangents force = stiffness * compression + load of every element (e) at k ascending angles [rad] of a revolution,
    with the train's damping. `push` are the forces (k, n) [N] on the masses that repeat with the cam angle."""

    angle: np.ndarray
    stiffness: np.ndarray  # (k, e) N/m
    load: np.ndarray  # (k, e) N
    push: np.ndarray  # (k, n) N

    def at(self, theta: np.ndarray) -> np.ndarray:
        """Indices (j) of the samples that apply at angles theta (j) [rad]."""
        return np.clip(np.searchsorted(self.angle, theta), 0, len(self.angle) - 1)


def tangents_along(response: Response) -> Tangents | None:
    """The tangents along one revolution of a motion; None for a linear train."""
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
    if laws.kind[e] in OF_CONTACTS:  # a curved contact has no stiffness where it only just touches
        law = laws.contact_law(e)
        stiffness = np.maximum(stiffness, law.slope(law.depth(usual_margin(train))))
    if laws.dissipation[e] > 0.0:  # the law's damping force is a load along this motion, exact at convergence
        force = response.force[:, e]
    if laws.kind[e] in CURVED:
        stiffness = np.exp(np.round(np.log(stiffness) * LEVELS) / LEVELS)
    return stiffness, force - stiffness * d


SEATED, SHARED, LIFTED = range(3)


@dataclass(frozen=True)
class Angles:
    """Cam angles [rad] at which the phases change: the lash closes, the seat opens, the seat closes, the lash opens.
    The `tangents` replace laws that are not linear; without them these laws are linearised at rest."""

    lash_closes: float
    seat_opens: float
    seat_closes: float
    lash_opens: float
    tangents: Tangents | None = None

    def __post_init__(self):
        order = (-np.pi, self.lash_closes, self.seat_opens, self.seat_closes, self.lash_opens, np.pi)
        if not (np.all(np.diff(order) >= 0) and self.seat_opens < self.seat_closes):
            raise ValueError(f"switching angles must ascend within a revolution (given: {self})")

    def phase(self, theta: np.ndarray) -> np.ndarray:
        """Phase at angles theta [rad]."""
        shared = (theta > self.lash_closes) & (theta < self.lash_opens)
        lifted = (theta > self.seat_opens) & (theta < self.seat_closes)
        return np.where(lifted, LIFTED, np.where(shared, SHARED, SEATED))


def phase_contacts(train: Train) -> np.ndarray:
    """Whether each element acts in each phase, shape (3, e): seated (as at rest), shared, lifted. Raises NoCamFound
    where more than one contact between cam and valve is open at rest."""
    train = linearised_at_rest(train)
    x = rest_position(train)
    margin = train.compression(x, 0.0) - train.touch_compression
    seated = ~train.contact | (margin >= -1e-12)  # a contact that just touches, up to round-off, counts as closed
    opened = [train.element_names[e] for e in train.cam_side if not seated[e]]
    if len(opened) > 1:
        raise NoCamFound(f"the no-jump program needs the lash at one contact; open at rest: {', '.join(opened)}")
    shared = seated.copy()
    shared[list(train.cam_side)] = True
    lifted = shared.copy()
    lifted[train.seat] = False
    return np.stack([seated, shared, lifted])


def static_angles(train: Train, cam: FreeCam) -> Angles:
    """Switching angles of the quasi-static load transfer on the ramps; raises NoCamFound where a ramp is too low."""
    train = linearised_at_rest(train)
    seated, shared, _ = phase_contacts(train)
    opening = _lift_at_touch(train, shared, train.seat)
    lash = [e for e in train.cam_side if not seated[e]]
    closing = _lift_at_touch(train, seated, lash[0]) if lash else opening
    half = float(cam.breaks[-1])
    at = ", ".join(train.element_names[e] for e in lash) or train.element_names[train.seat]
    before = [_before_top(cam.opening, lift, "opening", at) for lift in (closing, opening)]
    after = [_before_top(cam.closing, lift, "closing", at) for lift in (opening, closing)]
    return Angles(-half - before[0], -half - before[1], half + after[0], half + after[1])


def _lift_at_touch(train: Train, closed: np.ndarray, element: int) -> float:
    """Lift [m] at which `element` touches without force in static equilibrium with the elements `closed`."""
    stiffness, load = static_matrices(train, closed)
    driven = train.incidence.T @ (train.stiffness * train.cam_driven * closed)
    scale = 1.0 / np.sqrt(np.diag(stiffness))
    x = scale[:, None] * np.linalg.solve(
        stiffness * scale * scale[:, None], scale[:, None] * np.column_stack([load, -driven])
    )
    row = train.incidence[element]
    rate = row @ x[:, 1] + train.cam_driven[element]
    touch = train.touch_compression[element]
    return float((touch + train.gap[element] - row @ x[:, 0]) / rate)


def _before_top(ramp: Ramp, lift: float, side: str, contact: str) -> float:
    """Angle [rad] before the ramp top at which the ramp reaches `lift` [m]; `contact` is the element with the lash."""
    if not 0 < lift < ramp.height:
        direction, remedy = ("smaller", "a higher ramp_height_mm") if lift > 0 else ("larger", "a smaller preload")
        raise NoCamFound(
            f"the load moves from seat to cam at {lift / MM:.4g} mm of lift, which must lie on the {side} ramp, "
            f"between 0 and {ramp.height / MM:g} mm: give {contact} a {direction} gap_mm, or the scene {remedy}"
        )
    borders, pieces = ramp.opening_pieces(0.0)
    keep = np.append(True, np.diff(borders) > 0)  # a ramp without foot has an empty piece
    roots = PPoly(pieces[keep[1:], ::-1].T, borders[keep]).solve(lift, extrapolate=False)
    return -float(roots[np.isfinite(roots)][0])
