"""Event-exact where fixed steps fail: very stiff, very fast, many crossings, and contacts that barely touch."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.exact import prepare
from camopt.exact.engine import default_step
from camopt.exact.kernel.propagators import highest_frequency
from camopt.scene import MotionRefused, build_train, load_scene, parse_scene
from camopt.scene.response import end_state
from camopt.scene.rest import state_at_rest
from camopt.scene.units import MM
from tests.exact.located_dop853 import located_dop853
from tests.exact.test_engine import SEAT_ONLY, at

CASES = {
    "contacts of 1e9 N/m": (7000, {}, {"cam_follower": 1e9, "follower_valve": 1e9, "seat": 1e9}),
    "72 kHz": (7000, {"valve_stem": 1.1e-3}, {}),
    "15000 r/min": (15000, {}, {}),
    "600 r/min": (600, {}, {}),
}

CLOSED = 286
"""Samples up to 105 degrees, where the valve has been closed for 30 degrees."""


def case(name):
    """Scene, lift and speed of a case; the scene is changed as a user would change its file."""
    rpm, masses, stiffnesses = CASES[name]
    scene = load_scene("kodama")
    lift = polydyne(scene)
    mass = [m.model_copy(update={"mass_kg": masses.get(m.name, m.mass_kg)}) for m in scene.mass]
    element = [
        e.model_copy(update={"stiffness_N_per_m": stiffnesses.get(e.name, e.stiffness_N_per_m)}) for e in scene.element
    ]
    return scene.model_copy(update={"mass": mass, "element": element}), lift, rpm


def revolution(scene, lift, rpm, steps):
    train = build_train(scene)
    rest = state_at_rest(train)
    return prepare(train, lift, scene.cam_speed(rpm), steps), rest


def test_the_72_khz_case_has_such_a_mode():
    assert highest_frequency(build_train(case("72 kHz")[0])) / (2 * np.pi) > 60e3


@pytest.mark.parametrize("name", CASES)
def test_no_stability_limit_and_no_dial_of_accuracy(name):
    """Coarse samples, with several steps between them, against four times smaller steps."""
    scene, lift, rpm = case(name)
    revolve, rest = revolution(scene, lift, rpm, 360)
    per_sample = round(2 * np.pi / revolve.cam_speed / 360 / revolve.step)
    fine, _ = revolution(scene, lift, rpm, 360 * 4 * per_sample)
    grid = np.linspace(-np.pi, np.pi, 361)
    responses = revolve(rest), fine(rest)
    motions = [at(response, grid) for response in responses]
    error = np.abs(motions[0] - motions[1]).max(axis=1)
    assert error[:CLOSED].max() < 1e-6 * MM
    assert error.max() < 1e-4 * MM  # 182 switchings at 1e9 N/m multiply rounding ten million times
    assert np.ptp(motions[0][:, 4]) > 5 * MM


@pytest.mark.long
@pytest.mark.parametrize("name", list(CASES)[:3])
def test_extremes_agree_with_located_dop853(name):
    scene, lift, rpm = case(name)
    revolve, rest = revolution(scene, lift, rpm, 360)
    grid = np.linspace(-np.pi, np.pi, 361)
    # the reference's own error is the step: at 1e-5 s and 1e9 N/m it is 2e-6 mm here, at 2e-6 s 1e-8 mm
    theirs = located_dop853(scene, lift, rpm, grid[:CLOSED], rest[:10], max_step=2e-6)
    assert np.abs(at(revolve(rest), grid)[:CLOSED] - theirs).max() < 1e-6 * MM


def test_advance_ends_where_the_sampled_revolution_ends():
    scene = load_scene("kodama")
    revolve, state = revolution(scene, polydyne(scene), 6500, None)
    ends = end_state(revolve(state))
    assert np.abs(revolve.advance(state) - ends)[:10].max() < 1e-8 * MM
    assert np.array_equal(revolve.advance(state, 2), revolve.advance(revolve.advance(state)))
    assert np.abs(ends - state).max() > 1e-3  # it does not stand still


def floor(stiffness, damping):
    train = build_train(parse_scene(SEAT_ONLY.format(stiffness=stiffness, damping=damping), "drop"))
    return train, Lift(np.array([-np.pi, np.pi]), np.zeros((1, 2)), 1.0)


@pytest.mark.parametrize("stiffness", [1e7, 1e9, 1e11])
def test_every_double_crossing_is_caught_and_energy_is_kept(stiffness):
    """Contacts last 2 to 1000 us; default steps are as long as the contact, so it closes and opens within one."""
    train, flat = floor(stiffness, 0.0)
    revolve, start = prepare(train, flat, 2 * np.pi), np.array([0.01, -1.0])
    end = revolve.advance(start)
    energy = 10.0 * start[0] + 0.5 * start[1] ** 2
    assert 10.0 * end[0] + 0.5 * end[1] ** 2 == pytest.approx(energy, rel=1e-9)
    response = revolve(start)
    speed = np.sqrt(2 * energy)
    flight = 2 * speed / 10.0
    assert abs(np.count_nonzero(np.diff(response.angle) == 0) - 2 / (flight + np.pi / np.sqrt(stiffness))) <= 2
    assert end == pytest.approx(end_state(response), abs=1e-9)


def dipping(miss):
    """A ball on a spring swings from 20 mm down to `miss` above the floor (negative: into it); response, switchings."""
    text = SEAT_ONLY.format(stiffness=1e6, damping=0.0).replace("force_N = -10.0", "force_N = 0.0")
    text += """
[[element]]
name = "swing"
kind = "spring"
between = ["ball", "ground"]
stiffness_N_per_m = 1.0e4
"""
    train = build_train(parse_scene(text, "graze"))
    train = replace(train, preload=np.where(np.arange(3) == 2, -1.0e4 * (0.01 + miss), 0.0))
    flat = Lift(np.array([-np.pi, np.pi]), np.zeros((1, 2)), 1.0)
    response = prepare(train, flat, 2 * np.pi)(np.array([0.02 + miss, 0.0]))
    return response, np.count_nonzero(np.diff(response.angle) == 0)


@pytest.mark.parametrize("depth", [1e-5, 1e-9, 1e-12])
def test_a_grazing_contact_is_seen_however_shallow(depth):
    _, found = dipping(-depth)
    assert abs(found - 2 * 100.0 / (2 * np.pi)) <= 3  # 16 swings in 1 s, each in and out
    missed, none = dipping(depth)
    assert none == 0
    assert missed.x[:, 0].min() == pytest.approx(depth, abs=1e-4)


def test_chatter_is_refused_by_advance_too():
    train, flat = floor(1e12, 0.0)
    with pytest.raises(MotionRefused, match="switch more than"):
        prepare(train, flat, 2 * np.pi).advance(np.array([1e-9, 0.0]))


def test_step_without_samples_asked_serves_all_speeds():
    train = build_train(load_scene("kodama"))
    lift = polydyne(load_scene("kodama"))
    assert {prepare(train, lift, s).step for s in (30.0, 300.0, 366.0)} == {default_step(train)}
