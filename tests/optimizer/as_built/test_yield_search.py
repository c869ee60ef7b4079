"""The search for yield: the slope of its objective, its resumption, its statement and what it refuses."""

import json

import numpy as np
import pytest

from camopt.cli.parser import main
from camopt.measure.yields import UsedLimits, share_of
from camopt.optimizer.as_built import search as search_module
from camopt.optimizer.as_built.design import YieldEffort, yield_search
from camopt.optimizer.as_built.drawn import DrawnTrains
from camopt.optimizer.as_built.journal import FOLDER, HISTORY, TrainsLog
from camopt.optimizer.as_built.statement import YieldStatement, sampled
from camopt.optimizer.as_built.wanted import check_wanted
from camopt.optimizer.program.no_jump import Margins
from camopt.scene import InputError, load_scene, parse_scene
from tests.scene.test_load import EXAMPLE

SCATTER = '\n[[tolerance]]\nof = "spring.preload_N"\nrelative = 0.05\n[grinding]\nerror_um = 2.0\nharmonics = [2, 40]\n'
SCENE = parse_scene(EXAMPLE + SCATTER, "mine.toml")
SMALL = YieldEffort((12, 20), (2, 1), 12, 5)


@pytest.fixture(scope="module")
def found():
    return yield_search(SCENE, 0.9, SMALL)


def test_every_cam_that_counts_holds_in_enough_trains(found):
    areas = [cam.area_ratio for cam in found.held]
    assert areas == sorted(areas) and found.common is not None
    drawn = found.drawn
    drawn.judge(found.best.lift, drawn.all)
    assert found.holds and len(drawn.trains) == 20


def test_the_objective_has_the_slope_of_its_differences(found, monkeypatch):
    """Central differences with common random numbers, where trains fall short; the adjoint leaves out what is older
    than two revolutions."""
    monkeypatch.setattr(search_module, "STEEPEST", np.inf)
    drawn, program = found.drawn, found.program
    margins = found.best.margins.copy()
    while True:  # until some trains fall short of their aim
        cam = program.solve(Margins(*margins))
        drawn.judge(cam.lift, drawn.all)
        if found.shortfall > 0.02:
            break
        margins -= 10.0
    direction = np.random.default_rng(0).normal(size=margins.shape)

    def objective(step: float) -> float:
        moved = program.solve(Margins(*(margins + step * direction)))
        drawn.judge(moved.lift, drawn.all)
        return found.shortfall - moved.area_ratio

    slope = found.slope(cam, 1.0)
    expected = (objective(0.02) - objective(-0.02)) / 0.04
    assert np.sum(slope * direction) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("least", [3.3, -17.0, -1e9])
def test_margins_move_together_to_the_lowest_that_hold(monkeypatch, least):
    """Cams grow as the margins fall, but for the last case, in which margins bind no more below 0 N."""
    floor = 0.0 if least < -1e6 else -np.inf

    class Program:
        def solve(self, margins):
            return float(-max(margins.opening[0], floor))

    search = search_module.YieldSearch(DrawnTrains(SCENE, 0), Program(), 0.9)

    def consider(stage, area):
        if -area >= least and (not search.held or area > search.held[-1]):
            search.held.append(area)
        return -area >= least

    monkeypatch.setattr(search, "consider", consider)
    margins = search.lowest("common margin", np.zeros((3, 2)), 10.0)
    assert margins.shape == (3, 2) and least <= margins[0, 0] <= max(least + search_module.LAST_STEP_N, 0.0)


def test_every_train_is_judged_at_the_top_of_the_band():
    drawn = DrawnTrains(SCENE, 0)
    top = SCENE.cam_speed(SCENE.operation.band_rpm[1])
    assert [drawn.speeds(t)[-1] for t in range(5)] == pytest.approx([top] * 5)


def test_a_resumed_search_judges_nothing_twice(tmp_path, monkeypatch):
    first = yield_search(SCENE, 0.9, SMALL, log=TrainsLog(tmp_path))
    lines = (tmp_path / HISTORY).read_text()
    last = sorted((tmp_path / FOLDER).glob("*.npz"))[-1]
    last.unlink()
    judged = []
    judge = search_module.YieldSearch._judge
    monkeypatch.setattr(
        search_module.YieldSearch, "_judge", lambda self, *a: (judged.append(self.steps), judge(self, *a))
    )
    again = yield_search(SCENE, 0.9, SMALL, log=TrainsLog(tmp_path))
    assert judged == [first.steps]
    assert np.array_equal(again.best.z, first.best.z)
    assert (tmp_path / HISTORY).read_text() == lines


def test_a_journal_of_another_search_is_refused(found, tmp_path):
    log = TrainsLog(tmp_path)
    log.keep(1, found.best.z, found.drawn)
    assert log.recalled(1, found.best.z, found.drawn)
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
