"""Event-exact where fixed steps fail: very stiff, very fast, many crossings, and contacts that barely touch."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare
from camopt.exact.engine import EventExact
from camopt.exact.kernel.propagators import highest_frequency
from camopt.scene import MotionRefused, build_train, load_scene
from camopt.scene.response import end_state
from camopt.scene.rest import state_at_rest
from camopt.scene.units import MM
from tests.exact.small_trains import GRAVITY, ONCE_A_SECOND, STILL, ball
from tests.exact.test_engine import at
from tests.measure import raw_motion as module
from tests.measure.raw_motion import Equations, raw_motion, samples

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
def test_extremes_agree_with_located_dop853(name, monkeypatch):
    scene, lift, rpm = case(name)
    revolve, rest = revolution(scene, lift, rpm, 360)
    grid, equations = np.linspace(-np.pi, np.pi, 361)[:CLOSED], Equations(scene, lift, rpm)
    # the reference's own error is the step: at 1e-5 s and 1e9 N/m it is 2e-6 mm here, at 2e-6 s 1e-8 mm
    monkeypatch.setattr(module, "LONGEST_STEP", 2e-6)
    theirs = samples(equations, raw_motion(equations, rest, grid[-1]), grid)[1]
    assert np.abs(at(revolve(rest), grid) - theirs[:, :10]).max() < 1e-6 * MM


def test_advance_ends_where_the_sampled_revolution_ends():
    scene = load_scene("kodama")
    revolve, state = revolution(scene, polydyne(scene), 6500, None)
    ends = end_state(revolve(state))
    assert np.abs(revolve.advance(state) - ends)[:10].max() < 1e-8 * MM
    assert np.array_equal(revolve.advance(state, 2), revolve.advance(revolve.advance(state)))
    assert np.abs(ends - state).max() > 1e-3  # it does not stand still


@pytest.mark.parametrize("stiffness", [1e7, 1e9, 1e11])
def test_every_double_crossing_is_caught_and_energy_is_kept(stiffness):
    """Contacts last 2 to 1000 us; default steps are as long as the contact, so it closes and opens within one."""
    revolve, start = prepare(ball(stiffness, 0.0), STILL, ONCE_A_SECOND), np.array([0.01, -1.0])
    end = revolve.advance(start)
    energy = GRAVITY * start[0] + 0.5 * start[1] ** 2
    assert GRAVITY * end[0] + 0.5 * end[1] ** 2 == pytest.approx(energy, rel=1e-9)
    response = revolve(start)
    speed = np.sqrt(2 * energy)
    flight = 2 * speed / GRAVITY
    assert abs(np.count_nonzero(np.diff(response.angle) == 0) - 2 / (flight + np.pi / np.sqrt(stiffness))) <= 2
    assert end == pytest.approx(end_state(response), abs=1e-9)


def dipping(miss):
    """A ball on a spring swings from 20 mm down to `miss` above the floor (negative: into it); response, switchings."""
    swing = '[[element]]\nname = "swing"\nkind = "spring"\nbetween = ["ball", "ground"]\nstiffness_N_per_m = 1.0e4'
    train = ball(1e6, 0.0, swing)
    pulled = np.where(np.arange(3) == 2, -1.0e4 * (0.01 + miss), 0.0)
    train = replace(train, mass_force=np.zeros(1), preload=pulled)
    response = prepare(train, STILL, ONCE_A_SECOND)(np.array([0.02 + miss, 0.0]))
    return response, np.count_nonzero(np.diff(response.angle) == 0)


@pytest.mark.parametrize("depth", [1e-5, 1e-9, 1e-12])
def test_a_grazing_contact_is_seen_however_shallow(depth):
    _, found = dipping(-depth)
    assert abs(found - 2 * 100.0 / (2 * np.pi)) <= 3  # 16 swings in 1 s, each in and out
    missed, none = dipping(depth)
    assert none == 0
    assert missed.x[:, 0].min() == pytest.approx(depth, abs=1e-4)


@pytest.mark.parametrize("call", [EventExact.__call__, EventExact.advance])
@pytest.mark.parametrize(
    ("train", "start", "why"),
    [
        (ball(1e12, 0.0), [1e-9, 0.0], "switch more than"),
        (replace(ball(1e6, 0.0), mass_damping=np.array([-100.0])), [0.01, 1.0], "the motion has no bound"),
    ],
    ids=["chatter", "thrown ever faster"],
)
def test_a_motion_is_refused_for_its_own_reason(call, train, start, why):
    with pytest.raises(MotionRefused, match=why):
        call(prepare(train, STILL, ONCE_A_SECOND), np.array(start))
