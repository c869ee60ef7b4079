"""Elastic laws beyond the linear one: collisions known in closed form, a preloaded contact, and who refuses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma

from camopt.cam.families.polydyne import polydyne
from camopt.exact.affine.lines import CHORD_FORCE, CHORDS
from camopt.scene import InputError, MotionRefused, build_train, load_scene
from camopt.scene.laws import HERTZ, PROGRESSIVE
from camopt.scene.rest import state_at_rest
from camopt.scene.train import GROUND
from camopt.scene.units import MM
from camopt.verifier import verdict
from camopt.verifier.accuracy import verify
from camopt.verifier.convergence import Tolerances, first_steps
from camopt.verifier.methods import dop853, houbolt, rkg, tmm
from tests.verifier.trains import laws, no_lift, train

METHODS = {"dop853": (dop853.prepare, 20_000, 1e-6), "rkg": (rkg.prepare, 200_000, 1e-4)}
"""prepare, steps over 8 ms, error allowed in the rebound: Runge-Kutta-Gill meets the touch up to 0.04 us late."""
SAMPLED = 3e-4
"""Relative error of a depth read off samples: (half a step of 0.4 us / 20 us)^2 / 2, and Runge-Kutta-Gill's own."""
MASS, SPEED, PERIOD = 0.05, 1.2, 8e-3
ROWS = np.array([[0.0, 2e6], [2e-5, 2e6], [1e-4, 2e7]])


def ball(kind: int, exponent: float = 1.5, coefficient: float = 3e10, preload: float = 0.0, damping: float = 0.0):
    """A mass that a contact to ground pushes towards +x, pressed as far as it lies below zero."""
    contact, own = (GROUND, 0, True, False, 1e8, damping, preload, 0.0), laws([kind], coefficient, exponent, ROWS)
    return train([MASS], [contact], valve=0, seat=0, laws=own)


def collided(name: str, parts, height: float = 1e-3):
    """Duration of the contact [s], deepest compression [m], and rebound over impact speed; from `height` at SPEED."""
    prepare, steps, _ = METHODS[name]
    motion = prepare(parts, no_lift(), 2 * np.pi / PERIOD, steps)(np.array([height, -SPEED]))
    pushing = motion.time[motion.force[:, 0] > 0]
    return pushing[-1] - pushing[0], -motion.x.min(), motion.v[-1, 0] / SPEED


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.2])
@pytest.mark.parametrize("name", METHODS)
def test_hertz_collision_lasts_and_presses_as_known(name, exponent):
    """Energy m v^2 / 2 = k d^(e+1) / (e+1); Hertz's contact time 2 (d/v) int_0^1 dx / (1 - x^(e+1))^0.5."""
    coefficient, q = 1e8 * 1e-5 ** (1 - exponent), exponent + 1
    deepest = (q * MASS * SPEED**2 / (2 * coefficient)) ** (1 / q)
    lasting = 2 * deepest / SPEED * np.sqrt(np.pi) * gamma(1 + 1 / q) / gamma(1 / q + 0.5)
    if exponent == 1.5:
        assert lasting == pytest.approx(2.9432 * deepest / SPEED, rel=1e-4)  # the textbooks' figure
    duration, depth, rebound = collided(name, ball(HERTZ, exponent, coefficient))
    error, step = METHODS[name][2], PERIOD / METHODS[name][1]
    assert duration == pytest.approx(lasting, abs=2 * step)
    assert depth == pytest.approx(deepest, rel=SAMPLED)
    assert rebound == pytest.approx(1.0, rel=error)


@pytest.mark.parametrize("name", METHODS)
def test_progressive_collision_lasts_and_presses_as_known(name):
    def work(d):
        return quad(lambda c: (d - c) * np.interp(c, *ROWS.T), 0.0, d, points=ROWS[ROWS[:, 0] < d, 0])[0]

    deepest = 1.7e-4  # beyond the last row
    parts = ball(PROGRESSIVE)
    mass = 2 * work(deepest) / SPEED**2
    u = np.linspace(0.0, 1.0, 2001)[1:]  # d = deepest (1 - u^2) takes the root's singularity away
    slowness = np.array([2 * deepest * q / np.sqrt(SPEED**2 - 2 * work(deepest * (1 - q * q)) / mass) for q in u])
    lasting = 2 * np.trapezoid(slowness, u) + 2 * slowness[0] * u[0]
    duration, depth, rebound = collided(name, replace(parts, mass=np.array([mass])))
    assert duration == pytest.approx(lasting, abs=2 * PERIOD / METHODS[name][1] + 1e-3 * lasting)
    assert depth == pytest.approx(deepest, rel=SAMPLED)
    assert rebound == pytest.approx(1.0, rel=METHODS[name][2])


@pytest.mark.parametrize("kind", [HERTZ, PROGRESSIVE])
def test_a_preloaded_contact_touches_where_its_force_ends(kind):
    parts = ball(kind, preload=100.0)
    touch = {HERTZ: -((100.0 / 3e10) ** (2 / 3)), PROGRESSIVE: -100.0 / 2e6}[kind]
    motion = dop853.prepare(parts, no_lift(), 2 * np.pi / PERIOD, 20_000)(np.array([1e-3, -SPEED]))
    switch = np.flatnonzero(np.diff(motion.angle) == 0)
    assert motion.x[switch[:2], 0] == pytest.approx([-touch] * 2, rel=1e-9)
    assert parts.touch_compression[0] == pytest.approx(touch, rel=1e-12)
    assert motion.seat_separation()[switch[0]] == pytest.approx(0.0, abs=1e-12)
    other = rkg.prepare(parts, no_lift(), 2 * np.pi / PERIOD, 200_000)(np.array([1e-3, -SPEED]))
    for response in (motion, other):
        first = int(np.flatnonzero(response.x[:, 0] < 0)[0])  # the preload is the force at compression zero
        crossing = slice(first - 1, first + 1)
        force = np.interp(0.0, response.x[crossing, 0][::-1], response.force[crossing, 0][::-1])
        assert force == pytest.approx(100.0, rel=0.01)


def test_a_damped_hertz_contact_by_both_methods():
    found = [collided(name, ball(HERTZ, damping=120.0)) for name in METHODS]
    assert found[0][2] == pytest.approx(found[1][2], rel=1e-4) and 0.3 < found[0][2] < 0.95
    assert found[0][1] == pytest.approx(found[1][1], rel=SAMPLED)


def hertz():
    scene = load_scene("kodama-hertz")
    parts = build_train(scene)
    return scene, parts, state_at_rest(parts)


def test_both_methods_agree_on_kodama_hertz_and_differ_from_kodama():
    scene, parts, start = hertz()
    lift, cam_speed = polydyne(load_scene("kodama")), scene.cam_speed(5000)
    ours = dop853.prepare(parts, lift, cam_speed, 1440)(start)
    theirs = rkg.prepare(parts, lift, cam_speed, 57_600)(start)
    linear = rkg.prepare(build_train(load_scene("kodama")), lift, cam_speed, 57_600)(start)
    i = np.searchsorted(ours.angle, theirs.angle[::40] - 1e-9)
    apart = np.abs(ours.x[i] - theirs.x[::40]).max()
    assert apart < 1e-4 * MM
    assert np.abs(linear.x - theirs.x).max() > 5 * apart


@pytest.mark.parametrize("method", [tmm, houbolt], ids=lambda m: m.__name__)
def test_methods_of_constant_matrices_refuse(method):
    scene, parts, _ = hertz()
    with pytest.raises(InputError, match=r"cam_follower, follower_valve; .*\"dop853\"") as error:
        method.prepare(parts, polydyne(scene), scene.cam_speed(5000), 1440)
    assert not isinstance(error.value, MotionRefused)  # which a step halved would be tried on


def test_a_verdict_asks_the_methods_that_carry_the_laws(monkeypatch):
    scene, parts, _ = hertz()
    assert verdict.methods_for(parts) == ("event", "rkg", "dop853")
    assert verdict.methods_for(build_train(load_scene("kodama"))) == verdict.METHODS

    def asked(case, speed_rpm):
        raise LookupError(*case.methods)

    monkeypatch.setattr(verdict, "judge_speed", asked)
    lift = polydyne(scene)
    with pytest.raises(LookupError, match=r"^\('event', 'rkg'\)$"):  # the programmer's default
        verdict.verdict_on(scene, lift, (5000.0,))
    with pytest.raises(LookupError, match=r"^\('event', 'rkg', 'dop853'\)$"):  # the command line's "all"
        verify(scene, lift, (5000.0,))


def test_a_method_that_cannot_carry_the_laws_is_refused_by_the_verdict():
    scene, _, _ = hertz()
    with pytest.raises(InputError, match="needs elements whose force follows straight lines"):
        verify(scene, polydyne(scene), (5000.0,), "tmm")


def test_chords_are_refined_with_the_steps():
    """With their root, so that a halved step halves the error of the chords, too."""
    scene, parts, _ = hertz()
    lift, cam_speed = polydyne(scene), scene.cam_speed(5000)
    first = first_steps(parts, cam_speed)
    counts = []
    for steps in (first // 2, first, 2 * first + 1, 9 * first // 4, 4 * first + 2):
        force = verdict.event_exact(parts, lift, cam_speed, steps).train.laws.table[1][:, 1]
        counts.append(np.sum(force < CHORD_FORCE * (1 + 1e-9)) - 1)
    assert counts == [CHORDS, CHORDS, round(CHORDS * 2**0.5), round(CHORDS * 1.5), 2 * CHORDS]
    linear = build_train(load_scene("kodama"))
    assert verdict.event_exact(linear, lift, cam_speed, 1440).train is linear


def test_event_exact_with_chords_is_the_curved_motion():
    scene, parts, start = hertz()
    lift, cam_speed = polydyne(load_scene("kodama")), scene.cam_speed(5000)
    true = dop853.prepare(parts, lift, cam_speed, 1440)(start)
    steps, at = 1440 * 4, np.linspace(-np.pi, np.pi, 361)
    found = verdict.event_exact(parts, lift, cam_speed, steps)(start)
    valve = [np.interp(at, motion.angle, motion.x[:, parts.valve]) for motion in (true, found)]
    assert np.abs(valve[0] - valve[1]).max() < 2e-4 * MM


@pytest.mark.long  # two minutes: DOP853 settles and looks at six neighbours; the small sizes are above
def test_the_verdict_on_kodama_hertz_at_5000_is_an_agreement():
    scene, _, _ = hertz()
    judged = verdict.verdict_on(scene, polydyne(scene), (5000.0,), None, None, Tolerances(halvings=2))
    (found,) = judged.speeds
    assert found.verdict == "confirmed"
    assert list(found.methods) == ["event", "rkg"]
    for method in found.methods.values():
        assert method.worst["seating_velocity_m_per_s"] == pytest.approx(0.1490, abs=1e-3)
