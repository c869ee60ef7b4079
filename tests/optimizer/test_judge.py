"""The search's judge: what it leaves out, where it looks first, and what it makes of motions that wander."""

from dataclasses import replace

import numpy as np

from camopt.cam.families.free import free_cam
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.optimizer.search.judge import (
    CRITICAL,
    IRREGULAR,
    SETTLES,
    SETTLES_SLOWLY,
    WATCHED_SHARE,
    Judge,
    most_to_settle,
    next_starts,
    with_speeds_between,
)
from camopt.optimizer.search.margins import used_by_kind
from camopt.scene import build_train, load_scene
from camopt.scene.settled import FADED, PLAIN_REVOLUTIONS
from camopt.scene.vibration import slowest_rate

SCENE = load_scene("motori-1")
CAM = free_cam(SCENE.design, 6.0)
SPEEDS = np.linspace(0.7, 1.0, 7) * max(SCENE.operation.speeds_rpm)
JUMPING = kinematic_optimum(SCENE.design, CAM).lift
PROGRAM = no_jump_program(build_train(SCENE), SCENE.design, CAM, [SCENE.cam_speed(s) for s in SPEEDS])
HELD = PROGRAM.solve(60.0).lift


FINE = np.linspace(SPEEDS[0], SPEEDS[-1], 6 * len(SPEEDS) - 5)


def test_a_stride_leaves_out_only_speeds_beside_which_little_is_used():
    full, coarse = Judge(SCENE, FINE)(HELD), Judge(SCENE, FINE, stride=6)(HELD)
    at = np.searchsorted(FINE, coarse.speeds_rpm)
    np.testing.assert_allclose(coarse.share, full.share[:, at], atol=0.01)
    left_out = np.setdiff1d(np.arange(len(FINE)), at)
    assert len(left_out) and full.share[:, left_out].max() < coarse.share.max()
    watched = at[coarse.share.max(axis=0) > WATCHED_SHARE]
    assert all(np.isin(np.arange(max(0, i - 5), min(len(FINE), i + 6)), at).all() for i in watched if i % 6 == 0)


def test_a_cam_that_uses_too_much_is_judged_at_the_worst_speeds_alone_also_after_a_resume():
    judge, resumed = (Judge(SCENE, SPEEDS, 2, usable=0.9) for _ in range(2))
    full = Judge(SCENE, SPEEDS)(JUMPING)
    assert full.used > 1.0 and len(full.speeds_rpm) == len(SPEEDS)
    for one in (judge, resumed):
        one.remember(full)
        worst = SPEEDS[np.sort(np.argsort(-full.share.max(axis=0))[:CRITICAL])]
        np.testing.assert_array_equal(one(JUMPING).speeds_rpm, worst)


def test_a_speed_stands_for_those_of_the_band_nearest_to_it():
    band = Judge(SCENE, FINE)(HELD)
    judged = with_speeds_between(Judge(SCENE, SPEEDS)(HELD), band)
    nearest = np.abs(FINE[:, None] - SPEEDS).argmin(axis=1)
    for s in range(len(SPEEDS)):
        assert np.all(judged.share[:, s] >= band.share[:, nearest == s].max(axis=1))


def test_a_motion_that_wanders_needs_room():
    judged = Judge(SCENE, SPEEDS)(HELD)
    wandering = replace(judged, spread=np.full(len(SPEEDS), IRREGULAR))
    assert wandering.used == IRREGULAR * judged.share.max()


def test_a_motion_that_broke_a_limit_or_was_refused_begins_anew():
    states, anew = np.array([[1.0, 2.0], [3.0, 4.0], [np.nan, np.nan]]), np.zeros(2)
    np.testing.assert_array_equal(next_starts(states, np.array([[1.0, 1.1, 0.0]]), anew), [[1.0, 2.0], anew, anew])
    np.testing.assert_array_equal(next_starts(states, np.zeros((0, 3)), anew), [*states[:2], anew])


def test_what_a_wandering_motion_uses_counts_for_the_margins_as_it_does_for_the_cam():
    train, speeds = build_train(SCENE), np.array([SCENE.cam_speed(s) for s in SPEEDS])
    judged = Judge(SCENE, SPEEDS)(HELD)
    wandering = replace(judged, spread=np.full(len(SPEEDS), IRREGULAR))
    plain, with_room = (used_by_kind(train, HELD, one, speeds) for one in (judged, wandering))
    assert 0.0 < judged.used == plain.max() and with_room.max() == wandering.used <= 1.0
    np.testing.assert_allclose(with_room, IRREGULAR * plain, rtol=1e-12)


def test_a_motion_whose_slowest_mode_fades_slowly_may_take_longer_to_settle():
    train = build_train(SCENE)

    def most(revolutions):
        """At the cam speed at which the slowest mode fades in so many."""
        return most_to_settle(train, slowest_rate(train) * 2 * np.pi * revolutions / FADED)

    assert most(PLAIN_REVOLUTIONS - 0.5) == SETTLES
    assert most(PLAIN_REVOLUTIONS + 4.5) == PLAIN_REVOLUTIONS + 5
    assert most(10 * SETTLES_SLOWLY) == SETTLES_SLOWLY
    oil = build_train(load_scene("finger-hydraulic"))
    assert most_to_settle(oil, 1e3) == PLAIN_REVOLUTIONS
