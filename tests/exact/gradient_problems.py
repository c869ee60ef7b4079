"""Cams, directions and central differences for the tests of the exact gradient."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from camopt.cam.design_file import read_design
from camopt.cam.families.free import free_cam
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.cam.polynomials import recentred
from camopt.exact.adjoint.motion import ByTrain, Slopes, TracedMotion
from camopt.scene import build_train, load_scene
from camopt.scene.rest import state_at_rest

DESIGN = Path(__file__).parents[1] / "data" / "kodama-design.json"


@cache
def kodama():
    """Scene and train."""
    scene = load_scene("kodama")
    return scene, build_train(scene)


@cache
def cam_with_bumps(name: str, count: int) -> tuple[Lift, np.ndarray]:
    """A cam and `count` free-cam coefficients added to it, as changes (count, p, q) of its pieces per mm/deg^2."""
    scene, _ = kodama()
    assert scene.design is not None
    base = polydyne(scene) if name == "polydyne" else read_design(DESIGN, scene)
    free = free_cam(scene.design, scene.design.duration_deg / (count + 1))
    z = np.zeros(free.Z.shape[1])
    flat = replace(free.lift(z), coefficients=0.0 * free.lift(z).coefficients)
    lift = base.shifted(flat)
    piece = np.searchsorted(flat.borders, 0.5 * (lift.borders[1:] + lift.borders[:-1])) - 1
    bumps = []
    for e in np.eye(len(z)):
        change = free.lift(e).coefficients - free.lift(z).coefficients
        part = recentred(replace(flat, coefficients=change), piece, lift.borders[:-1])
        bumps.append(np.pad(part, ((0, 0), (0, lift.coefficients.shape[1] - part.shape[1]))))
    return lift, np.array(bumps)


def moved(lift: Lift, change: np.ndarray) -> Lift:
    return replace(lift, coefficients=lift.coefficients + change)


def by_train(slopes: Slopes) -> ByTrain:
    assert slopes.by_train is not None
    return slopes.by_train


def from_rest(train, lift, cam_speed, metrics, held=None):
    """Values of metrics in the first revolution from rest, or from the state `held`."""
    return TracedMotion(train, lift, cam_speed, state_at_rest(train) if held is None else held).values(metrics)


def differences(values, steps):
    """Central differences of values(step) (l) at descending steps, of second and, from two steps, fourth order."""
    second = np.array([(values(h) - values(-h)) / (2 * h) for h in steps])
    ratio = (np.asarray(steps)[:-1] / np.asarray(steps)[1:])[:, None] ** 2
    return np.concatenate([second, (ratio * second[1:] - second[:-1]) / (ratio - 1)])


def least_error(exact, reference):
    """Smallest |exact - reference| / |reference| over steps (first axis) of a reference gradient (steps, d)."""
    return min(np.linalg.norm(exact - r) / np.linalg.norm(r) for r in reference)


def assert_slopes(exact, reference, names, allowed):
    """Slopes (l, ...) of numbers are those of differences (steps, l, ...); one that is zero stays so, but for rounding
    over the step."""
    for i, name in enumerate(names):
        if np.any(exact[i]):
            assert least_error(exact[i], reference[:, i]) < allowed, name
        else:
            assert np.abs(reference[:, i]).max() < 1e-6, name
