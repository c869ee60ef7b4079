"""Steps of event-exact: whole numbers of them where spans are to end, and none longer than the modes allow."""

from functools import cache

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare
from camopt.exact.engine import FEWEST_STEPS, LONGEST_SPAN, MOST_AT_ONCE, free_step, step_on_borders
from camopt.exact.kernel.propagators import default_step
from camopt.scene import build_train, load_scene

ROUNDING = 1e-9


@cache
def one_mass():
    scene = load_scene("motori-1")
    return build_train(scene), polydyne(scene)


def whole(number):
    assert number == pytest.approx(round(number), rel=ROUNDING)
    return round(number)


@pytest.mark.parametrize("steps", [0.4, 1.0, 2.5, 11.9, 12.0, 12.2, 25.0, 40.7])
def test_spans_end_on_borders_and_are_as_long_as_they_may_be(steps):
    """A spacing of so many default steps takes the fewest spans, and these the fewest steps."""
    train, speed = one_mass()[0], 300.0
    default = default_step(train)
    step, at_once = step_on_borders(train, speed, steps * default * speed)
    taken = whole(steps * default / step)
    needed = int(np.ceil(steps))
    spans = int(np.ceil(needed / LONGEST_SPAN))
    assert at_once <= LONGEST_SPAN and taken == spans * at_once
    assert needed <= taken < needed + spans


@pytest.mark.parametrize("speed", [1.0, 40.0, 300.0, 3000.0, 30_000.0])
def test_the_free_step_is_halved_until_a_revolution_has_enough(speed):
    train = one_mass()[0]
    step, period = free_step(train, speed), 2 * np.pi / speed
    halvings = whole(np.log2(default_step(train) / step))
    assert halvings >= 0 and period / step >= FEWEST_STEPS * (1 - ROUNDING)
    assert halvings == 0 or period / (2 * step) < FEWEST_STEPS


@pytest.mark.parametrize("samples", [7, 90, 360, 1000, 20_000])
@pytest.mark.parametrize("speed", [300.0, 30_000.0])
def test_whole_spans_reach_from_sample_to_sample(samples, speed):
    """Also at a speed at which the default step is halved."""
    train, lift = one_mass()
    motion = prepare(train, lift, speed, samples)
    default, per_sample = free_step(train, speed), motion.period / samples
    taken = whole(per_sample / motion.step)
    needed = int(np.ceil(per_sample / default * (1 - ROUNDING)))
    spans = int(np.ceil(needed / MOST_AT_ONCE))
    assert motion.step <= default * (1 + ROUNDING) and motion._per_sample <= MOST_AT_ONCE
    assert taken == spans * motion._per_sample and needed <= taken < needed + spans
    assert (prepare(train, lift, speed).step, prepare(train, lift, speed)._per_sample) == (default, 1)
