"""Tables, oil, friction and given forces on the smooth path: the motion tends to DOP853's, the gradients are true."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from camopt.cam.families.exponent import exponent
from camopt.scene import build_train, load_scene
from camopt.scene.laws import LINEAR, TABLE
from camopt.scene.rest import state_at_rest
from camopt.scene.units import DEG, MM
from camopt.smooth.laws import Layer, elastic_laws
from camopt.smooth.metrics import at_angle
from camopt.smooth.rest import rest_of, rest_state
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import compiled_response, lift_samples, prepare
from camopt.smooth.system import System, build_system, stacked
from camopt.verifier.methods import dop853
from tests.verifier.trains import laws

SCENE = Path(__file__).parents[1] / "scene/real.toml"
LOOK = 30.0 * DEG
"""Where gradients are taken: the valve has opened against gas, friction has turned, and the oil leaks."""
ROWS = np.array([[-1e-4, -20.0], [2e-5, 2.0], [1e-4, 90.0], [1.1, 3e5]])


@cache
def case():
    scene = load_scene(SCENE)
    train = build_train(scene)
    return train, exponent(scene), scene.cam_speed(3000.0), state_at_rest(train)


def test_a_table_is_the_scenes_with_corners_rounded_over_the_layer():
    given = laws([TABLE, LINEAR], [1e5, 2e5], table=ROWS)
    ours, preload = elastic_laws(given, jnp.float64), np.array([-2.0, 7.0])
    stiffness, eps = jnp.asarray(given.coefficient), 1e-6
    touch = ours.touch(stiffness, jnp.asarray(preload))
    np.testing.assert_allclose(touch, given.touch(preload), rtol=1e-12)
    for d in (-3e-4, -1e-4, 0.0, 2e-5, 3e-5, 1e-4, 5e-4):
        exact = given.force(np.full(2, d), preload)
        np.testing.assert_allclose(ours.force(d - touch, stiffness, jnp.asarray(preload)), exact, rtol=1e-9)
        rounded = ours.force(d - touch, stiffness, jnp.asarray(preload), Layer(eps))
        bend = 0.0 if np.abs(ROWS[1:-1, 0] - d).min() > eps else 1e6 * eps
        assert np.abs(rounded - exact).max() <= bend + 1e-9


def test_rest_has_faded_memories():
    train, _, _, start = case()
    for at_rest in (rest_state(train), rest_of(build_system(train))):
        np.testing.assert_allclose(at_rest, stacked(start, len(train.mass)), rtol=1e-9, atol=1e-15)


@pytest.mark.long
def test_the_motion_tends_to_dop853_as_the_layer_narrows():
    train, lift, cam_speed, start = case()
    located = dop853.prepare(train, lift, cam_speed, 28_800)(start)
    once = np.append(np.diff(located.angle) > 0, True)
    found = []
    for eps in (1e-6, 1e-7, 1e-8):
        ours = prepare(train, lift, cam_speed, eps=eps)(start)
        curve = CubicHermiteSpline(located.angle[once], located.x[once], located.v[once] / cam_speed)
        apart = np.abs(ours.x - curve(ours.angle)).max()
        memory = [np.interp(ours.angle, located.angle[once], z) for z in located.memory[once].T]
        found.append([apart, np.abs(ours.memory - np.stack(memory, axis=1)).max()])
    wide, middle, narrow = np.array(found)
    assert np.all(middle < 0.2 * wide) and np.all(narrow < 0.3 * middle)
    assert narrow.max() < 1e-5 * MM


@cache
def start_between_bounds():
    """Rest but for the ball of the adjuster's valve, which is half way.

    At rest itself oil stands between pushing and filling: more of a number starts the one, less of it the other.
    """
    train, _, _, start = case()
    z = 2 * len(train.mass) + train.memory.index(train.element_names.index("lifter-oil"))
    return start - 1e-5 * (np.arange(len(start)) == z)


def looked_at(system: System):
    """Valve position and oil's memory [m] at LOOK, in the first revolution."""
    train, lift, cam_speed, _ = case()
    driven = DrivenSystem(system, jnp.asarray(lift_samples(lift)), cam_speed)
    motion = compiled_response(driven, stacked(start_between_bounds(), len(train.mass)), Layer(2e-9))
    valve = at_angle(motion.angle, motion.x[:, train.valve], LOOK, motion.v[:, train.valve] / cam_speed)
    return jnp.stack([valve, at_angle(motion.angle, motion.memory[:, 1], LOOK)])


def truth(train):
    """The same by DOP853."""
    _, lift, cam_speed, _ = case()
    motion = dop853.prepare(train, lift, cam_speed, 14_400)(start_between_bounds())
    i = np.searchsorted(motion.angle, LOOK - 1e-9)
    assert motion.angle[i] == pytest.approx(LOOK, abs=1e-9)
    return np.array([motion.x[i, train.valve], motion.memory[i, 1]])


def varied(train, name, e, share):
    """The train with the numbers `name` of element e, or the gas force, raised by a share."""
    if name == "force":
        (gas,) = train.forcing
        return replace(train, forcing=(replace(gas, force=(1 + share) * gas.force),))
    numbers = getattr(train.laws, name).copy()
    numbers[e] = numbers[e] * (np.array([1.0, 1 + share]) if name == "table" else 1 + share)
    return replace(train, laws=replace(train.laws, **{name: numbers}))


@pytest.mark.long  # a minute and a half: a forward program is compiled, and DOP853 moves eight trains
def test_gradients_by_the_numbers_of_every_law_are_central_differences_of_the_truth():
    train, step = case()[0], 1e-3
    system = build_system(train)
    along = jax.jit(lambda tangent: jax.jvp(looked_at, (system,), (tangent,))[1])
    for name, element in (("leak", "lifter-oil"), ("slip", "guide"), ("table", "beehive"), ("force", "")):
        e = train.element_names.index(element) if element else -1
        away = jax.tree.map(lambda new, old: (new - old) / step, build_system(varied(train, name, e, step)), system)
        ends = [truth(varied(train, name, e, sign * step)) for sign in (1.0, -1.0)]
        theirs = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(theirs).min() > 1e-9  # m
        np.testing.assert_allclose(along(away), theirs, rtol=2e-3)
