"""Switching instants known in closed form, for every method: two contacts in turn, and contacts that barely touch."""

import numpy as np
import pytest

from camopt.exact import prepare as event_exact
from camopt.scene.train import GROUND
from camopt.study.extremes.extremes import STEP_METHODS as METHODS
from tests.verifier.trains import no_lift, train

STEP = 0.4 / 60_000
ALL = {**METHODS, "event": event_exact}


def moved(name, parts, start, duration):
    """The motion from `start` over `duration` [s]."""
    steps = round(duration / STEP)
    return ALL[name](parts, no_lift(), 2 * np.pi / duration, steps)(np.array(start))


def spans(motion, element):
    """Start and end [s] of every span in which a contact pushes, shape (m, 2)."""
    pushing = np.flatnonzero(motion.force[:, element] > 0)
    breaks = np.flatnonzero(np.diff(pushing) > 1)
    first, last = np.append(pushing[:1], pushing[breaks + 1]), np.append(pushing[breaks], pushing[-1:])
    return np.stack([motion.time[first], motion.time[last]], axis=1)


@pytest.mark.parametrize("name", ALL)
def test_two_contacts_in_turn(name):
    floor, ceiling, zeta, way, speed = 2e5, 9e4, 0.1, 0.05, 2.0
    below, above = np.sqrt(floor), np.sqrt(ceiling)
    parts = train(
        [1.0],
        [
            (GROUND, 0, True, False, floor, 0.0, 0.0, 0.0),
            (0, GROUND, True, False, ceiling, 2 * zeta * above, 0.0, way),
        ],
    )
    motion = moved(name, parts, [way / 2, -speed], 0.12)
    falls = way / 2 / speed
    rises = falls + np.pi / below  # half a period on the floor, and away as fast as it came
    meets = rises + way / speed
    b = np.sqrt(1 - zeta**2)  # f = k d + c d' of d ~ exp(-zeta w t) sin(b w t) vanishes before d does
    held = (np.pi - np.arctan2(2 * zeta * b, 1 - 2 * zeta**2)) / b
    pressed = np.exp(-zeta * held) * speed / above * np.sin(b * held) / b
    slowed = -np.exp(-zeta * held) * speed * (np.cos(b * held) - zeta / b * np.sin(b * held))
    leaves = meets + held / above
    again = leaves + (way + pressed) / slowed
    (first, second), (third,) = spans(motion, 0), spans(motion, 1)
    found = np.array([*first, *third, second[0]])
    assert np.abs(found - [falls, rises, meets, leaves, again]).max() < 4 * STEP
    assert slowed < 0.9 * speed and pressed > 1e-4  # the damper matters, and the contact opens while compressed
    if name == "event":  # closings and openings are samples
        jumps = motion.time[:-1][np.diff(motion.angle) == 0]
        for known in (falls, rises, meets, leaves, again):
            assert np.abs(jumps - known).min() < 1e-12


def thrown(name, past):
    """A ball of 1 kg thrown up 0.2 m against a stiff ceiling that is `past` [m] below the top of its flight."""
    height, weight = 0.2, 10.0
    parts = train([1.0], [(0, GROUND, True, False, 1e8, 0.0, 0.0, height - past)], force=-weight)
    return moved(name, parts, [0.0, np.sqrt(2 * weight * height)], 0.4)


@pytest.mark.parametrize("name", ALL)
def test_a_contact_that_is_just_missed_or_just_met_leaves_the_flight_alone(name):
    missed = thrown(name, -1e-6)
    parabola = 2.0 * missed.time - 5.0 * missed.time**2
    assert missed.force.max() == 0.0
    assert np.abs(missed.x[:, 0] - parabola).max() < 1e-6
    grazing = thrown(name, 0.0)
    parabola = 2.0 * grazing.time - 5.0 * grazing.time**2
    assert np.abs(grazing.x[:, 0] - parabola).max() < 1e-5


@pytest.mark.parametrize("name", ALL)
def test_a_grazing_touch_turns_the_ball_when_and_as_it_should(name):
    past, weight, omega = 1e-6, 10.0, 1e4
    motion = thrown(name, past)
    speed = np.sqrt(2 * weight * past)
    touch = (2.0 - speed) / weight
    held = 2 * np.arctan(speed * omega / weight) / omega  # y = -(g/w^2)(1 - cos wt) + (u/w) sin wt is zero again
    found = spans(motion, 0)
    assert found.shape == (1, 2)
    assert np.abs(found[0] - [touch, touch + held]).max() < 3 * STEP
    early = 2 * speed / weight - held  # what a flight without ceiling takes longer
    after = motion.time > touch + held + 5 * STEP
    later = motion.time[after] + early
    error = np.abs(motion.x[after, 0] - (2.0 * later - 5.0 * later**2)).max()
    # at 4 mm/s the touch is known to the round-off of 6e4 positions over that speed, 1e-11 s
    assert error < (1e-9 if name == "event" else 2e-5)
    assert 2.0 * early > 1e-3  # the touch shows fifty times above that
