"""The search for yield: which cams count, its resumption, its statement and what it refuses."""

import json
from copy import deepcopy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cli.parser import main
from camopt.measure.limits import broken_by_shape
from camopt.measure.yields import UsedLimits, share_of
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.as_built import levels
from camopt.optimizer.as_built import search as search_module
from camopt.optimizer.as_built.checks import check_wanted
from camopt.optimizer.as_built.drawn import FOLDER, MET, SPEEDS, STAGGER, TrainEnsemble
from camopt.optimizer.as_built.levels import CHANCE, YieldSearch
from camopt.optimizer.as_built.search import AT_TOP, UNSEEN_SEED, opening_limits, yield_search
from camopt.optimizer.as_built.statement import YieldStatement, sampled
from camopt.optimizer.search.judge import Judge
from camopt.scene import InputError, load_scene, parse_scene
from camopt.scene.errors import NoCamFound
from camopt.scene.rest import state_at_rest
from camopt.scene.train import build_train
from camopt.storage.journal import HISTORY, StepFiles
from tests.scene.test_load import EXAMPLE

SCATTER = '\n[[tolerance]]\nof = "spring.preload_N"\nrelative = 0.05\n[grinding]\nerror_um = 2.0\nharmonics = [2, 40]\n'
SCENE = parse_scene(EXAMPLE + SCATTER, "mine.toml")
SMALL = replace(ACCURACIES["draft"], shaping_trains=20, unseen_trains=30)


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    """The folder in which the search keeps what it judged."""
    return tmp_path_factory.mktemp("search")


@pytest.fixture(scope="module")
def found(journal):
    return yield_search(SCENE, 0.9, SMALL, journal=StepFiles(journal, FOLDER))


def test_every_cam_that_counts_holds_in_enough_trains(found):
    areas = [cam.area_ratio for cam in found.held]
    assert areas == sorted(areas)
    drawn = found.drawn
    assert drawn.seed == UNSEEN_SEED and len(drawn.trains) == 30 and found.allowed == 0
    assert found.trains_drawn == 20 + 30
    for cam in found.held:
        drawn.judge(cam.lift, drawn.all)
        assert found.used <= 1.0 and drawn.failing <= found.allowed
        assert not broken_by_shape(cam.lift, SCENE.design)


def test_a_larger_cam_is_left_for_too_many_trains(found):
    """The search ends where the next limit on foretold openings lets a cam through that too few trains hold."""
    jump = np.full(found.program.cam_speeds.shape, SCENE.design.jump_max_mm * 1e-3)
    larger = found.program.largest(found.best.z, 2.5 * jump, 2)
    found.drawn.judge(larger.lift, found.drawn.all)
    assert larger.area_ratio > found.best.area_ratio and found.used > 1.0


class Levels:
    """A program whose cams are their limit on openings [m], less the force to be kept in units of 100 N."""

    def keep(self, margin_N):
        self.margin = margin_N / 100.0

    def largest(self, z, limits, lost, box):
        return SimpleNamespace(z=None, area_ratio=float(limits[0, 0]) - self.margin)


ONE = np.ones((1, 1))


def test_drawn_trains_begin_at_rest_where_the_train_as_designed_breaks_a_limit():
    """An adjuster that pumped up with one cam would hold the valve off its seat with every smaller one too."""
    scene = load_scene("kodama")
    drawn, speeds = TrainEnsemble(scene, 0), np.linspace(*scene.operation.band_rpm, STAGGER * SPEEDS)
    drawn.settle(polydyne(scene))
    drawn.draw(STAGGER)
    at_rest = (drawn.states == state_at_rest(build_train(scene))).all(axis=2).T.ravel()
    judged = Judge(scene, speeds)(polydyne(scene))
    breaks = judged.share.max(axis=0) > 1.0
    breaks[-STAGGER:] = breaks[-1]  # all of them have the top of the band
    assert 0 < breaks.sum() < len(breaks) and np.array_equal(at_rest, breaks)


def test_trains_whose_adjusters_may_fill_are_held(monkeypatch):
    """Forces of adjusters that have filled foretell nothing: the search begins below and goes up from there."""
    monkeypatch.setattr(search_module, "FILLING_ROUNDS", 2)
    monkeypatch.setattr(search_module, "KNOT_DEG", 6.0)
    effort = replace(ACCURACIES["draft"], shaping_trains=12, unseen_trains=24)
    found = yield_search(load_scene("finger-hydraulic"), 0.9, effort)
    assert found.best is not None and found.best.area_ratio > 0.57  # the largest Polydyne has 0.556


@pytest.mark.parametrize("first", [0.65, 0.1, 1.4])
@pytest.mark.parametrize("most", [-0.3, 0.0, 0.06, 0.33, 1.21])
def test_the_limits_on_openings_are_the_largest_that_hold(monkeypatch, first, most):
    search, steps = YieldSearch(TrainEnsemble(SCENE, 0), Levels(), 0.9), []
    monkeypatch.setattr(search, "evaluate", lambda cam: steps.append(cam) or np.exp(9.0 * (cam.area_ratio - most)))
    found = search.by_level(None, ONE, 0, first)
    assert most - levels.NEAR_ENOUGH <= found <= most + 1e-12
    assert len(steps) < 20


@pytest.mark.parametrize("fails", [np.inf, 1.0 + 1e-12])
def test_steps_between_levels_end_whatever_a_cam_uses(monkeypatch, fails):
    """Refused motions use infinitely much, and levels may use the same everywhere."""
    search = YieldSearch(TrainEnsemble(SCENE, 0), Levels(), 0.9)
    monkeypatch.setattr(search, "evaluate", lambda cam: 1.0 if cam.area_ratio <= 0.4 else fails)
    assert 0.4 - levels.NEAR_ENOUGH <= search.by_level(None, ONE, 0, 0.65) <= 0.4


def test_limits_that_bind_no_more_end_the_search(monkeypatch):
    levels = []
    program = SimpleNamespace(keep=lambda _: None)
    program.largest = lambda z, limits, *_: levels.append(limits[0, 0]) or SimpleNamespace(z=z, area_ratio=0.5)
    search = YieldSearch(TrainEnsemble(SCENE, 0), program, 0.9)
    monkeypatch.setattr(search, "evaluate", lambda *_: 0.5)
    assert search.by_level(None, ONE, 0, 0.65) == levels[-1] and len(levels) == 2


def test_without_a_cam_that_holds_it_is_said_what_fails(monkeypatch):
    search = YieldSearch(TrainEnsemble(SCENE, 0), Levels(), 0.9)
    monkeypatch.setattr(search, "evaluate", lambda *_: 2.0)
    with pytest.raises(NoCamFound, match="90 % of the drawn trains hold no cam that was tried"):
        search.by_level(None, ONE, 0, 0.65)


@pytest.mark.parametrize("wanted, unseen, counts", [(0.99, 400, [400]), (0.99, 1500, [500, 1500]), (0.9, 90, [90])])
def test_few_trains_begin_where_enough_of_them_may_fail(wanted, unseen, counts):
    assert YieldSearch(TrainEnsemble(SCENE, 0), Levels(), wanted).counts(unseen) == counts


@pytest.mark.parametrize("wanted, count", [(0.99, 1000), (0.9, 1000), (0.995, 4000), (0.8, 50)])
def test_so_few_may_fail_that_a_share_that_is_too_small_seldom_passes(wanted, count):
    allowed = YieldSearch(TrainEnsemble(SCENE, 0), Levels(), wanted)._allowed(count)
    failing = np.random.default_rng(1).binomial(count, 1.0 - wanted, 100_000)
    assert np.mean(failing <= allowed) < CHANCE + 0.005 and np.mean(failing <= allowed + 1) > CHANCE - 0.005


def test_the_limits_are_larger_at_the_top_of_the_band(found):
    limits = opening_limits(SCENE, found.program.cam_speeds)
    assert limits[:, -1] == pytest.approx(AT_TOP * limits[:, 0]) and np.all(limits[:, :-1] == limits[0, 0])
    assert limits[0, 0] == pytest.approx(SCENE.design.jump_max_mm * 1e-3)


class Told:
    """Trains of which it is told what they use of one limit, in place of those that move (t, l, s)."""

    watched, matters = TrainEnsemble.watched, TrainEnsemble.matters

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
    drawn.truth[:100, 0, speed] = 80.0
    asked = search._judge(None)
    assert asked[:, speed].all() and np.all(drawn.used[:100, 0, speed] == 80.0)
    assert asked.sum() < 500


@pytest.mark.parametrize("speed", [0, 4])
def test_others_are_not_asked_where_those_asked_first_are_too_many(speed):
    """The first judged are the trains that came near a limit with the cam before, and the scouts."""
    drawn = Told(200, 5)
    drawn.used[:20, 0, speed] = 0.7
    drawn.truth[:, 0, speed] = 80.0
    search = YieldSearch(drawn, None, 0.9)
    asked = search._judge(None)
    assert search.allowed < 20 and asked[:20, speed].all()
    assert (
        np.sum(drawn.used > 1.0) > search.allowed
        and asked[:, speed].sum() < 40
        and (speed == 0 or not asked[:, :4].any())
    )


def test_every_train_has_its_turn_as_a_scout():
    drawn = Told(64, 3)
    drawn.truth[:13, 0, 1] = drawn.used[:13, 0, 1] = 0.7  # so many that the speed matters
    search = YieldSearch(drawn, None, 0.9)
    asked = np.zeros((64, 3), dtype=int)
    for step in range(levels.FAR_SCOUTS):
        search.steps = step
        asked += search._judge(None)
    few = levels.FAR_SCOUTS // levels.SCOUTS
    assert np.all(asked == [[1, levels.FAR_SCOUTS, few]] * 13 + [[1, few, few]] * 51)


def test_every_train_is_judged_at_the_top_of_the_band():
    drawn = TrainEnsemble(SCENE, 0)
    top = SCENE.cam_speed(SCENE.operation.band_rpm[1])
    assert [drawn.speeds(t)[-1] for t in range(5)] == pytest.approx([top] * 5)


def test_a_resumed_search_judges_nothing_twice(found, journal, monkeypatch):
    lines = (journal / HISTORY).read_text()
    last = sorted((journal / FOLDER).glob("*.npz"))[-1]
    last.unlink()
    judged, judge = [], YieldSearch._judge
    monkeypatch.setattr(YieldSearch, "_judge", lambda self, lift: judged.append(lift) or judge(self, lift))
    again = yield_search(SCENE, 0.9, SMALL, journal=StepFiles(journal, FOLDER))
    assert len(judged) == 1 and last.stem == f"{found.steps:04d}"
    assert np.array_equal(again.best.z, found.best.z)
    assert (journal / HISTORY).read_text() == lines


def test_a_journal_of_another_search_is_refused(found, tmp_path):
    log = StepFiles(tmp_path, FOLDER)
    drawn, judged = deepcopy(found.drawn), found.drawn.all
    judged[1:] = False
    log.store(1, found.best.z, drawn.met(judged))
    drawn.used[:2], drawn.states[:2] = 7.0, 7.0
    drawn.take(log.stored(1, found.best.z, MET))
    assert np.array_equal(drawn.used[0], found.drawn.used[0]) and np.all(drawn.used[1] == 7.0)
    assert np.array_equal(drawn.states[0], found.drawn.states[0]) and np.all(drawn.states[1] == 7.0)
    with pytest.raises(InputError, match="belongs to another search"):
        log.stored(1, found.best.z + 1e-3, MET)


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
