"""Forces of the closed contacts at one speed, affine in a free cam's coefficients, in the windows with a constraint."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from camopt.optimizer.program.periodic import CamSamples, PeriodicResponse, periodic_response
from camopt.optimizer.program.phases import LIFTED, SEATED, Angles
from camopt.scene.design import Design
from camopt.scene.errors import NoCamFound
from camopt.scene.train import Train
from camopt.scene.units import DEG, RPM

OPENING, CLOSING, SEAT, PEAK = range(4)
"""Kinds of force rows: cam side before and after the middle, seat, and the largest force on the cam side."""
DAMPED = 1 - 1e-9
"""Largest factor by which a revolution may multiply a disturbance. Without damping the factor is 1 up to round-off of
either sign; with this value a disturbance takes more than a million revolutions to lose a thousandth."""
NEXT = 1 * DEG
"""Largest angle [rad] between two successive rows of a contact; it may open in a wider gap."""
AFTER_TOP, BEFORE_SEAT = 2 * DEG, 4 * DEG
"""Window on the cam side [rad]: from AFTER_TOP after the opening ramp's top to BEFORE_SEAT before the seat closes."""
AFTER_SEAT, BEFORE_LASH = 12 * DEG, 6 * DEG
"""Window on the seat [rad]: from AFTER_SEAT behind its closing to BEFORE_LASH ahead of the lash's next closing. Outside
the windows the forces ring with the impacts that close lash and seat, which no cam can avoid."""


@dataclass(frozen=True)
class SpeedRows:
    """Forces at one speed: force = offset + matrix @ z [N] of `element` at `angle` [rad], row by row; kind as above."""

    cam_speed: float
    angles: Angles
    matrix: np.ndarray  # (r, m)
    offset: np.ndarray  # (r)
    kind: np.ndarray  # (r) int
    element: np.ndarray  # (r) int
    angle: np.ndarray  # (r)


@dataclass(frozen=True)
class Box:
    """A trust region for linearised rows: each free coefficient differs from `centre` (m) by at most `width`."""

    centre: np.ndarray
    width: float


def averaged(block: SpeedRows, beside: int) -> SpeedRows:
    """The block with each force replaced by its mean with the forces at `beside` angles on either side, reflected where
    the rows of a contact begin and end. The rows of kind PEAK stay as they are."""
    peak = block.kind == PEAK
    last = (np.diff(block.element) != 0) | np.diff(peak) | (np.abs(np.diff(block.angle)) > NEXT)
    rows = np.column_stack([block.matrix, block.offset])
    for indices in np.split(np.arange(len(rows)), np.flatnonzero(last) + 1):
        if len(indices) and not peak[indices[0]]:
            rows[indices] = uniform_filter1d(rows[indices], 2 * beside + 1, axis=0, mode="reflect")
    return replace(block, matrix=np.ascontiguousarray(rows[:, :-1]), offset=rows[:, -1])


def damped_response(train: Train, samples: CamSamples, cam_speed: float, angles: Angles) -> PeriodicResponse:
    """The periodic motion at one speed [rad/s]; raises NoCamFound where it is unstable."""
    response = periodic_response(train, samples, cam_speed, angles)
    if response.spectral_radius > DAMPED:
        raise NoCamFound(
            f"the motion with closed contacts does not die away at {cam_speed / RPM:g} r/min of the camshaft: a "
            f"revolution multiplies a disturbance by {response.spectral_radius:.4g}; give elements or masses more "
            f"damping_N_s_per_m, or leave speeds near this one out of speeds_rpm and band_rpm"
        )
    return response


def speed_rows(train: Train, design: Design, samples: CamSamples, cam_speed: float, angles: Angles) -> SpeedRows:
    """The force rows of one speed [rad/s]; raises NoCamFound where the linear motion is unstable."""
    response = damped_response(train, samples, cam_speed, angles)
    theta, half = samples.edges, design.duration_deg / 2 * DEG
    begins, ends = max(angles.seat_opens, AFTER_TOP - half), angles.seat_closes - BEFORE_SEAT
    lifted = np.flatnonzero((theta >= begins - 1e-9) & (theta <= ends))
    closed = (theta >= angles.seat_closes + AFTER_SEAT) | (theta <= angles.lash_closes - BEFORE_LASH)
    seated = np.flatnonzero(closed & (angles.phase(theta) == SEATED))
    lifted = lifted[angles.phase(theta[lifted]) == LIFTED]
    on_cam_side = {e: response.force(e, lifted) for e in train.cam_side}
    on_seat = response.force(train.seat, seated)
    return joined_rows(train, design, (cam_speed, angles), theta[lifted], on_cam_side, theta[seated], on_seat)


def joined_rows(
    train: Train,
    design: Design,
    speed: tuple[float, Angles],
    theta: np.ndarray,
    forces: Mapping[int, np.ndarray],
    seated: np.ndarray,
    on_seat: np.ndarray,
) -> SpeedRows:
    """The force rows of one `speed`, a cam speed [rad/s] and its switching angles: from the `forces` (k, 1 + m) [N],
    affine in z, of each contact between cam and valve at `theta` (k) [rad], and those `on_seat` at `seated` [rad]."""
    kinds = [np.where(theta < 0, OPENING, CLOSING)]
    if design.contact_force_max_N is not None:
        kinds.append(np.full(len(theta), PEAK))
    parts = [(force, kind, np.full(len(theta), e), theta) for e, force in forces.items() for kind in kinds]
    parts.append((on_seat, np.full(len(seated), SEAT), np.full(len(seated), train.seat), seated))
    force, kind, element, angle = (np.concatenate(column) for column in zip(*parts, strict=True))
    return SpeedRows(*speed, np.ascontiguousarray(force[:, 1:]), force[:, 0], kind, element, angle)
