"""Forces of the tied contacts of trains as built with linear laws, from the periodic response in closed form."""

from collections.abc import Sequence

import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.measure.as_built import TrainAsBuilt
from camopt.optimizer.as_built.openings_program import STEP
from camopt.optimizer.program.force_rows import AFTER_TOP, BEFORE_SEAT
from camopt.optimizer.program.periodic import (
    LIFT_DERIVATIVES,
    CamSamples,
    PeriodicResponse,
    periodic_response,
    sample_cam,
)
from camopt.optimizer.program.phases import Angles, static_angles
from camopt.scene.errors import NoCamFound
from camopt.scene.train import Train

EDGES = STEP / 2
"""Longest step of the response [rad]. The cam's knots are edges, and forces are interpolated linearly between edges."""


def exact_forces(
    trains: Sequence[TrainAsBuilt], nominal: Train, cam: FreeCam, cam_speeds: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Angles (k) [rad], and the forces (t, s, c, k, 1 + m) [N] of drawn trains there, in single precision.

    The forces are those at z = 0 and per coefficient, and are valid for every cam. Train t has the cam speeds
    `cam_speeds[t % classes]` (classes, s) [rad/s].
    """
    top, angles = float(cam.breaks[0]), static_angles(nominal, cam)
    last = angles.seat_closes - BEFORE_SEAT - top
    theta = top + STEP * np.arange(np.ceil(AFTER_TOP / STEP - 1e-9), np.floor(last / STEP) + 1)
    shape = len(trains), cam_speeds.shape[1], len(nominal.cam_side), len(theta), 1 + cam.Z.shape[1]
    forces = np.empty(shape, dtype=np.float32)
    for t, built in enumerate(trains):
        _write_forces(forces[t], theta, built, cam, cam_speeds[t % len(cam_speeds)], angles)
    return theta, forces


def _write_forces(
    forces: np.ndarray, theta: np.ndarray, built: TrainAsBuilt, cam: FreeCam, cam_speeds: np.ndarray, nominal: Angles
) -> None:
    """Writes the forces of one train into its part (s, c, k, 1 + m) of the array."""
    try:
        angles = static_angles(built.train, cam)
    except NoCamFound:  # the lash exceeds the ramp height; event-exact evaluates the impact later
        angles = nominal
    samples = sample_cam(cam, angles, EDGES)
    error = _error_samples(built, cam, samples)
    at = np.searchsorted(samples.edges, theta)
    weight = (samples.edges[at] - theta) / (samples.edges[at] - samples.edges[at - 1])

    def read(response: PeriodicResponse, element: int) -> np.ndarray:
        low, high = response.force(element, at - 1), response.force(element, at)
        return high + weight[:, None] * (low - high)

    for s, cam_speed in enumerate(cam_speeds):
        plain = periodic_response(built.train, samples, cam_speed, angles)
        change = plain.to_error(error) if error else None
        for c, element in enumerate(built.train.cam_side):
            force = read(plain, element)
            if change:
                force[:, 0] += read(change, element)[:, 0]
            forces[s, c] = force


def _error_samples(built: TrainAsBuilt, cam: FreeCam, samples: CamSamples) -> CamSamples | None:
    """The grinding error of a cam between the same edges, as a Taylor polynomial on every step of the lobe; None where
    there is no error. The error's own knots lie within the steps, and only its fifth derivative is discontinuous there.
    """
    plain = cam.lift(np.zeros(cam.Z.shape[1]))
    ground = built.cam(plain)
    if ground is plain:
        return None
    edges = samples.edges
    lobe = np.flatnonzero((edges[:-1] >= ground.borders[1] - EDGES) & (edges[:-1] <= ground.borders[-2]))
    first = np.union1d(samples.first, lobe)
    begin = np.zeros((len(first), LIFT_DERIVATIVES + 1, 1))
    for order in range(LIFT_DERIVATIVES - 1):
        begin[:, order, 0] = ground(edges[first] + 1e-12, order) - plain(edges[first] + 1e-12, order)
    return CamSamples(edges, first, begin)
