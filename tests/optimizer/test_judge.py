"""The search's judge: a brief judgement has the same answer, and looks first where the limits were used most."""

import numpy as np

from camopt.cam.families.free import free_cam
from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.optimizer.search.judge import CRITICAL, Judge, next_starts
from camopt.scene import build_train, load_scene

SCENE = load_scene("motori-1")
CAM = free_cam(SCENE.design, 6.0)
SPEEDS = np.linspace(0.7, 1.0, 7) * max(SCENE.operation.speeds_rpm)
JUMPING = kinematic_optimum(SCENE.design, CAM).lift
PROGRAM = no_jump_program(build_train(SCENE), SCENE.design, CAM, [SCENE.cam_speed(s) for s in SPEEDS])
HELD = PROGRAM.solve(Margins(60.0, 60.0, 60.0)).lift


def test_a_cam_that_holds_is_judged_at_every_speed_however_briefly():
    judge = Judge(SCENE, SPEEDS)
    full, brief = judge(HELD), judge(HELD, briefly=True)
    assert full.holds and brief.holds
    np.testing.assert_array_equal(brief.speeds_rpm, SPEEDS)
    np.testing.assert_allclose(brief.share, full.share, atol=0.01)


def test_a_refused_cam_is_judged_briefly_at_its_worst_speeds_also_after_a_resume():
    judge, resumed = Judge(SCENE, SPEEDS), Judge(SCENE, SPEEDS)
    full = judge(JUMPING)
    assert not full.holds and len(full.speeds_rpm) == len(SPEEDS)
    resumed.remember(full)
    worst = SPEEDS[np.sort(np.argsort(-full.share.max(axis=0))[:CRITICAL])]
    for one in (judge, resumed):
        brief = one(JUMPING, briefly=True)
        assert not brief.holds
        np.testing.assert_array_equal(brief.speeds_rpm, worst)


def test_a_motion_that_broke_a_limit_or_was_refused_begins_anew():
    states, anew = np.array([[1.0, 2.0], [3.0, 4.0], [np.nan, np.nan]]), np.zeros(2)
    np.testing.assert_array_equal(next_starts(states, np.array([[1.0, 1.1, 0.0]]), anew), [[1.0, 2.0], anew, anew])
    np.testing.assert_array_equal(next_starts(states, np.zeros((0, 3)), anew), [*states[:2], anew])
