"""The program along slopes of real motions: its slopes, and what its steps are worth."""

import numpy as np
import pytest

from camopt import multi_pol
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.cam.polynomials import recentred
from camopt.exact.settled import settled_metrics
from camopt.optimizer.as_built import slopes_program
from camopt.optimizer.as_built.drawn import TrainEnsemble
from camopt.optimizer.as_built.search import free_program
from camopt.optimizer.as_built.slopes_program import SHAPING, SlopesProgram, _by_pieces
from camopt.optimizer.program.kinematic import lift_to_reach
from camopt.optimizer.search.judge import limit_usage
from camopt.scene import load_scene
from camopt.storage.journal import StepFiles
from tests.optimizer.as_built.test_yield_search import SCENE

WANTED, PRICE, KEPT_N = 0.9, 0.5, 10.0


def settled(program: SlopesProgram) -> SlopesProgram:
    """With the motions of all trains settled with its cam."""
    program.drawn.judge(program.cam.lift, np.ones_like(program.drawn.watched))
    return program


def begun() -> SlopesProgram:
    """The program about a cam whose contacts keep a force in the train as designed, and which some drawn ones break."""
    plain, _ = free_program(SCENE)
    cam = plain.solve_below(np.full((3, len(plain.blocks)), KEPT_N))
    program = SlopesProgram(plain, TrainEnsemble(SCENE, 5), 24, 1.0 - WANTED, StepFiles(None, SHAPING))
    assert program.move_to(cam.z) > 2.0
    program.set_targets()
    return program


def test_the_slopes_are_those_of_settled_motions():
    """Where a motion repeats itself, its use of a limit with a neighbouring cam is foretold."""
    program, step, errors = settled(begun()), 2e-5, []
    direction, drawn, rows = np.cos(np.arange(len(program.cam.z))), program.drawn, program._trace()
    for r in range(len(rows.train)):
        t = int(rows.train[r])
        one, use = drawn.trains[t], rows.offset[r] + rows.slope[r] @ program.cam.z
        limit, s = np.argwhere(np.abs(drawn.used[t] - use) < 1e-12)[0]
        sides = []
        for sign in (1.0, -1.0):
            lift = one.cam(program.plain.cam.lift(program.cam.z + sign * step * direction))
            start = drawn.states[t, [s]]
            found = settled_metrics([one.train], [lift], [drawn.speeds(t)[s]], starts=start, measured=1, workers=1)
            sides.append((limit_usage(drawn.limits, found)[limit, 0], bool(found.periodic.all())))
        if not all(periodic for _, periodic in sides):
            continue
        measured = (sides[0][0] - sides[1][0]) / (2 * step)
        errors.append(abs(measured - rows.slope[r] @ direction) / np.abs(rows.slope[r]).sum())
    assert len(errors) > 20 and np.median(errors) < 1e-4 and np.quantile(errors, 0.9) < 0.01


def test_a_slope_by_a_ground_cam_is_one_by_the_plain_cam():
    plain = polydyne(SCENE)
    finer = np.union1d(plain.borders, np.linspace(-1.0, 1.0, 57))
    piece = np.searchsorted(plain.borders, 0.5 * (finer[1:] + finer[:-1])) - 1
    change = np.random.default_rng(3).standard_normal(plain.coefficients.shape)
    ground = recentred(Lift(plain.borders, change, plain.half_duration), piece, finer[:-1])
    slope = np.random.default_rng(4).standard_normal(ground.shape)
    assert np.sum(_by_pieces(slope, finer, plain.borders) * change) == pytest.approx(np.sum(slope * ground), rel=1e-12)


def test_steps_are_worth_more_and_keep_the_limits_on_the_shape():
    """The worth is what the program maximises, here by the motions of all trains with each cam."""
    program = begun()

    def worth() -> float:
        beyond = np.maximum(settled(program).drawn.used - program.targets[:, None], 0.0).max(axis=(1, 2))
        return program.cam.area_ratio - PRICE * float(np.minimum(beyond, slopes_program.FARTHEST).mean())

    first, limits = worth(), program.plain.limits
    for _ in range(6):
        program.step(PRICE)
        assert np.all(limits.matrix @ program.cam.z <= limits.bound + 1e-9 * np.abs(limits.matrix).max(axis=1))
    assert worth() > first + 1e-3


def test_the_mean_is_that_of_the_last_cams_and_within_the_limits():
    program, areas = begun(), []
    for _ in range(slopes_program.MEAN + 1):
        program.step(PRICE)
        areas.append(program.cam.area_ratio)
    limits, mean = program.plain.limits, program.mean
    assert mean.area_ratio == pytest.approx(np.mean(areas[1:]), rel=1e-12) and min(areas) < mean.area_ratio < max(areas)
    assert mean.lift.area_ratio_in(program.plain.design) == pytest.approx(mean.area_ratio, rel=1e-9)
    assert np.all(limits.matrix @ mean.z <= limits.bound + 1e-9 * np.abs(limits.matrix).max(axis=1))


def test_cams_move_within_a_box_that_narrows_and_widens():
    """At a price that drives every cam to its border."""
    program, moved = begun(), []
    for farther in (False, False, True, True):
        before = program.cam.z
        program.step(1e6 * PRICE, farther=farther)
        moved.append(np.abs(program.cam.z - before).max())
    assert np.array(moved[1:]) / moved[:-1] == pytest.approx(
        [slopes_program.NARROWER, slopes_program.NARROWER, 1.0 / slopes_program.NARROWER], rel=1e-6
    )


def test_another_cam_is_followed_anew():
    """What the first trains used with a cam that is far too large says nothing of a smaller one."""
    plain, _ = free_program(SCENE)
    large, small = (plain.solve_below(np.full((3, len(plain.blocks)), force)) for force in (-60.0, 30.0))
    program = SlopesProgram(plain, TrainEnsemble(SCENE, 5), 24, 1.0 - WANTED, StepFiles(None, SHAPING))
    shares = [program.move_to(cam.z) for cam in (large, small, large)]
    assert shares[0] > 5.0 and shares[1] < 1.0 and shares[2] > 5.0


def test_an_adjuster_that_pumped_up_with_one_cam_is_at_rest_with_the_next():
    scene = load_scene("finger-hydraulic")
    plain, _ = free_program(scene)
    program = SlopesProgram(plain, TrainEnsemble(scene, 5), 4, 1.0 - WANTED, StepFiles(None, SHAPING))
    program.drawn.settle(polydyne(scene))
    program.drawn.draw(1)
    program.targets[:] = np.inf  # no slopes
    large, calm, top = multi_pol(scene), polydyne(scene), np.array([len(program.drawn.speeds(0)) - 1])
    program._traced_train(large, 0, top)
    assert program.drawn.worst[0] > 1.0
    program._traced_train(calm, 0, top)
    assert program.drawn.used[0, :, top].max() < 0.5


def test_a_higher_price_leads_to_a_smaller_cam():
    areas = []
    for price in (0.02, 2.0):
        program = begun()
        for _ in range(4):
            program.step(price)
        areas.append(program.cam.area_ratio)
    assert areas[0] > areas[1] + 1e-3


def test_the_maximum_lift_is_reached_where_the_design_asks_for_it(monkeypatch):
    """At a high price the steps make the cam smaller, but not lower."""
    highest = []
    for reach in (False, True):
        design = SCENE.design.model_copy(update={"reach_max_lift": reach, "max_lift_mm": 6.0})
        monkeypatch.setitem(globals(), "SCENE", SCENE.model_copy(update={"design": design}))
        program = begun()
        for _ in range(4):
            program.step(50.0)
        highest.append(program.cam.lift.max_lift)
    assert lift_to_reach(design) - 1e-12 <= highest[1] <= 6e-3 + 1e-12 and highest[0] < 5.5e-3
