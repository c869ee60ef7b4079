"""Labelled paths of motions with tied contacts along a revolution, and their derivatives: rows for a user's programs.

The closed periodic response of trains with piecewise linear laws is computed here, without JAX; that of other trains in
`camopt.study.tied_motions`.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from camopt.cam.families.free import FreeCam
from camopt.cam.lift import Lift
from camopt.optimizer.program.force_rows import damped_response
from camopt.optimizer.program.periodic import SAMPLE, sample_cam
from camopt.optimizer.program.phases import Angles, phase_contacts
from camopt.optimizer.program.relocation import NoLoadTransfer, located_angles, settled_revolution
from camopt.scene import InputError, Scene
from camopt.scene.laws import FRICTION
from camopt.scene.rest import is_linear
from camopt.scene.smoothing import Smoothing, smoothing
from camopt.scene.units import DEG, MM, RPM, UM
from camopt.study.linearised.cases import LinearisedCase, LinearPaths, TrainAndCam, cases_of, free_cam_in

if TYPE_CHECKING:
    import xarray as xr

SOURCES = ("smooth", "exact")
LABELS = {
    "contact_force_N": ("N", "force between cam and valve"),
    "gap_mm": ("mm", "gap between cam and valve"),
    "seat_gap_mm": ("mm", "gap at the seat"),
}
EXACT = "linearised with source 'exact'"
SETTLING = 40
"""Event-exact revolutions from rest up to the motion whose switching angles the derivatives keep constant."""


@threadpool_limits.wrap(limits=1, user_api="blas")  # the matrices are too small for threads
def linearised(
    scene: Scene,
    cam: Lift,
    speeds_rpm: Sequence[float] | None = None,
    *,
    trains: int = 0,
    seed: int = 0,
    tie: float = 1.0,
    width_um: float = 1.0,
    source: str = "smooth",
    steps_per_revolution: int = 1440,
    free: Sequence[str] = (),
) -> "xr.Dataset":
    """Forces and gaps of the settled motion with tied contacts along a revolution, and their derivatives.

    A tied contact between cam and valve pulls where it would separate, within the event; in a train with lash, contacts
    that are closed at rest are tied at all angles. A force therefore has a derivative with respect to the cam
    everywhere, and a linear program can constrain its sign.

    The dataset has the dimensions speed_rpm (s crankshaft speeds, by default the scene's listed ones), cam_angle_deg
    (`steps_per_revolution` up to 180, by default every quarter of a degree) and contact (c, those between cam and
    valve). With `trains` it first has train, this many trains drawn within the scene's tolerances by `seed`, grinding
    errors included. Its variables are contact_force_N, gap_mm (negative where a contact is compressed), seat_gap_mm
    between the valve and its seat, and the derivatives of the three:

    - NAME_by_z along coefficient (m), with respect to the coefficients z [mm/deg^2] of the free cam, given in z;
    - NAME_by_number along number (f), with respect to the numbers that `free` names as `optimize --free` does, in their
      keys' units, given in number_value; those of a drawn train are taken at its own numbers.

    `moved_um` (speed_rpm) is the change of the positions over the revolution: the derivatives of a motion that has not
    settled hold for this revolution only.

    `source` "smooth" applies to any law: JAX differentiates a motion whose other contacts push across a layer of
    `width_um` [um] and whose contacts between cam and valve are tied by the share `tie` (0: the law of the scene).
    `source` "exact" is the closed periodic response of trains with piecewise linear laws and without friction, without
    a layer and with a tie of 1. Its contacts switch at the angles of the event-exact motion, which the derivatives keep
    constant, together with the pieces of the laws and the leakage of adjusters; a contact that hops on a ramp is held
    closed from its last closing on. With "exact", `free` requires linear laws.

    Raises InputError for unusable arguments, a cam that is not a free cam of the scene, an unknown name in `free`, and
    a train or motion that the source cannot treat.
    """
    speeds = _checked(scene, speeds_rpm, trains, seed, source)
    how = smoothing("linearised", width_um, tie, steps_per_revolution)
    if source == "exact" and (how.tie, how.steps) != (1.0, Smoothing().steps):
        raise InputError(
            f"linearised: tie {tie:g} with source 'exact' and {how.steps} steps_per_revolution: its contacts are tied "
            f"by 1 and read at {Smoothing().steps} angles: ask for 'smooth'"
        )
    free_cam, z = free_cam_in(scene, cam)
    cases, numbers = cases_of(scene, cam, z, trains, seed, (free,) if isinstance(free, str) else free)
    angle = np.linspace(-np.pi, np.pi, how.steps + 1)[1:]
    cam_speeds = np.array([scene.cam_speed(speed) for speed in speeds])
    if source == "exact":
        paths = exact_paths(cases, free_cam, cam_speeds, angle)
    else:
        from camopt.study.tied_motions import smooth_paths  # this source alone loads JAX

        paths = smooth_paths(cases, free_cam, cam_speeds, how)
    train, _ = cases[0].nominal
    contacts = [train.element_names[e] for e in train.cam_side]
    coords = {"speed_rpm": list(speeds), "cam_angle_deg": angle / DEG, "contact": contacts}
    attributes = {"scene": scene.name, "source": source, "trains": trains}
    attributes |= {"tie": float(tie), "width_um": float(width_um)} if source == "smooth" else {"tie": 1.0}
    dataset = _dataset(paths, len(z), [number.name for number in numbers], coords).assign_attrs(attributes)
    dataset["z"] = ("coefficient", z, {"units": "mm/deg^2"})
    dataset["number_value"] = ("number", [number.of(scene) for number in numbers])
    return dataset if trains else dataset.isel(train=0, drop=True)


def _dataset(trains: list[LinearPaths], m: int, numbers: list[str], coords: dict) -> "xr.Dataset":
    """The paths of all trains as a labelled dataset."""
    import xarray as xr  # loads pandas, which errors above do not need

    variables = {}
    for name, quantity, unit in zip(LABELS, LinearPaths._fields[:3], (1.0, MM, MM), strict=True):
        values = np.stack([getattr(paths, quantity) for paths in trains]) / unit
        over = ("train", "speed_rpm", "cam_angle_deg", "contact")[: values.ndim - 1]
        units, label = LABELS[name]
        variables[name] = (over, values[..., 0], {"units": units, "long_name": label})
        by_z, by_number = values[..., 1 : 1 + m], values[..., 1 + m :]
        variables[f"{name}_by_z"] = ((*over, "coefficient"), by_z, {"units": f"{units}/(mm/deg^2)"})
        variables[f"{name}_by_number"] = ((*over, "number"), by_number, {"units": f"{units} per unit of the number"})
    moved = np.stack([paths.moved for paths in trains]) / UM
    variables["moved_um"] = (("train", "speed_rpm"), moved, {"units": "um"})
    return xr.Dataset(variables, coords | {"train": np.arange(len(trains)), "number": numbers})


def _checked(scene: Scene, speeds_rpm, trains, seed, source) -> tuple[float, ...]:
    """The speeds [r/min]; checks every argument that is a number or a choice."""
    if source not in SOURCES:
        raise InputError(f"linearised: source {source!r}: expected one of {', '.join(SOURCES)}")
    if scene.design is None or scene.operation is None or scene.seat is None:
        raise InputError(f"scene {scene.name}: linearised needs valve, seat, [operation] and [design]")
    try:
        speeds = tuple(float(speed) for speed in (scene.operation.speeds_rpm if speeds_rpm is None else speeds_rpm))
    except (TypeError, ValueError):
        speeds = ()
    if not speeds or not all(np.isfinite(speed) and speed > 0 for speed in speeds):
        raise InputError(
            f"linearised: speeds_rpm {speeds_rpm!r}: expected crankshaft speeds above 0 r/min, such as (6000, 7000)"
        )
    if not all(isinstance(number, (int, np.integer)) and number >= 0 for number in (trains, seed)):
        raise InputError(f"linearised: trains {trains!r} of seed {seed!r}: expected integers from 0 on")
    return speeds


def exact_paths(
    cases: Sequence[LinearisedCase], cam: FreeCam, cam_speeds: np.ndarray, angle: np.ndarray
) -> list[LinearPaths]:
    """The paths of every train at the cam speeds (s) [rad/s] and at multiples (k) of SAMPLE from -pi."""
    by_train = []
    for case in cases:
        train, _ = case.nominal
        train.require_straight(EXACT, "ask for source='smooth'")
        if train.laws is not None and np.any(train.laws.kind == FRICTION):
            raise InputError(
                f"{EXACT} holds the place where friction sticks, which moves with the cam, and derivatives would be "
                f"wrong: ask for source='smooth'"
            )
        if case.beside and not is_linear(train):
            raise InputError(
                f"{EXACT} and free numbers needs a train whose laws are all linear and without forces by the cam "
                f"angle: ask for source='smooth', or leave free out"
            )
        at_speeds = [_at_speed(case, cam, speed, angle) for speed in cam_speeds]
        by_train.append(LinearPaths(*map(np.stack, zip(*at_speeds, strict=True))))
    return by_train


def _at_speed(case: LinearisedCase, cam: FreeCam, cam_speed: float, angle: np.ndarray) -> LinearPaths:
    try:
        angles = located_angles(settled_revolution(*case.nominal, cam_speed, SETTLING))
    except NoLoadTransfer as missing:
        raise InputError(
            f"{EXACT} at {cam_speed / RPM:g} r/min of the camshaft: {missing}, which leaves the "
            f"closed response no phases: ask for source='smooth', or for another speed"
        ) from None
    columns = [_read(case.nominal, cam, cam_speed, angles, angle)]
    for step, sides in zip(case.steps, case.beside, strict=True):
        below, above = (_read(side, cam, cam_speed, angles, angle) for side in sides)
        columns.append([(b - a)[..., :1] / (2 * step) for a, b in zip(below, above, strict=True)])
    joined = (np.concatenate(parts, axis=-1) for parts in zip(*columns, strict=True))
    return LinearPaths(*joined, moved=np.zeros(()))


def _read(pair: TrainAndCam, cam: FreeCam, cam_speed: float, angles: Angles, angle: np.ndarray) -> list[np.ndarray]:
    """Force and gap (k, c, 1 + m) of the contacts between cam and valve, and gap (k, 1 + m) at the seat."""
    train, lift = pair
    samples = sample_cam(cam, angles, SAMPLE, about=lift)
    response = damped_response(train, samples, cam_speed, angles)
    at = np.searchsorted(samples.edges, angle - 1e-9)
    closed = phase_contacts(train)[angles.phase(angle)]
    force = np.stack([response.force(e, at) * closed[:, e, None] for e in train.cam_side], axis=1)
    touch = train.touch_compression
    gap = np.stack([response.gap(e, touch[e], at) for e in train.cam_side], axis=1)
    return [force, gap, response.gap(train.seat, touch[train.seat], at)]
