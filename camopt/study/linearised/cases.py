"""The trains of which paths are taken, with the derivatives of their numbers and cams by each free number; the paths of
the closed periodic response of trains whose laws are straight, without JAX.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from camopt.cam.families.free import FreeCam, free_cam_of
from camopt.cam.lift import Lift
from camopt.measure.as_built import trains_as_built
from camopt.optimizer.free_numbers import FreeNumber, free_number
from camopt.optimizer.program.force_rows import damped_response
from camopt.optimizer.program.periodic import SAMPLE, sample_cam
from camopt.optimizer.program.phases import Angles, phase_contacts
from camopt.optimizer.program.relocation import NoLoadTransfer, located_angles, settled_revolution
from camopt.scene import InputError, Scene, Train, build_train
from camopt.scene.laws import FRICTION
from camopt.scene.rest import is_linear
from camopt.scene.units import RPM

STEP = 1e-4
"""Share by which a number moves to either side, of itself, or of one unit of its key where it is zero. A train's arrays
are in proportion to it, so that their differences are right to round-off; those of ramps are right to STEP squared."""
SAME_LIFT = 1e-9
"""Difference of lift [m] within which a cam is one of the scene's free cams."""
WHAT = "linearised with source 'exact'"
SETTLING = 40
"""Revolutions of event-exact from rest to the motion at whose angles contacts change."""


TrainAndCam = tuple[Train, Lift]
"""A train with the cam that is ground for it."""


@dataclass(frozen=True)
class LinearisedCase:
    """A train, and beside it by free number what it is a step below and a step above."""

    nominal: TrainAndCam
    steps: np.ndarray  # (f), in the keys' units
    beside: list[tuple[TrainAndCam, TrainAndCam]] = field(default_factory=list)


class LinearPaths(NamedTuple):
    """Of one train at s speeds, at k angles: column 0 the values, then their derivatives by m coefficients [mm/deg^2]
    and f numbers [the key's unit]."""

    force: np.ndarray  # (s, k, c, 1 + m + f) N
    gap: np.ndarray  # (s, k, c, 1 + m + f) m
    seat_gap: np.ndarray  # (s, k, 1 + m + f) m
    moved: np.ndarray  # (s) m, change of the positions over the revolution


def free_cam_in(scene: Scene, cam: Lift) -> tuple[FreeCam, np.ndarray]:
    """The free cam of a scene and the coefficients z (m) at which it is `cam`; raises InputError where there are
    none."""
    nearest = "by camopt.nearest_free_cam or one of camopt.free_cam(scene.design)"
    if cam.family != "free":
        raise InputError(f"linearised: the cam is of the family {cam.family!r}: take the nearest free one {nearest}")
    assert scene.design is not None, "it was asked for before"
    theta = np.linspace(-np.pi, np.pi, 721)
    try:
        free, z = free_cam_of(scene.design, cam)
        apart = np.abs(free.lift(z)(theta) - cam(theta)).max()
    except ValueError:  # as many coefficients as the scene's duration and these knots do not have
        apart = np.inf
    if not apart < SAME_LIFT:
        raise InputError(
            f"linearised: the cam has not the duration and ramps of scene {scene.name}: take the nearest one {nearest}"
        )
    return free, z


def cases_of(
    scene: Scene, cam: Lift, z: np.ndarray, trains: int, seed: int, free: Sequence[str]
) -> tuple[list[LinearisedCase], list[FreeNumber]]:
    """The train as designed, or so many drawn ones, with the free numbers of the names; z (m) is the cam's."""
    numbers = [free_number(scene, name) for name in free]
    if not trains:
        return [_case(scene, cam, z, numbers, lambda lift: lift)], numbers
    built = trains_as_built(scene, trains, seed=seed)
    return [_case(one.scene, cam, z, numbers, one.cam) for one in built], numbers


def _case(scene: Scene, cam: Lift, z: np.ndarray, numbers: Sequence[FreeNumber], ground) -> LinearisedCase:
    def built(moved: Scene) -> TrainAndCam:
        assert moved.design is not None
        return build_train(moved), ground(free_cam_of(moved.design, cam)[0].lift(z))

    at = [number.of(scene) for number in numbers]
    steps = np.array([STEP * (abs(value) or 1.0) for value in at])
    sides = [
        (built(number.put(scene, value - step)), built(number.put(scene, value + step)))
        for number, value, step in zip(numbers, at, steps, strict=True)
    ]
    return LinearisedCase((build_train(scene), ground(cam)), steps, sides)


def exact_paths(
    cases: Sequence[LinearisedCase], cam: FreeCam, cam_speeds: np.ndarray, angle: np.ndarray
) -> list[LinearPaths]:
    """The paths of every train at the cam speeds (s) [rad/s] and at multiples (k) of SAMPLE from -pi.

    Contacts change at the angles at which they do in the event-exact motion, which the derivatives hold.
    """
    by_train = []
    for case in cases:
        train, _ = case.nominal
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
        by_train.append(
            LinearPaths(*map(np.stack, zip(*(_at_speed(case, cam, w, angle) for w in cam_speeds), strict=True)))
        )
    return by_train


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
