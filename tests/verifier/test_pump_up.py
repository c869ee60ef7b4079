"""Pump-up: an adjuster that fills while the valve flies and holds it off its seat is named as what it is."""

import numpy as np
import pytest

from camopt.cam.read import read_cam
from camopt.exact.settled import settled_metrics
from camopt.optimizer.as_built.drawn import DrawnTrains
from camopt.optimizer.search.judge import Judge
from camopt.scene import build_train, load_scene, state_at_rest
from camopt.verifier.neighbourhood import against_limits, pumped_up

SCENE = load_scene("finger-hydraulic")
TRAIN = build_train(SCENE)


@pytest.fixture(scope="module")
def settled():
    speeds = [SCENE.cam_speed(7500), SCENE.cam_speed(8200)]
    return settled_metrics([TRAIN], [read_cam("multi-pol", SCENE)], speeds)


def test_the_valve_that_never_seats_is_held_by_oil(settled):
    seats, held = settled.states[0, 0]
    assert np.isfinite(settled.worst("bounce_mm")[0, 0, 0]) and np.isnan(settled.worst("bounce_mm")[0, 0, 1])
    assert not pumped_up(TRAIN, seats) and pumped_up(TRAIN, held)
    gap = TRAIN.touch_compression[TRAIN.seat] - TRAIN.compression(held[:2], 0.0)[TRAIN.seat]
    assert gap > 1e-6, "the valve stands micrometres off its seat, all the time"


def test_the_verdict_names_it(settled):
    class Answer:
        worst, error, state = {"bounce_mm": np.nan}, {}, settled.states[0, 0, 1]

    assert against_limits(SCENE, 8200.0, Answer, []) == (("pump-up, never seats at 8200 r/min",), ())
    Answer.state = state_at_rest(TRAIN)
    assert against_limits(SCENE, 8200.0, Answer, []) == (("never seats at 8200 r/min",), ())


def test_a_search_does_not_begin_with_the_oil_of_the_cam_before():
    full, calm = read_cam("multi-pol", SCENE), read_cam("polydyne", SCENE)
    judge = Judge(SCENE, [7500.0, 8200.0])
    assert not judge(full).holds and judge(calm).holds
    drawn = DrawnTrains(SCENE, 0)
    drawn.draw(2)
    failing = []
    for lift in (full, calm):
        drawn.judge(lift, drawn.all)
        failing.append(drawn.failing)
    assert failing == [2, 0]


def test_a_train_without_adjuster_does_not_pump_up():
    train = build_train(load_scene("motori-1"))
    assert not pumped_up(train, state_at_rest(train)) and not pumped_up(TRAIN, None)


@pytest.mark.parametrize(("parts_of_travel", "carries"), [(-1.0, False), (0.5, False), (2.0, True)])
def test_only_oil_that_is_compressed_beyond_the_travel_of_its_ball_holds_a_valve(parts_of_travel, carries):
    state = state_at_rest(TRAIN)
    n = len(TRAIN.mass)
    state[:n] += 1e-3  # the valve opens along the axis
    assert TRAIN.compression(state[:n], 0.0)[TRAIN.seat] < TRAIN.touch_compression[TRAIN.seat]
    for i, e in enumerate(TRAIN.memory):
        state[2 * n + i] = TRAIN.compression(state[:n], 0.0)[e] - parts_of_travel * TRAIN.laws.travel[e]
    assert pumped_up(TRAIN, state) == carries
