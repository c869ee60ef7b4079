"""Paths and slopes of the smoothed motion with tied contacts, by JAX: of any law."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.scene.errors import MotionRefused
from camopt.scene.smoothing import Smoothing
from camopt.scene.units import RPM
from camopt.smooth.contact import Layer
from camopt.smooth.grid import equal_grid
from camopt.smooth.periodic_slopes import Directions, periodic_slopes
from camopt.smooth.rest import rest_state
from camopt.smooth.simulate import lift_samples
from camopt.smooth.tied import TiedSystem, parts_of_steps, settled_paths, tied_system
from camopt.study.linearised.linearised import LinearisedCase, LinearPaths


def smooth_paths(
    cases: Sequence[LinearisedCase], cam: FreeCam, cam_speeds: np.ndarray, smoothing: Smoothing
) -> list[LinearPaths]:
    """The paths of every train at the cam speeds (s) [rad/s], under a smoothing."""
    width, tie, steps = smoothing
    systems = [tied_system(case.nominal[0]) for case in cases]
    parts = max(parts_of_steps(tied, float(cam_speeds.min()), steps) for tied in systems)
    basis, _ = cam.samples(equal_grid(steps))
    event, speeds, by_train = (-cam.breaks[-1], cam.breaks[-1]), jnp.asarray(cam_speeds), []
    for case, tied in zip(cases, systems, strict=True):
        train, lift = case.nominal
        samples = jnp.asarray(lift_samples(lift, steps))
        rest = jnp.repeat(rest_state(train)[:, :, None], len(speeds), axis=2)
        motion = speeds, event, tie, Layer(width)
        start, paths = settled_paths(tied, samples, speeds, rest, *motion[1:], parts=parts)
        moved = np.abs(np.asarray(paths.end - start))[0].max(axis=0)
        if not np.all(np.isfinite(moved)):
            lost = cam_speeds[~np.isfinite(moved)][0] / RPM
            raise MotionRefused(
                f"the smoothed motion with tied contacts grows without bound at {lost:g} r/min of the camshaft: give a "
                f"larger width_um, another speed, or more damping_N_s_per_m"
            )
        along = _with_numbers(basis, case, tied, steps) if len(case.steps) else Directions(basis)
        slopes = periodic_slopes(tied, samples, speeds, paths, *motion[1:], along, parts=parts)
        values = paths.force, paths.gap, paths.seat_gap
        pairs = zip(values, slopes[:3], strict=True)
        joined = [np.concatenate([np.asarray(v)[..., None], s], axis=-1) for v, s in pairs]
        force, gap, seat_gap = (np.moveaxis(q, -2, 0) for q in joined)
        by_train.append(LinearPaths(force, gap, seat_gap, moved))
    return by_train


def _with_numbers(basis: np.ndarray, case: LinearisedCase, tied: TiedSystem, steps: int) -> Directions:
    """The directions of the cam's `basis` (k + 1, 2, m), and those in which system and lift move with each free number;
    which contacts are closed at rest stays."""

    def slope(below, above, step):
        system = jax.tree.map(lambda a, b: (b - a) / (2 * step), tied_system(below[0]), tied_system(above[0]))
        samples = (lift_samples(above[1], steps) - lift_samples(below[1], steps)) / (2 * step)
        return samples, eqx.tree_at(lambda t: t.at_rest, system, jnp.zeros_like(tied.at_rest))

    pairs = [slope(*sides, step) for sides, step in zip(case.beside, case.steps, strict=True)]
    samples, systems = zip(*pairs, strict=True)
    numbers = jax.tree.map(lambda *leaves: jnp.stack(leaves), *systems)
    return Directions(np.concatenate([basis, np.stack(samples, axis=2)], axis=2), numbers)
