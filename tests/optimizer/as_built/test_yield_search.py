"""The search for yield: which cams count, its resumption, its statement and what it refuses."""

import json
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from camopt import multi_pol
from camopt.cam.families.polydyne import polydyne
from camopt.cli.parser import main
from camopt.exact import with_chords
from camopt.measure.as_built import trains_as_built
from camopt.measure.limits import broken_by_shape
from camopt.measure.yields import UsedLimits, share_of
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.as_built import search as search_module
from camopt.optimizer.as_built import slopes_program, steps
from camopt.optimizer.as_built.checks import check_wanted
from camopt.optimizer.as_built.drawn import CHORDS, FOLDER, SPEEDS, STAGGER, STORED, TrainEnsemble
from camopt.optimizer.as_built.measured import track
from camopt.optimizer.as_built.search import (
    AT_TOP,
    UNSEEN_SEED,
    band_speeds,
    opening_limits,
    yield_search,
)
from camopt.optimizer.as_built.statement import YieldStatement, sampled
from camopt.optimizer.as_built.steps import CHANCE, GRADIENTS, OPENINGS, YieldSearch
from camopt.optimizer.search.judge import Judge
from camopt.scene import InputError, load_scene, parse_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.train import build_train
from camopt.storage.journal import HISTORY, StepFiles
from tests.scene.test_load import EXAMPLE

SCATTER = '\n[[tolerance]]\nof = "spring.preload_N"\nrelative = 0.05\n[grinding]\nerror_um = 2.0\nharmonics = [2, 40]\n'
SCENE = parse_scene(EXAMPLE + SCATTER, "mine.toml")
SMALL = replace(ACCURACIES["draft"], foretold_trains=20, shaping_trains=60, unseen_trains=40)
WANTED = 0.8


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    """The folder in which the search keeps what it judged."""
    return tmp_path_factory.mktemp("search")


@pytest.fixture(scope="module")
def found(journal):
    return yield_search(SCENE, WANTED, SMALL, journal=StepFiles(journal, FOLDER))


def test_every_cam_that_counts_holds_in_enough_trains(found):
    areas = [cam.area_ratio for cam in found.held]
    assert areas == sorted(areas)
    drawn = found.unseen
    assert drawn.seed == UNSEEN_SEED and len(drawn.trains) == 40 and found.permitted_failures(40) > 0
    assert found.trains_drawn == 60 + 40
    for cam in found.held:
        drawn.judge(cam.lift, np.ones_like(drawn.watched))
        assert drawn.failing <= found.permitted_failures(40)
        assert not broken_by_shape(cam.lift, SCENE.design)


def test_the_history_has_both_kinds_of_steps(found, journal):
    lines = [json.loads(line) for line in (journal / HISTORY).read_text().splitlines()]
    stages = [line["stage"] for line in lines]
    assert stages[0] == OPENINGS and stages.count(GRADIENTS) > steps.STEPS
    assert [line["iteration"] for line in lines] == list(range(1, found.steps + 1))
    assert {line["trains"] for line in lines} == {60, 40}
    assert lines[-1]["best_area_ratio"] == found.best.area_ratio
    assert any(line["confirmed"] for line in lines if line["stage"] == GRADIENTS)


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


def test_an_adjuster_is_judged_as_the_statement_does_whatever_the_cam_before_left_in_it():
    """Motions of one cam may coexist: with an adjuster that has filled and with one that has not."""
    scene, calm, count = load_scene("finger-hydraulic"), polydyne(load_scene("finger-hydraulic")), 3
    drawn, top = TrainEnsemble(scene, 0), np.zeros((count, SPEEDS), dtype=bool)
    top[:, -1] = True
    drawn.settle(calm)
    drawn.draw(count)
    drawn.judge(multi_pol(scene), top)
    assert (drawn.used[:, :, -1].max(axis=1) > 1.0).any()
    drawn.judge(calm, top)
    trains = [replace(one, train=with_chords(one.train, CHORDS)) for one in trains_as_built(scene, count)]
    stated = track(scene, calm, [scene.operation.band_rpm[1]]).used(trains)
    assert np.array_equal(drawn.used[:, :, -1:], stated)


def test_trains_whose_adjusters_may_fill_are_held(monkeypatch):
    """Forces of adjusters that have filled foretell nothing: the forces are about a cam whose contacts keep one."""
    monkeypatch.setattr(search_module, "FILLING_ROUNDS", 2)
    monkeypatch.setattr(search_module, "KNOT_DEG", 6.0)
    effort = replace(ACCURACIES["draft"], foretold_trains=12, shaping_trains=12, unseen_trains=24)
    found = yield_search(load_scene("finger-hydraulic"), 0.9, effort)
    assert found.best is not None and found.best.area_ratio > 0.57  # the largest Polydyne has 0.556


@pytest.mark.parametrize("wanted, count", [(0.99, 1000), (0.9, 1000), (0.995, 4000), (0.8, 50)])
def test_so_few_may_fail_that_a_share_that_is_too_small_seldom_passes(wanted, count):
    allowed = YieldSearch(wanted, None, None, count).permitted_failures(count)
    failing = np.random.default_rng(1).binomial(count, 1.0 - wanted, 100_000)
    assert np.mean(failing <= allowed) < CHANCE + 0.005 and np.mean(failing <= allowed + 1) > CHANCE - 0.005


def test_the_limits_are_larger_at_the_top_of_the_band():
    limits = opening_limits(SCENE, band_speeds(SCENE))
    assert limits[:, -1] == pytest.approx(AT_TOP * limits[:, 0]) and np.all(limits[:, :-1] == limits[0, 0])
    assert limits[0, 0] == pytest.approx(SCENE.design.jump_max_mm * 1e-3)


class Told:
    """Trains of which it is told what they use of one limit, in place of those that move (t, l, s)."""

    watched, critical_speeds = TrainEnsemble.watched, TrainEnsemble.critical_speeds

    def __init__(self, trains: int, speeds: int, has_memory: bool = False):
        self.has_memory = has_memory
        self.trains, self.motions = [None] * trains, 0
        self.used, self.truth = np.zeros((trains, 1, speeds)), np.full((trains, 1, speeds), 0.1)

    def judge(self, lift, wanted):
        self.motions += int(wanted.sum())
        self.used = np.where(wanted[:, None], self.truth, self.used)


@pytest.mark.parametrize("speed", [0, 4])
def test_calm_trains_that_a_cam_breaks_are_seen_at_once(speed):
    drawn = Told(200, 5)
    search = YieldSearch(0.9, None, drawn, 0)
    search._judge(None)
    assert 0 < drawn.motions < 200
    drawn.truth[:100, 0, speed] = 80.0
    asked = search._judge(None)
    assert asked[:, speed].all() and np.all(drawn.used[:100, 0, speed] == 80.0)
    assert asked.sum() < 500


def test_with_an_adjuster_that_may_pump_up_every_train_is_judged_at_the_top():
    drawn = Told(200, 5, has_memory=True)
    drawn.truth[3:6, 0, -1] = np.inf
    assert YieldSearch(0.9, None, drawn, 0)._judge(None)[:, -1].all() and np.sum(drawn.used > 1.0) == 3


@pytest.mark.parametrize("speed", [0, 4])
def test_others_are_not_asked_where_those_asked_first_are_too_many(speed):
    """The first judged are the trains that came near a limit with the cam before, and the scouts."""
    drawn = Told(200, 5)
    drawn.used[:20, 0, speed] = 0.7
    drawn.truth[:, 0, speed] = 80.0
    search = YieldSearch(0.9, None, drawn, 0)
    asked = search._judge(None)
    assert search.permitted_failures(200) < 20 and asked[:20, speed].all()
    assert (
        np.sum(drawn.used > 1.0) > search.permitted_failures(200)
        and asked[:, speed].sum() < 40
        and (speed == 0 or not asked[:, :4].any())
    )


def test_every_train_has_its_turn_as_a_scout():
    drawn = Told(64, 3)
    drawn.truth[:13, 0, 1] = drawn.used[:13, 0, 1] = 0.7  # so many that the speed matters
    search = YieldSearch(0.9, None, drawn, 0)
    asked = np.zeros((64, 3), dtype=int)
    for step in range(steps.FAR_SCOUTS):
        search.steps = step
        asked += search._judge(None)
    few = steps.FAR_SCOUTS // steps.SCOUTS
    assert np.all(asked == [[1, steps.FAR_SCOUTS, few]] * 13 + [[1, few, few]] * 51)


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
    monkeypatch.setattr(slopes_program, "TracedMotion", None)  # no motion is traced again
    again = yield_search(SCENE, WANTED, SMALL, journal=StepFiles(journal, FOLDER))
    assert len(judged) == 1 and last.stem == f"{found.steps:04d}"
    assert np.array_equal(again.best.z, found.best.z)
    assert (journal / HISTORY).read_text() == lines


def test_a_journal_of_another_search_is_refused(found, tmp_path):
    log = StepFiles(tmp_path, FOLDER)
    drawn, judged = deepcopy(found.unseen), np.ones_like(found.unseen.watched)
    judged[1:] = False
    log.store(1, found.best.z, drawn.stored_arrays(judged))
    drawn.used[:2], drawn.states[:2] = 7.0, 7.0
    drawn.restore(log.stored(1, found.best.z, STORED))
    assert np.array_equal(drawn.used[0], found.unseen.used[0]) and np.all(drawn.used[1] == 7.0)
    assert np.array_equal(drawn.states[0], found.unseen.states[0]) and np.all(drawn.states[1] == 7.0)
    with pytest.raises(InputError, match="belongs to another search"):
        log.stored(1, found.best.z + 1e-3, STORED)


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
