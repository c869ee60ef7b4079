"""The program along slopes of real motions: its slopes, what its steps are worth, and its resumption."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.cam.polynomials import recentred
from camopt.exact.settled import settled_metrics
from camopt.highs import Infeasible
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.as_built import levels, slopes_program
from camopt.optimizer.as_built.drawn import FOLDER, TrainEnsemble
from camopt.optimizer.as_built.measured import used_limits
from camopt.optimizer.as_built.search import free_program, yield_search
from camopt.optimizer.as_built.slopes_program import SHAPING, CamOfSlopes, SlopesProgram, _by_pieces
from camopt.optimizer.program.kinematic import area_ratio_row, lift_to_reach
from camopt.scene import parse_scene
from camopt.storage.journal import StepFiles
from tests.optimizer.as_built.test_yield_search import SCATTER
from tests.scene.test_load import EXAMPLE

SCENE = parse_scene(EXAMPLE + SCATTER, "mine.toml")
EFFORT = replace(ACCURACIES["draft"], shaping_trains=20, unseen_trains=30, sloped_trains=24)
WANTED, PRICE, PULLING_N = 0.9, 0.5, -10.0


def begun() -> SlopesProgram:
    """The program about a cam whose contacts pull in the train as designed, which is too large for many drawn ones."""
    plain, _ = free_program(SCENE)
    z = plain.solve_below(np.full((3, len(plain.blocks)), PULLING_N)).z
    row, constant = area_ratio_row(plain.design, plain.cam)
    program = SlopesProgram(plain, TrainEnsemble(SCENE, 5), StepFiles(None, SHAPING))
    program.begin(CamOfSlopes(z, float(row @ z + constant), plain.cam.lift(z)), 24, WANTED)
    return program


def test_the_slopes_are_those_of_settled_motions():
    """Where a motion repeats itself, its use of a limit with a neighbouring cam is foretold."""
    program, step, errors = begun(), 2e-5, []
    direction = np.cos(np.arange(len(program.cam.z)))
    rows, drawn = program._rows[-1], program.drawn
    for r in range(len(rows.train)):
        t = int(rows.train[r])
        one, use = drawn.trains[t], rows.offset[r] + rows.slope[r] @ program.cam.z
        limit, s = np.argwhere(np.abs(drawn.used[t] - use) < 1e-12)[0]
        sides = []
        for sign in (1.0, -1.0):
            lift = one.cam(program.plain.cam.lift(program.cam.z + sign * step * direction))
            start = drawn.states[t, [s]]
            found = settled_metrics([one.train], [lift], [drawn.speeds(t)[s]], starts=start, measured=1, workers=1)
            sides.append((used_limits(drawn.limits, found)[limit, 0], bool(found.periodic.all())))
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
        program.drawn.judge(program.cam.lift, program.drawn.all)
        beyond = np.maximum(program.drawn.used - program.targets[:, None], 0.0).max(axis=(1, 2))
        return program.cam.area_ratio - PRICE * float(np.minimum(beyond, slopes_program.FARTHEST).mean())

    first, limits = worth(), program.plain.limits
    for _ in range(6):
        program.step(PRICE)
        assert np.all(limits.matrix @ program.cam.z <= limits.bound + 1e-9 * np.abs(limits.matrix).max(axis=1))
    assert worth() > first + 1e-3


def test_a_higher_price_leads_to_a_smaller_cam():
    areas = []
    for price in (0.02, 2.0):
        program = begun()
        for _ in range(4):
            program.step(price)
        areas.append(program.cam.area_ratio)
    assert areas[0] > areas[1] + 1e-3


def test_the_search_goes_on_along_slopes_and_resumes(tmp_path, monkeypatch):
    """Its cams hold as those of the levels do, and what was traced is not traced again."""
    monkeypatch.setattr(levels, "STEPS", 3)
    monkeypatch.setattr(levels, "PRICES", 2)
    found = yield_search(SCENE, WANTED, EFFORT, journal=StepFiles(tmp_path, FOLDER))
    plain = yield_search(SCENE, WANTED, replace(EFFORT, sloped_trains=0))
    assert found.trains_drawn == 24 + 30 and plain.trains_drawn == 20 + 30
    assert found.steps == plain.steps + 5 and found.best.area_ratio >= plain.best.area_ratio
    lines = (tmp_path / "history.jsonl").read_text().splitlines()
    assert sum(levels.SLOPES in line for line in lines) == 5

    def traced(*_):
        raise AssertionError("a motion is traced again")

    monkeypatch.setattr(slopes_program, "TracedMotion", traced)
    again = yield_search(SCENE, WANTED, EFFORT, journal=StepFiles(tmp_path, FOLDER))
    assert np.array_equal(again.best.z, found.best.z)
    assert (tmp_path / "history.jsonl").read_text().splitlines() == lines


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


def test_a_program_that_is_not_solved_leaves_the_cams_that_hold():
    search, held = levels.YieldSearch(TrainEnsemble(SCENE, 0), None, WANTED), ["a cam"]
    search.held = held
    for error in (Infeasible, ArithmeticError):
        slopes = SimpleNamespace(drawn=SimpleNamespace(trains=[None]), step=lambda _, e=error: (_ for _ in ()).throw(e))
        search.along_slopes(slopes)
    assert search.held == ["a cam"] and search.steps == 0
