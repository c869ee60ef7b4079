"""Smoothed motions with tied contacts by JAX, for any law: from rest, and settled with their derivatives."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.cam.lift import Lift
from camopt.scene import MotionRefused, Response, Train
from camopt.scene.smoothing import Smoothing
from camopt.scene.units import RPM
from camopt.smooth.grid import equal_grid
from camopt.smooth.periodic_slopes import Directions, TiedMotions
from camopt.smooth.simulate import lift_samples
from camopt.smooth.tied import TiedSystem, path_angles, tied_system
from camopt.study.linearised.cases import LinearisedCase, LinearPaths


def tied_motion(train: Train, lift: Lift, cam_speed: float, revolutions: int, smoothing: Smoothing) -> Response:
    """Motion from rest over `revolutions` with tied contacts; raises MotionRefused where it grows without bound."""
    motions = TiedMotions(train, np.array([cam_speed]), (-lift.half_duration, lift.half_duration), smoothing)
    steps, samples = smoothing.steps, jnp.asarray(lift_samples(lift, smoothing.steps))
    driven, states, forces = motions.driven(samples), [motions.rest[None]], []
    for _ in range(revolutions):
        states.append(motions.revolution(samples, states[-1][-1]).states)
        forces.append(driven.forces(path_angles(steps), states[-1]))
    if not bool(jnp.all(jnp.isfinite(states[-1]))):
        raise _unbounded(cam_speed, "or another speed")
    y, n = np.asarray(jnp.concatenate(states))[..., 0], len(train.mass)
    force = np.asarray(jnp.concatenate([forces[-1][-1:], *forces]))[..., 0]  # first row: force at the end
    angle = np.linspace(-np.pi, (2 * revolutions - 1) * np.pi, revolutions * steps + 1)
    return Response(train, cam_speed, angle, lift(angle), y[:, 0, :n], y[:, 1, :n], force, y[:, 0, n:])


def _unbounded(cam_speed: float, remedies: str) -> MotionRefused:
    return MotionRefused(
        f"the smoothed motion with tied contacts grows without bound at {cam_speed / RPM:g} r/min of the camshaft: "
        f"give a larger width_um, {remedies}"
    )


def smooth_paths(
    cases: Sequence[LinearisedCase], cam: FreeCam, cam_speeds: np.ndarray, smoothing: Smoothing
) -> list[LinearPaths]:
    """The settled paths of every train at the cam speeds (s) [rad/s] under a smoothing, and their derivatives."""
    event, steps, by_train = (-cam.breaks[-1], cam.breaks[-1]), smoothing.steps, []
    of_cases = [TiedMotions(case.nominal[0], cam_speeds, event, smoothing) for case in cases]
    basis, parts = cam.samples(equal_grid(steps))[0], max(motions.parts for motions in of_cases)
    for case, motions in zip(cases, of_cases, strict=True):
        motions.parts, samples = parts, lift_samples(case.nominal[1], steps)
        start, paths = motions.settled(samples)
        moved = np.abs(np.asarray(paths.end - start))[0].max(axis=0)
        if not np.all(np.isfinite(moved)):
            raise _unbounded(cam_speeds[~np.isfinite(moved)][0], "another speed, or more damping_N_s_per_m")
        along = _with_numbers(basis, case, motions.tied, steps) if len(case.steps) else Directions(basis)
        slopes = motions.slopes(samples, paths, along)
        values = paths.force, paths.gap, paths.seat_gap
        pairs = zip(values, slopes[:3], strict=True)
        joined = [np.concatenate([np.asarray(v)[..., None], s], axis=-1) for v, s in pairs]
        force, gap, seat_gap = (np.moveaxis(q, -2, 0) for q in joined)
        by_train.append(LinearPaths(force, gap, seat_gap, moved))
    return by_train


def _with_numbers(basis: np.ndarray, case: LinearisedCase, tied: TiedSystem, steps: int) -> Directions:
    """The directions of the cam's `basis` (k + 1, 2, m), followed by those of system and lift with each free number.
    The set of contacts closed at rest does not vary."""

    def slope(below, above, step):
        system = jax.tree.map(lambda a, b: (b - a) / (2 * step), tied_system(below[0]), tied_system(above[0]))
        samples = (lift_samples(above[1], steps) - lift_samples(below[1], steps)) / (2 * step)
        return samples, eqx.tree_at(lambda t: t.at_rest, system, jnp.zeros_like(tied.at_rest))

    pairs = [slope(*sides, step) for sides, step in zip(case.beside, case.steps, strict=True)]
    samples, systems = zip(*pairs, strict=True)
    numbers = jax.tree.map(lambda *leaves: jnp.stack(leaves), *systems)
    return Directions(np.concatenate([basis, np.stack(samples, axis=2)], axis=2), numbers)
