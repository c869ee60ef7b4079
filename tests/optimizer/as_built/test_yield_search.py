"""The search for yield: the slope of its objective, its resumption, its statement and what it refuses."""

import json
from copy import deepcopy
from types import SimpleNamespace

import numpy as np
import pytest

from camopt.cli.parser import main
from camopt.measure.limits import broken_by_shape
from camopt.measure.yields import UsedLimits, share_of
from camopt.optimizer.as_built import search as search_module
from camopt.optimizer.as_built.design import YieldEffort, yield_search
from camopt.optimizer.as_built.drawn import DrawnTrains
from camopt.optimizer.as_built.journal import FOLDER, HISTORY, TrainsLog
from camopt.optimizer.as_built.linear_step import UsedSlopes, stepped
from camopt.optimizer.as_built.search import YieldSearch
from camopt.optimizer.as_built.statement import YieldStatement, sampled
from camopt.optimizer.as_built.wanted import check_wanted
from camopt.optimizer.program.kinematic import TYPICAL
from camopt.optimizer.program.no_jump import Margins
from camopt.scene import InputError, load_scene, parse_scene
from tests.scene.test_load import EXAMPLE

SCATTER = '\n[[tolerance]]\nof = "spring.preload_N"\nrelative = 0.05\n[grinding]\nerror_um = 2.0\nharmonics = [2, 40]\n'
SCENE = parse_scene(EXAMPLE + SCATTER, "mine.toml")
SMALL = YieldEffort(12, 2, 4, 12, 5)


@pytest.fixture(scope="module")
def found():
    return yield_search(SCENE, 0.9, SMALL)


def test_every_cam_that_counts_holds_in_enough_trains(found):
    areas = [cam.area_ratio for cam in found.held]
    assert areas == sorted(areas) and found.common is not None
    drawn = found.drawn
    drawn.judge(found.best.lift, drawn.all)
    assert found.holds and len(drawn.trains) == 20


class Told:
    """Trains of which it is told what they use of one limit, in place of those that move (t, l, s)."""

    def __init__(self, trains: int, speeds: int):
        self.trains, self.motions = [None] * trains, 0
        self.used, self.truth = np.zeros((trains, 1, speeds)), np.full((trains, 1, speeds), 0.1)

    def judge(self, lift, wanted):
        self.motions += int(wanted.sum())
        self.used = np.where(wanted[:, None], self.truth, self.used)


@pytest.mark.parametrize("speed", [0, 4])
def test_calm_trains_that_a_cam_breaks_are_seen_at_once(speed):
    drawn = Told(200, 5)
    search = YieldSearch(drawn, None, 0.9)
    search._judge(None)
    assert 0 < drawn.motions < 200
    drawn.truth[:, 0, speed] = 80.0
    asked = search._judge(None)
    assert asked[:, speed].all() and np.all(drawn.used[:, 0, speed] == 80.0)
    assert asked.sum() < 500


def test_every_train_has_its_turn_as_a_scout():
    drawn = Told(64, 3)
    drawn.truth[:13, 0, 1] = drawn.used[:13, 0, 1] = 0.6  # so many that the speed matters
    search = YieldSearch(drawn, None, 0.9)
    asked = np.zeros((64, 3), dtype=int)
    for step in range(search_module.FAR_SCOUTS):
        search.steps = step
        asked += search._judge(None)
    few = search_module.FAR_SCOUTS // search_module.SCOUTS
    assert np.all(asked == [[1, search_module.FAR_SCOUTS, few]] * 13 + [[1, few, few]] * 51)


@pytest.fixture(scope="module")
def falling_short(found):
    """A cam with which some trains fall short of their aim, judged."""
    margins = np.full((3, len(found.program.blocks)), 40.0)
    while True:
        solved = found.program.solve(Margins(*margins))
        found.drawn.judge(solved.lift, found.drawn.all)
        if found.shortfall > 0.02:
            return solved
        margins -= 2.0


def test_what_trains_use_has_the_slope_of_its_differences(found, falling_short):
    """Central differences with common random numbers; the adjoint leaves out what is older than two revolutions."""
    drawn, cam = found.drawn, falling_short
    drawn.judge(cam.lift, drawn.all)
    used = drawn.used.copy()
    slopes = drawn.slopes(cam.program.cam, cam.z, (0.3, 3.0), 2)
    assert len(slopes.train) > len(set(slopes.train.tolist())) > 3
    direction = np.random.default_rng(0).normal(size=len(cam.z)) * TYPICAL
    step = 1e-6

    def at(share: float) -> np.ndarray:
        drawn.judge(cam.program.cam.lift(cam.z + share * direction), drawn.all)
        return drawn.used.copy()

    difference = (at(step) - at(-step)) / (2 * step)
    value = slopes.level + slopes.slope @ cam.z
    expected = [difference[t][np.isclose(used[t], u, atol=1e-9)][0] for t, u in zip(slopes.train, value, strict=True)]
    scale = np.abs(expected).max()
    assert scale > 1.0
    np.testing.assert_allclose(slopes.slope @ direction, expected, rtol=0.02, atol=0.02 * scale)


def test_a_step_keeps_the_budget_by_its_slopes_and_its_cam_the_shape(falling_short):
    """By slopes in two margins, from which those by the coefficients are made with the program's own jacobian."""
    cam = falling_short
    by_margin = cam.jacobian().reshape(len(cam.z), -1)
    binding = np.argsort(cam.margin_prices.ravel())[:2]
    wanted = np.zeros((3, by_margin.shape[1]))
    wanted[0, binding[0]], wanted[1, binding[0]], wanted[2, binding[1]] = -0.05, -0.02, -0.03
    slope = wanted @ np.linalg.pinv(by_margin)
    seen = slope @ by_margin
    at_cam = np.array([0.9, 1.1, 0.8])
    found = UsedSlopes(np.array([4, 4, 7]), at_cam - slope @ cam.z, slope)
    margins = stepped(cam, found, 0.75, 0.1, 20.0)
    change = (margins - cam.margins).ravel()
    used = at_cam + seen @ change
    assert max(used[0] - 0.75, used[1] - 0.75, 0.0) + max(used[2] - 0.75, 0.0) <= 0.1 + 1e-9
    assert np.abs(change).max() <= 20.0 + 1e-9
    free = stepped(cam, found, 0.75, 10.0, 20.0)
    gain = [float(cam.margin_prices.ravel() @ (m - cam.margins).ravel()) for m in (margins, free)]
    assert gain[1] > gain[0] and gain[1] > 0.0
    moved = cam.program.solve(Margins(*free))
    assert moved.area_ratio > cam.area_ratio and not broken_by_shape(moved.lift, SCENE.design)


def test_steps_along_slopes_bring_a_cam_back_that_too_few_trains_hold(found, falling_short):
    search = YieldSearch(found.drawn, found.program, 0.99)
    search.consider("margins along slopes", falling_short)
    assert not search.holds
    search.by_slopes(falling_short, 8)
    assert search.best is not None
    found.drawn.judge(search.best.lift, found.drawn.all)
    assert search.holds
    assert not broken_by_shape(search.best.lift, SCENE.design)


@pytest.mark.parametrize("least", [3.3, -17.0, -1e9])
def test_margins_move_together_to_the_lowest_that_hold(monkeypatch, least):
    """Cams grow as the margins fall, but for the last case, in which margins bind no more below 0 N."""
    floor = 0.0 if least < -1e6 else -np.inf

    class Program:
        def solve(self, margins):
            return SimpleNamespace(z=None, area_ratio=float(-max(margins.opening[0], floor)))

    search = search_module.YieldSearch(DrawnTrains(SCENE, 0), Program(), 0.9)

    def consider(_, cam):
        if -cam.area_ratio >= least and (not search.held or cam.area_ratio > search.held[-1].area_ratio):
            search.held.append(cam)
        return -cam.area_ratio >= least

    monkeypatch.setattr(search, "consider", consider)
    margins = search.lowest(np.zeros((3, 2)), 10.0)
    assert margins.shape == (3, 2) and least <= margins[0, 0] <= max(least + search_module.LAST_STEP_N, 0.0)


def test_every_train_is_judged_at_the_top_of_the_band():
    drawn = DrawnTrains(SCENE, 0)
    top = SCENE.cam_speed(SCENE.operation.band_rpm[1])
    assert [drawn.speeds(t)[-1] for t in range(5)] == pytest.approx([top] * 5)


def test_the_budget_is_the_shortfall_of_as_many_failing_trains_as_may_fail():
    worst = np.full(100, 0.5)
    worst[:4] = 1.2
    drawn = SimpleNamespace(trains=[None] * 100, worst=worst, failing=4)
    search = YieldSearch(drawn, None, 0.9)
    search._measure_budget()
    assert search.allowed == 6 and search.budget == pytest.approx(6 * (1.2 - search_module.AIM) / 100)
    drawn.failing = 1  # of one train nothing is known
    search._measure_budget()
    assert search.per_failing == pytest.approx(1.2 - search_module.AIM)


def test_as_many_trains_are_drawn_as_may_fail_often_enough():
    effort = YieldEffort(300, 20, 14, 1000, 21)
    assert [effort.trains_for(wanted) for wanted in (0.99, 0.95, 0.8)] == [2000, 400, 300]


def test_a_resumed_search_judges_nothing_twice(tmp_path, monkeypatch):
    first = yield_search(SCENE, 0.9, SMALL, log=TrainsLog(tmp_path))
    lines = (tmp_path / HISTORY).read_text()
    last = sorted((tmp_path / FOLDER).glob("*.npz"))[-1]
    last.unlink()
    judged, judge = [], YieldSearch._judge
    monkeypatch.setattr(YieldSearch, "_judge", lambda self, lift: judged.append(lift) or judge(self, lift))
    again = yield_search(SCENE, 0.9, SMALL, log=TrainsLog(tmp_path))
    assert len(judged) == 1 and last.stem == f"{first.steps:04d}"
    assert np.array_equal(again.best.z, first.best.z)
    assert (tmp_path / HISTORY).read_text() == lines


def test_a_journal_of_another_search_is_refused(found, tmp_path):
    log = TrainsLog(tmp_path)
    drawn, judged = deepcopy(found.drawn), found.drawn.all
    judged[1:] = False
    log.keep(1, found.best.z, drawn, judged)
    drawn.used[:2], drawn.states[:2] = 7.0, 7.0
    assert log.recalled(1, found.best.z, drawn)
    assert np.array_equal(drawn.used[0], found.drawn.used[0]) and np.all(drawn.used[1] == 7.0)
    assert np.array_equal(drawn.states[0], found.drawn.states[0]) and np.all(drawn.states[1] == 7.0)
    with pytest.raises(InputError, match="belongs to another search"):
        log.recalled(1, found.best.z + 1e-3, found.drawn)


@pytest.mark.parametrize(
    "failing, agrees, confirmed", [(10, True, True), (11, True, False), (10, False, False), (0, True, True)]
)
def test_a_yield_is_confirmed_by_share_interval_and_methods(failing, agrees, confirmed):
    used = np.full((1000, 1, 1), 0.5)
    used[:failing] = 1.5
    limits = UsedLimits(("jump_max_mm",), np.array([7000.0]), used)
    sample = ({"agrees": agrees},)
    stated = YieldStatement(0.99, 0, limits, share_of(limits.holds), {}, sample, {"polydyne": "none"})
    assert stated.confirmed is confirmed
    record = stated.as_dict()
    assert record["trains"] == 1000 and record["baselines"]["polydyne"] == {"reason": "none"}
    json.dumps(record, allow_nan=False)


def test_the_sample_has_the_trains_next_to_the_limit():
    assert sampled(np.array([0.2, 1.5, 0.9, 1.1])) == [2, 3, 0]
    assert sampled(np.array([0.9, 0.2])) == [0]


@pytest.mark.parametrize(
    "scene, wanted, speeds, words",
    [
        ("kodama", 0.99, "nominal", "whole band"),
        ("kodama", 1.0, "band", "a share from 0.5"),
        ("untolerated", 0.99, "band", "needs \\[\\[tolerance\\]\\]"),
    ],
)
def test_what_no_yield_is_searched_for(scene, wanted, speeds, words):
    with pytest.raises(InputError, match=words):
        check_wanted(parse_scene(EXAMPLE, "mine.toml") if scene == "untolerated" else load_scene(scene), wanted, speeds)


def test_the_command_refuses_at_once(tmp_path, capsys):
    assert main(["optimize", "kodama", "--yield", "1.5", "--out", str(tmp_path / "run")]) == 2
    assert "a share from 0.5" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
