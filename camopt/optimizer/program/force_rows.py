"""Forces of the closed contacts at one speed, affine in a free cam's coefficients, and the windows where they count."""

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
"""Kinds of force rows: cam side before and after the middle, seat, and the cam side's largest force."""
DAMPED = 1 - 1e-9
"""Largest factor by which a revolution may multiply a disturbance: without damping it is 1 to round-off, on either
side. At this one a disturbance would take a million revolutions and more to lose a thousandth."""
NEXT = 1 * DEG
"""Largest angle between a row of a contact and its next one; a wider one lies where it may open."""
AFTER_TOP, BEFORE_SEAT = 2 * DEG, 4 * DEG
"""Where the forces on the cam side count: from behind the opening ramp top to ahead of the seat's closing."""
AFTER_SEAT, BEFORE_LASH = 12 * DEG, 6 * DEG
"""Where that on the seat counts: from behind its closing to ahead of the lash's closing in the next revolution. Between
them ring the impacts that close lash and seat, which no cam can help."""


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
    """Free coefficients no further from `centre` (m) than `width`, in each of them: where linear rows are believed."""

    centre: np.ndarray
    width: float


def averaged(block: SpeedRows, beside: int) -> SpeedRows:
    """The block with each force the mean of its own and those at so many angles on either side, reflected where the
    rows of a contact begin and end; the largest forces stay as they are."""
    peak = block.kind == PEAK
    ends = (np.diff(block.element) != 0) | np.diff(peak) | (np.abs(np.diff(block.angle)) > NEXT)
    rows = np.column_stack([block.matrix, block.offset])
    for run in np.split(np.arange(len(rows)), np.flatnonzero(ends) + 1):
        if len(run) and not peak[run[0]]:
            rows[run] = uniform_filter1d(rows[run], 2 * beside + 1, axis=0, mode="reflect")
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
    parts = []
    for e in train.cam_side:
        force, own = response.force(e, lifted), (np.full(len(lifted), e), theta[lifted])
        parts.append((force, np.where(theta[lifted] < 0, OPENING, CLOSING), *own))
        if design.contact_force_max_N is not None:
            parts.append((force, np.full(len(lifted), PEAK), *own))
    own = np.full(len(seated), train.seat), theta[seated]
    parts.append((response.force(train.seat, seated), np.full(len(seated), SEAT), *own))
    force, kind, element, angle = (np.concatenate(part) for part in zip(*parts, strict=True))
    return SpeedRows(cam_speed, angles, np.ascontiguousarray(force[:, 1:]), force[:, 0], kind, element, angle)
