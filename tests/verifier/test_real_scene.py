"""A scene with every element of real trains: DOP853 against itself, and the other methods against it."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from camopt.cam.families.exponent import exponent
from camopt.scene import build_train, load_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.units import DEG, MM
from camopt.study.extremes.extremes import STEP_METHODS
from camopt.verifier.methods import dop853
from tests.verifier.test_dop853 import GRID

SCENE = Path(__file__).parents[1] / "scene/real.toml"
SPEED_RPM = 3000.0
STEPS = 3600 * 4 ** np.arange(3)
SHIFTS = np.arange(1, 8)
"""Steps that are added, so that no contact closes as late after a sample at one step as at another."""


@cache
def case():
    scene = load_scene(SCENE)
    train = build_train(scene)
    return train, exponent(scene), scene.cam_speed(SPEED_RPM), state_at_rest(train)


def at(response) -> np.ndarray:
    """Positions and memories [m] at every half degree; Houbolt's and the others' steps need not meet them."""
    values = np.concatenate([response.x, response.memory], axis=1)
    return np.stack([np.interp(GRID, response.angle, column) for column in values.T])


@cache
def located(steps: int) -> np.ndarray:
    train, lift, cam_speed, start = case()
    return at(dop853.prepare(train, lift, cam_speed, steps)(start))


def test_dop853_stands_to_a_picometre():
    apart = np.abs(located(28_800) - located(100_800)).max()
    assert apart < 1e-9 * MM
    assert np.ptp(located(28_800), axis=1).min() > 1e-3 * MM  # every mass moves, every memory changes


@pytest.mark.parametrize("name", STEP_METHODS)
def test_the_other_methods_come_to_it(name):
    train, lift, cam_speed, start = case()
    wanted = located(100_800)
    found = []
    for steps in STEPS:
        runs = [STEP_METHODS[name](train, lift, cam_speed, int(steps + shift)) for shift in SHIFTS]
        found.append(np.mean([np.abs(at(run(start)) - wanted).max() for run in runs]))
    order = -np.polyfit(np.log(STEPS), np.log(found), 1)[0]
    assert found[-1] < 2e-4 * MM
    assert 0.75 < order


def test_the_record_holds_forces_within_their_laws():
    train, lift, cam_speed, start = case()
    guide, oil = (train.element_names.index(name) for name in ("guide", "lifter-oil"))
    slip, stiffness = train.laws.slip[guide], train.laws.coefficient[guide]
    for prepare in (dop853.prepare, *STEP_METHODS.values()):
        motion = prepare(train, lift, cam_speed, 7200)(start)
        z = dict(zip(train.memory, motion.memory.T, strict=True))
        d = train.compression(motion.x, motion.lift)
        assert np.abs(motion.force[:, guide]).max() == pytest.approx(
            slip, rel=1e-6
        )  # DOP853: within the permitted error
        assert np.abs(motion.force[:, guide] - stiffness * (d[:, guide] - z[guide])).max() < 1e-3 * slip
        pressed = np.maximum(0.0, d[:, oil] - z[oil] - train.laws.travel[oil])
        assert (
            np.abs(motion.force[:, oil] - train.laws.coefficient[oil] * pressed).max()
            < 1e-3 * motion.force[:, oil].max()
        )
        assert motion.force[:, oil].max() > 100.0 and np.all(z[oil] <= d[:, oil] + 1e-9 * MM)


def test_the_gas_force_decelerates_the_opening_valve():
    train, lift, cam_speed, start = case()
    free = dop853.prepare(replace(train, forcing=()), lift, cam_speed, 7200)(start)
    pressed = dop853.prepare(train, lift, cam_speed, 7200)(start)
    inside = np.abs(pressed.angle + 50 * DEG) < 8 * DEG
    cam = train.element_names.index("cam")
    assert (
        pressed.force[inside, cam].min() > np.interp(pressed.angle[inside], free.angle, free.force[:, cam]).min() + 30.0
    )


@pytest.mark.parametrize("name", STEP_METHODS)
def test_a_revolution_is_the_same_when_its_matrices_are_there(name):
    """A set of pieces is found from the state alone: sliding friction, whose memory follows, would else stick by
    rounding wherever the set was new."""
    train, lift, cam_speed, start = case()
    revolve = STEP_METHODS[name](train, lift, 2.0 * cam_speed, 720)
    first, second = revolve(start), revolve(start)
    for part in ("x", "v", "memory", "force"):
        assert np.array_equal(getattr(first, part), getattr(second, part)), part
