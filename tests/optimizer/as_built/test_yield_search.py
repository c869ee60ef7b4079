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
from camopt.optimizer.as_built.design import UNSEEN_SEED, YieldEffort, yield_search
from camopt.optimizer.as_built.drawn import DrawnTrains
from camopt.optimizer.as_built.journal import FOLDER, TrainsLog
from camopt.optimizer.as_built.linear_step import UsedSlopes, stepped
from camopt.optimizer.as_built.search import YieldSearch
from camopt.optimizer.as_built.statement import YieldStatement, sampled
from camopt.optimizer.as_built.wanted import check_wanted
from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.kinematic import TYPICAL
from camopt.optimizer.step_files import HISTORY
from camopt.scene import InputError, load_scene, parse_scene
from tests.scene.test_load import EXAMPLE

SCATTER = '\n[[tolerance]]\nof = "spring.preload_N"\nrelative = 0.05\n[grinding]\nerror_um = 2.0\nharmonics = [2, 40]\n'
SCENE = parse_scene(EXAMPLE + SCATTER, "mine.toml")
SMALL = YieldEffort(12, 2, 6, 4, 30, 12, 5)


@pytest.fixture(scope="module")
def found():
    return yield_search(SCENE, 0.9, SMALL)


def test_every_cam_that_counts_holds_in_enough_trains(found):
    areas = [cam.area_ratio for cam in found.held]
    assert areas == sorted(areas) and found.without_gradients in found.held
    drawn = found.drawn
    assert drawn.seed == UNSEEN_SEED and len(drawn.trains) == 30 and found.allowed == 1
    assert found.trains_drawn == 20 + 30
    for cam in found.held:
        drawn.judge(cam.lift, drawn.all)
        assert found.holds and not broken_by_shape(cam.lift, SCENE.design)


def test_other_trains_say_how_large_the_cam_is_than_those_that_shaped_it(found, tmp_path):
    yield_search(SCENE, 0.9, SMALL, log=TrainsLog(tmp_path))
    lines = [json.loads(line) for line in (tmp_path / HISTORY).read_text().splitlines()]
    counts = [line["trains"] for line in lines]
    assert counts == sorted(counts) and set(counts) == {12, 20, 30}
    stages = [line["stage"] for line in lines if line["trains"] == 20]
    assert list(dict.fromkeys(stages)) == [search_module.COMMON, search_module.BY_GROUPS, search_module.ALONG_SLOPES]
    shaped = {line["area_ratio"] for line in lines if line["stage"] != search_module.COMMON}
    assert max(shaped) - min(shaped) < 1e-4
    assert {line["stage"] for line in lines if line["trains"] == 30} == {search_module.COMMON}


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


def test_a_step_takes_shortfall_away_and_no_area_by_its_slopes(falling_short):
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

    def short(change: np.ndarray) -> float:
        used = at_cam + seen @ change - 0.75
        return max(used[0], used[1], 0.0) + max(used[2], 0.0)

    for reach_N in (2.0, 20.0):
        change = (stepped(cam, found, 0.75, reach_N) - cam.margins).ravel()
        assert np.abs(change).max() <= reach_N + 1e-9 and short(change) < 0.99 * short(np.zeros_like(change))
        assert cam.margin_prices.ravel() @ change >= -1e-9
        random = np.random.default_rng(0)
        for _ in range(200):  # no other change that loses no area does better
            other = change + random.normal(size=len(change)) * reach_N * 10.0 ** random.uniform(-3, 0)
            other = np.clip(other, -reach_N, reach_N)
            assert cam.margin_prices.ravel() @ other < 0.0 or short(other) >= short(change) - 1e-9


def test_steps_along_slopes_take_shortfall_away_at_the_same_area(found, falling_short):
    search = YieldSearch(found.drawn, found.program, 0.99)
    found.drawn.judge(falling_short.lift, found.drawn.all)
    before = search.shortfall
    moved = search.by_slopes(falling_short, 4)
    found.drawn.judge(moved.lift, found.drawn.all)
    assert search.shortfall < 0.95 * before
    assert moved.area_ratio == pytest.approx(falling_short.area_ratio, abs=1e-5)
    assert not broken_by_shape(moved.lift, SCENE.design)


class Levels:
    """A program whose cams are their margins (3, s), of which each newton costs as much area."""

    def __init__(self, speeds: int):
        self.blocks = [None] * speeds

    def solve_below(self, margins):
        prices = np.full(margins.shape, -1e-4)
        area_ratio = float((prices * margins).sum())
        lift = SimpleNamespace(area=area_ratio, margins=margins)
        return SimpleNamespace(z=None, lift=lift, margins=margins, margin_prices=prices, area_ratio=area_ratio)


class OfOneSpeed(Told):
    """Trains that fall short by what the opening margins at one speed are below 50 N."""

    failing, states = 0, np.zeros(1)

    @property
    def worst(self):
        return self.used.max(axis=(1, 2))

    def judge(self, lift, wanted):
        self.used = np.full((20, 1, 3), 0.9 - 0.01 * (lift.margins[0, 8] - 40.0))


def test_margins_of_the_group_that_matters_rise_at_the_cost_of_the_others():
    drawn, program = OfOneSpeed(20, 3), Levels(12)
    search = YieldSearch(drawn, program, 0.9)
    start = program.solve_below(np.full((3, 12), 40.0))
    moved = search.by_groups(start, 30)
    assert search.shortfall == 0.0 and moved.margins[0, 8] >= 50.0
    assert moved.area_ratio == pytest.approx(start.area_ratio, abs=1e-9)
    assert np.ptp(moved.margins[:, :5], axis=1) == pytest.approx([0.0] * 3, abs=1e-9)  # the low speeds move together
    assert search.steps <= 31


def test_a_cam_gets_the_area_of_another_one_by_moving_all_margins(found, falling_short):
    search = YieldSearch(found.drawn, found.program, 0.9)
    margins = falling_short.margins + np.arange(falling_short.margins.shape[1])
    moved = search._as_large(margins, falling_short.area_ratio)
    assert moved.area_ratio == pytest.approx(falling_short.area_ratio, abs=1e-6)
    assert np.ptp(moved.margins - margins) == pytest.approx(0.0, abs=1e-9)
    assert np.abs(moved.margins - margins).max() > 1.0
    assert search._as_large(margins - 1e4, falling_short.area_ratio) is None  # where no margin binds


@pytest.mark.parametrize("least", [3.3, -17.0, -1e9])
def test_margins_move_together_to_the_lowest_that_hold(monkeypatch, least):
    """Cams grow as the margins fall, but for the last case, in which margins bind no more below 0 N."""
    floor = 0.0 if least < -1e6 else -np.inf

    class Program:
        def solve(self, margins):
            return SimpleNamespace(z=None, area_ratio=float(-max(margins.opening[0], floor)))

    search = search_module.YieldSearch(DrawnTrains(SCENE, 0), Program(), 0.9)

    monkeypatch.setattr(search, "consider", lambda _, cam: -cam.area_ratio >= least)
    margin = -search.lowest(np.zeros((3, 2)), 10.0).area_ratio
    assert least <= margin <= max(least + search_module.LAST_STEP_N, 0.0)


def test_every_train_is_judged_at_the_top_of_the_band():
    drawn = DrawnTrains(SCENE, 0)
    top = SCENE.cam_speed(SCENE.operation.band_rpm[1])
    assert [drawn.speeds(t)[-1] for t in range(5)] == pytest.approx([top] * 5)


def test_as_many_trains_are_drawn_as_may_fail_often_enough():
    effort = YieldEffort(300, 20, 24, 14, 4000, 1000, 21)
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
    "trains, failing, agrees, reasons",
    [(1000, 10, True, []), (1000, 11, True, ["fewer trains hold"]), (1000, 0, True, []),
     (1000, 10, False, ["independent methods disagree on train 3"]),
     (200, 2, True, ["the interval of so few trains begins below 98 %"])],
)  # fmt: skip
def test_a_yield_is_confirmed_by_share_interval_and_methods(trains, failing, agrees, reasons):
    used = np.full((trains, 1, 1), 0.5)
    used[:failing] = 1.5
    limits = UsedLimits(("jump_max_mm",), np.array([7000.0]), used)
    sample = ({"train": 3, "agrees": agrees},)
    stated = YieldStatement(0.99, 0, limits, share_of(limits.holds), {}, sample, {"polydyne": "none"})
    assert stated.reasons == reasons and stated.confirmed is not bool(reasons)
    record = stated.as_dict()
    assert record["trains"] == trains and record["baselines"]["polydyne"] == {"reason": "none"}
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
