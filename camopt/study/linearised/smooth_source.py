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
from camopt.smooth.grid import equal_grid
from camopt.smooth.periodic_slopes import Directions, TiedMotions
from camopt.smooth.simulate import lift_samples
from camopt.smooth.tied import TiedSystem, tied_system
from camopt.study.linearised.cases import LinearisedCase, LinearPaths


def smooth_paths(
    cases: Sequence[LinearisedCase], cam: FreeCam, cam_speeds: np.ndarray, smoothing: Smoothing
) -> list[LinearPaths]:
    """The paths of every train at the cam speeds (s) [rad/s], under a smoothing."""
    event, steps, by_train = (-cam.breaks[-1], cam.breaks[-1]), smoothing.steps, []
    of_cases = [TiedMotions(case.nominal[0], cam_speeds, event, smoothing) for case in cases]
    basis, parts = cam.samples(equal_grid(steps))[0], max(motions.parts for motions in of_cases)
    for case, motions in zip(cases, of_cases, strict=True):
        motions.parts, samples = parts, lift_samples(case.nominal[1], steps)
        start, paths = motions.settled(samples)
        moved = np.abs(np.asarray(paths.end - start))[0].max(axis=0)
        if not np.all(np.isfinite(moved)):
            lost = cam_speeds[~np.isfinite(moved)][0] / RPM
            raise MotionRefused(
                f"the smoothed motion with tied contacts grows without bound at {lost:g} r/min of the camshaft: give a "
                f"larger width_um, another speed, or more damping_N_s_per_m"
            )
        along = _with_numbers(basis, case, motions.tied, steps) if len(case.steps) else Directions(basis)
        slopes = motions.slopes(samples, paths, along)
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
