"""Paths and slopes of the closed periodic response of trains whose laws are straight: without JAX."""

from collections.abc import Sequence

import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.optimizer.program.force_rows import damped_response
from camopt.optimizer.program.periodic import SAMPLE, sample_cam
from camopt.optimizer.program.phases import Angles, phase_contacts
from camopt.optimizer.program.relocation import NoLoadTransfer, located_angles, settled_revolution
from camopt.scene.errors import InputError
from camopt.scene.laws import FRICTION
from camopt.scene.linearisation import is_linear
from camopt.scene.units import RPM
from camopt.study.linearised.cases import LinearisedCase, LinearPaths, TrainAndCam

WHAT = "linearised with source 'exact'"
SETTLING = 40
"""Revolutions of event-exact from rest to the motion at whose angles contacts change."""


def exact_paths(
    cases: Sequence[LinearisedCase], cam: FreeCam, cam_speeds: np.ndarray, angle: np.ndarray
) -> list[LinearPaths]:
    """The paths of every train at the cam speeds (s) [rad/s] and at multiples (k) of SAMPLE from -pi.

    Contacts change at the angles at which they do in the event-exact motion, which the derivatives hold.
    """
    found = []
    for case in cases:
        train = case.nominal.train
        train.require_straight(WHAT, "ask for source='smooth'")
        if train.laws is not None and np.any(train.laws.kind == FRICTION):
            raise InputError(
                f"{WHAT} holds the place where friction sticks, which moves with the cam, and derivatives would be "
                f"wrong: ask for source='smooth'"
            )
        if case.beside and not is_linear(train):
            raise InputError(
                f"{WHAT} and free numbers needs a train whose laws are all linear and without forces by the cam angle: "
                f"ask for source='smooth', or leave free out"
            )
        found.append(
            LinearPaths(*map(np.stack, zip(*(_at_speed(case, cam, w, angle) for w in cam_speeds), strict=True)))
        )
    return found


def _at_speed(case: LinearisedCase, cam: FreeCam, cam_speed: float, angle: np.ndarray) -> LinearPaths:
    try:
        angles = located_angles(settled_revolution(*case.nominal, cam_speed, SETTLING))
    except NoLoadTransfer as missing:
        raise InputError(
            f"{WHAT} at {cam_speed / RPM:g} r/min of the camshaft: {missing}, which leaves the "
            f"closed response no phases: ask for source='smooth', or for another speed"
        ) from None
    own = _read(case.nominal, cam, cam_speed, angles, angle)
    by_number = [
        [(above - below)[..., :1] / (2 * step) for below, above in zip(*sides, strict=True)]
        for step, built in zip(case.steps, case.beside, strict=True)
        for sides in [[_read(one, cam, cam_speed, angles, angle) for one in built]]
    ]
    joined = (np.concatenate(parts, axis=-1) for parts in zip(own, *by_number, strict=True))
    return LinearPaths(*joined, moved=np.zeros(()))


def _read(
    built: TrainAndCam, cam: FreeCam, cam_speed: float, angles: Angles, angle: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Force (k, c, 1 + m) and gap of the contacts between cam and valve, and gap (k, 1 + m) at the seat."""
    train, lift = built
    samples = sample_cam(cam, angles, SAMPLE, about=lift)
    response = damped_response(train, samples, cam_speed, angles)
    at = np.searchsorted(samples.edges, angle - 1e-9)
    closed = phase_contacts(train)[angles.phase(angle)]
    force = np.stack([response.force(e, at) * closed[:, e, None] for e in train.cam_side], axis=1)
    touch = train.touch_compression
    gap = np.stack([response.gap(e, touch[e], at) for e in train.cam_side], axis=1)
    return force, gap, response.gap(train.seat, touch[train.seat], at)
