"""Periodic states of maps whose fixed point and eigenvalues are known, and of a train that settles slowly."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.exponent import exponent
from camopt.exact import prepare
from camopt.measure import periodic
from camopt.measure.periodic import periodic_state
from camopt.scene import MotionRefused
from camopt.scene.laws import FRICTION, LINEAR, OIL
from camopt.scene.response import end_state
from camopt.scene.train import GROUND
from camopt.verifier.methods import rkg
from tests.measure.test_settling import revolve_to
from tests.verifier.scenes import REAL, from_rest
from tests.verifier.trains import laws, no_lift, train

FIXED = np.array([2e-3, -0.7])
UNIT = np.array(periodic.UNIT)
START = np.array([5e-3, 0.3])


def turning(radius, cubic=0.0):
    """A map about FIXED whose linear part turns by 40 degrees and scales by `radius` (in UNIT)."""
    cos, sin = radius * np.cos(0.7), radius * np.sin(0.7)

    def after(state):
        y = (state - FIXED) / UNIT
        return FIXED + UNIT * (np.array([[cos, -sin], [sin, cos]]) @ y + cubic * y**3)

    return after


def test_a_slow_stable_motion_is_found_in_a_few_revolutions():
    found = periodic_state(revolve_to(turning(0.98)), START)
    assert found.periodic and found.revolutions < 12  # two for the Jacobian; plain: 0.98^k falls to 1e-7 in 800
    assert np.abs((found.state - FIXED) / UNIT).max() < 1e-2
    assert found.radius == pytest.approx(0.98, abs=1e-6)


@pytest.mark.parametrize("radius", [1.0, 1.2])
def test_an_unstable_fixed_point_is_no_motion(radius):
    found = periodic_state(revolve_to(turning(radius)), FIXED + 3 * UNIT)
    assert not found.periodic
    assert found.residual < 1e-4 and found.radius == pytest.approx(radius, abs=1e-5)


def test_an_aperiodic_motion_is_reported_with_the_state_that_it_leads_to():
    chaotic = revolve_to(lambda y: np.array([1e-3 * (1 - 2 * (y[0] / 1e-3) ** 2), 0.0]))  # Chebyshev: fills +-1 mm
    found = periodic_state(chaotic, np.array([0.3e-3, 0.0]))
    assert not found.periodic
    assert 0 < abs(found.state[0]) <= 1e-3


def test_newton_converges_quadratically(monkeypatch):
    monkeypatch.setattr(periodic, "MOST_ACCELERATED", 0)
    after, near = turning(0.9, cubic=1e-3), FIXED + 4 * UNIT
    by_difference = periodic_state(revolve_to(after), near)
    assert by_difference.periodic and by_difference.radius == pytest.approx(0.9, abs=1e-3)
    assert np.abs((by_difference.state - FIXED) / UNIT).max() < 1e-4
    # two plain revolutions and their image; two columns of the Jacobian and an image a step; the columns for the radius
    assert by_difference.revolutions == 3 + 2 * 3 + 2


def test_a_mixed_state_that_the_train_refuses_is_replaced_by_a_plain_revolution():
    refused = []

    def after(state):
        y = state / UNIT
        if y[0] < -1:
            refused.append(y)
            raise MotionRefused("out of bounds")
        return UNIT * y * (1 - 0.5 / (1 + np.abs(y) / 10))  # steps shrink towards 0: a secant goes past it

    found = periodic_state(revolve_to(after), UNIT * [40.0, 0.0])
    assert refused and found.periodic
    assert np.abs(found.state / UNIT).max() < 1e-3 and found.radius == pytest.approx(0.5, abs=1e-2)


def test_a_motion_that_is_refused_at_once_stays_refused():
    with pytest.raises(MotionRefused, match="stability"):
        periodic_state(revolve_to(lambda y: np.inf * y), START)


def test_agrees_with_plain_settling():
    """Kodama's train with a quarter of its coils' damping: surge takes fifty revolutions to die out."""
    (train, lift, cam_speed), rest = from_rest("kodama", 5000)
    damping = np.where(train.stiffness < 1e6, 0.25 * train.damping, train.damping)
    revolve = prepare(replace(train, damping=damping), lift, cam_speed)
    found = periodic_state(revolve, rest)
    state, changes = rest, []
    for _ in range(80):
        after = end_state(revolve(state))
        changes.append(np.linalg.norm((after - state) / np.repeat(UNIT, len(train.mass))))
        state = after
    n = len(train.mass)
    assert found.periodic
    assert np.abs(found.state - state)[:n].max() < 1e-9
    assert found.revolutions < np.argmax(np.array(changes) < 1e-4)  # with the Jacobian, sooner than plain settling
    decay = (changes[55] / changes[20]) ** (1 / 35)
    assert found.radius == pytest.approx(decay, abs=0.02)


def test_a_bouncing_train_is_aperiodic():
    case, rest = from_rest("kodama", 7000)
    found = periodic_state(prepare(*case), rest)
    assert not found.periodic and found.residual > 1


def test_the_periodic_state_of_a_train_with_memories():
    case, rest = from_rest(REAL, 3000, exponent)
    train, revolve = case[0], rkg.prepare(*case, 7200)
    found = periodic_state(revolve, rest, memories=len(train.memory))
    assert found.periodic and len(found.multipliers) == train.state_size
    after = revolve(found.state)
    assert np.abs(end_state(after) - found.state)[[0, 1, 4, 5]].max() < 1e-10
    assert np.ptp(after.memory, axis=0).min() > 1e-6  # the adjuster leaks and is filled, friction slides


def test_a_leak_that_takes_hundreds_of_revolutions_is_found_directly():
    """A mass of 1 N on an oil column beside a spring sinks until the spring alone carries it."""
    k, spring, period = 1e6, 1e3, 0.05
    leak = 300 * period * spring  # the force fades by exp(-1 / 300) a revolution
    elements = [(GROUND, 0, False, False, k, 0.0, 0.0, 0.0), (GROUND, 0, False, False, spring, 0.0, 0.0, 0.0)]
    own = laws([OIL, LINEAR], [k, spring], leak=[leak, 0.0])
    column = train([0.1], elements, force=-1.0, mass_damping=50.0, laws=own)
    revolve = rkg.prepare(column, no_lift(), 2 * np.pi / period, 1440)
    found = periodic_state(revolve, np.zeros(3), memories=1)
    sunk = 1.0 / spring
    assert found.state == pytest.approx([-sunk, 0.0, sunk], abs=1e-3 * sunk)
    assert found.revolutions < 43
    # a longer column fills at once and a shorter one sinks: the rate is that of one side or a mixture of both
    assert found.radius < 1.0


def test_friction_that_never_slides_leaves_a_multiplier_of_one():
    """Wherever it sticks, the motion is periodic: no state of them is the one that disturbances come back to."""
    elements = [(0, GROUND, False, False, 1e5, 0.0, 0.0, 0.0), (0, GROUND, False, False, 1e5, 60.0, 0.0, 0.0)]
    stuck = train([0.1], elements, laws=laws([FRICTION, LINEAR], [1e5, 1e5], slip=[50.0, 0.0]))
    revolve = rkg.prepare(stuck, no_lift(), 2 * np.pi / 0.05, 1440)
    found = periodic_state(revolve, np.array([1e-4, 0.0, 1e-5]), memories=1)
    assert not found.periodic and found.residual < 1e-4
    assert np.abs(found.multipliers).max() == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("refuses", [True, False])
def test_a_newton_step_that_fails_ends_the_search(monkeypatch, refuses):
    """The train refuses the fixed point, or keeps one state for ever, so that no fixed point is that of its map."""
    monkeypatch.setattr(periodic, "MOST_ACCELERATED", 0)

    def after(state):
        if not refuses:
            return np.array([state[0], 2.0 * state[1] - FIXED[1]])
        if np.abs(state - FIXED).max() < 1e-6:
            raise MotionRefused("out of bounds")
        return FIXED + 1.2 * (state - FIXED)

    found = periodic_state(revolve_to(after), np.array([0.0, 0.3]))
    assert not found.periodic and found.residual > 1.0 and len(found.multipliers) == 0


def test_the_best_of_the_mixed_states_is_where_newton_begins(monkeypatch):
    """Of states that follow each other by chance, so that the best is not the last."""
    monkeypatch.setattr(periodic, "MOST_NEWTON", 0)
    changes, drawn = [], np.random.default_rng(0)

    def after(state):
        image = UNIT * drawn.normal(size=2)
        changes.append(np.abs((image - state) / UNIT).max())
        return image

    found = periodic_state(revolve_to(after), START)
    mixed = changes[periodic.PLAIN : -periodic.WANDERING]
    assert found.residual == pytest.approx(min(mixed)) and min(mixed) < min(mixed[0], mixed[-1])
