"""The cams that a run knows: the largest confirmed one is delivered, be it the search's or a family's."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from camopt.cam.read import read_cam
from camopt.cli.parser import main
from camopt.optimizer import candidates, run
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.candidates import Member, largest_confirmed, ruled_out
from camopt.optimizer.run import optimize
from camopt.optimizer.search.cams import Search
from camopt.optimizer.search.judge import Judged
from camopt.optimizer.stage_clock import StageClock
from camopt.report.folder import read_run_folder
from camopt.report.outcome import outcome_lines
from camopt.scene import InputError, load_scene
from camopt.scene.errors import NoCamFound
from camopt.scene.text_file import scene_toml

SCENE = load_scene("motori-1")
DRAFT = ACCURACIES["draft"]
MARINE = Path(__file__).parents[3] / "shared" / "data" / "scenes" / "marine-soft.toml"
CAMS = {name: read_cam(name, SCENE) for name in ("trapezoid", "kurz")}


def searched(*areas):
    return [SimpleNamespace(lift=replace(CAMS["kurz"], family="free"), area_ratio=area) for area in areas]


asked: list[str] = []
out: list[str] = []
"""The families that event-exact rules out."""


@pytest.fixture
def verdicts(monkeypatch):
    """A verdict that confirms what is named in the list that it gives back, by family."""
    confirmed: list[str] = []
    asked.clear()
    out.clear()

    def rules_out(scene, lift):
        asked.append(lift.family)
        return "bounce_max_mm" if lift.family in out else ""

    def verdict(scene, lift, *_, **__):
        asked.append(f"verdict on {lift.family}")
        word = "confirmed" if lift.family in confirmed else "rejected"
        return SimpleNamespace(verdict=word, broken=() if word == "confirmed" else ("jump_max_mm at 7000 r/min",))

    monkeypatch.setattr(candidates, "verdict_on", verdict)
    monkeypatch.setattr(candidates, "ruled_out", rules_out)
    return confirmed


def test_where_the_largest_cam_is_the_search_s_no_member_is_judged(verdicts):
    verdicts += ["free", "kurz", "trapezoid"]
    search = searched(0.7, 0.8)
    chosen = largest_confirmed(SCENE, search, "nominal", DRAFT, CAMS)
    assert chosen.cam is search[-1] and asked == ["verdict on free"]
    assert chosen.fell_back == {"candidates_judged": 1, "largest_refused_area_ratio": None}
    assert chosen.why_a_family(search, "") == ""


def test_a_larger_member_that_is_confirmed_takes_the_place_of_the_search_s_cam(verdicts):
    verdicts += ["free", "kurz"]
    search = searched(0.5)
    chosen = largest_confirmed(SCENE, search, "nominal", DRAFT, CAMS)
    areas = {name: cam.area_ratio_in(SCENE.design) for name, cam in CAMS.items()}
    assert areas["trapezoid"] > areas["kurz"] > 0.5
    assert isinstance(chosen.cam, Member) and chosen.cam.area_ratio == areas["kurz"]
    why = chosen.why_a_family(search, "")
    assert "The search's largest cam has an area ratio of 0.50000" in why and "the family kurz" in why
    assert f"trapezoid with {areas['trapezoid']:.5f} (jump_max_mm at 7000 r/min)" in why


def test_a_larger_member_that_event_exact_rules_out_is_not_verified(verdicts):
    verdicts += ["free", "trapezoid", "kurz"]
    out.extend(("trapezoid", "kurz"))
    chosen = largest_confirmed(SCENE, searched(0.5), "nominal", DRAFT, CAMS)
    assert chosen.cam.area_ratio == 0.5 and asked == ["trapezoid", "kurz", "verdict on free"]


def test_where_the_search_s_cams_are_refused_a_smaller_member_is_delivered(verdicts):
    verdicts += ["kurz"]
    search = searched(0.7, 0.8)
    chosen = largest_confirmed(SCENE, search, "nominal", DRAFT, CAMS)
    assert chosen.cam.lift.family == "kurz"
    assert chosen.fell_back == {"candidates_judged": 2, "largest_refused_area_ratio": 0.8}
    assert "the search with 0.80000 (jump_max_mm at 7000 r/min)" in chosen.why_a_family(search, "")


def test_where_nothing_is_confirmed_the_search_s_largest_cam_stands_with_its_verdict(verdicts):
    search = searched(0.4, 0.5)
    chosen = largest_confirmed(SCENE, search, "nominal", DRAFT, CAMS)
    assert chosen.cam is search[-1] and chosen.verdict.verdict == "rejected"


def test_where_nothing_is_known_the_sentence_names_the_search_and_the_families(verdicts):
    with pytest.raises(NoCamFound, match=r"the margins, and of .* none is confirmed: trapezoid with 0\..*; kurz with"):
        largest_confirmed(SCENE, [], "nominal", DRAFT, CAMS, "no cam keeps the margins")
    with pytest.raises(NoCamFound, match="no family has a member that holds the limits on the shape"):
        largest_confirmed(SCENE, [], "nominal", DRAFT, None, "no cam keeps the margins")


def test_event_exact_rules_out_what_breaks_a_limit_and_not_what_is_calm():
    multi_pol = read_cam("multi-pol", SCENE)
    assert ruled_out(SCENE, multi_pol) == "bounce_max_mm at 7000 r/min"
    calm = SCENE.model_copy(update={"operation": SCENE.operation.model_copy(update={"speeds_rpm": (2000.0,)})})
    assert ruled_out(calm, multi_pol) == ""


@pytest.fixture(scope="module")
def wide_lash(undrawn):
    """Slow, and with more lash than its ramp is high: the search's model has no place for it, and a plain cam holds."""
    elements = (e.model_copy(update={"gap_mm": 0.3}) if e.cam_driven else e for e in SCENE.element)
    operation = SCENE.operation.model_copy(update={"speeds_rpm": (2000.0, 2500.0), "band_rpm": (2000.0, 2500.0)})
    return SCENE.model_copy(update={"element": tuple(elements), "operation": operation})


def test_a_scene_whose_search_fails_ends_with_a_family_s_confirmed_cam(wide_lash, tmp_path):
    """The job ended without a cam, and `verify --cam multi-pol` confirmed one."""
    found = optimize(wide_lash, "nominal", "draft", "none", tmp_path / "run", compare=False)
    assert found.exit_code == 0 and found.verdict.verdict == "confirmed"
    record = read_run_folder(tmp_path / "run").design
    assert record["family"] == "multi-pol" == found.lift.family
    assert record["area_ratio"] == pytest.approx(read_cam("multi-pol", wide_lash).area_ratio_in(wide_lash.design))
    assert record["area_ratio_no_jump"] is None and record["gradient_gain"] is None
    why = record["why_a_family"]
    assert why in outcome_lines(read_run_folder(tmp_path / "run"))
    assert "which must lie on the opening ramp, between 0 and 0.265 mm" in why


def test_a_search_for_yield_that_fails_ends_with_a_family_s_cam_and_its_yield(wide_lash, tmp_path, monkeypatch):
    stated = []

    def state_yield(job, lift, verdict):
        stated.append(lift.family)
        return SimpleNamespace(confirmed=False)

    monkeypatch.setattr(run._OpenRun, "state_yield", state_yield)
    found = optimize(wide_lash, accuracy="draft", out=tmp_path / "run", compare=False, wanted_yield=0.9)
    assert stated == ["multi-pol"] and found.verdict.verdict == "confirmed"
    assert found.exit_code == 3  # what was wanted is the yield


def test_a_scene_in_which_nothing_holds_ends_with_code_3_and_without_a_folder(wide_lash, tmp_path, monkeypatch, capsys):
    """The exact source needs the lash to close on the ramp; the smoothed motion finds a cam beside it."""
    monkeypatch.setattr(candidates, "FAMILIES", ("3-4-5",))  # which breaks this scene's limits
    file, folder = tmp_path / "scene.toml", tmp_path / "run"
    file.write_text(scene_toml(wide_lash), encoding="utf-8")
    words = "optimize --gradient exact --speeds nominal --accuracy draft --no-compare --quiet".split()
    assert main([*words, str(file), "--out", str(folder)]) == 3
    said = capsys.readouterr().err
    assert "which must lie on the opening ramp" in said
    assert "no family has a member that holds the limits on the shape" in said
    assert not folder.exists()


def test_the_comparison_designs_no_member_again(wide_lash, tmp_path, monkeypatch):
    designed = []
    plain = "camopt.optimizer.baselines.comparison.member_or_sentence"
    monkeypatch.setattr(plain, lambda scene, family: designed.append(family) or f"no {family} here")
    shown = SimpleNamespace(begin=lambda stage: None, advance=lambda share: None)
    job = run._OpenRun(wide_lash, {}, DRAFT, StageClock(), tmp_path, shown)
    monkeypatch.setattr("camopt.optimizer.baselines.comparison.compare_in", lambda *given: compared.append(given[5]))
    compared = []
    assert set(job.families) == set(candidates.FAMILIES)
    job.compared(CAMS["kurz"], SimpleNamespace())
    assert designed == list(candidates.FAMILIES)
    assert compared[0]["polydyne"] == "no polydyne here" and {"multi-pol", "new-design"} <= compared[0].keys()


@pytest.mark.skipif(not MARINE.exists(), reason="the shared scenes are not here")
def test_the_marine_scene_gets_a_cam(tmp_path):
    found = optimize(load_scene(MARINE), "nominal", "draft", "none", tmp_path / "run", compare=False)
    assert found.verdict.verdict == "confirmed" and found.record["area_ratio"] > 0.571  # its trapezoid has 0.5715


def search_of(*cams):
    """A search that has judged cams of these areas, which use so much of the limit on the bounce; no others hold."""
    answers = {area: used for area, used in cams}

    def judge(lift):
        share = np.array([[answers.get(lift.area_ratio, 2.0)]])
        figures = {"bounce_mm": share[0] * 0.05}
        return Judged(
            np.array([7000.0]), figures, ("bounce_mm",), np.array([0.05]), share, np.zeros((1, 2)), np.ones(1)
        )

    source = SimpleNamespace(name="exact", jacobians=1)
    search = Search(judge, None, source, "calmest")
    for area in answers:
        free = SimpleNamespace(lift=lambda z: SimpleNamespace(area_ratio=float(z[0]), area=1.0))
        search.evaluate("path constraints", free, np.array([area]), area)
    search.confirm()
    return search


def offered(search):
    return [cam.area_ratio for cam in search.confirmed]


def test_a_cam_that_holds_is_not_refused_for_the_reserve():
    """Where the nearest cam had 0.0409 mm of bounce against 0.05 the search said that no cam holds."""
    assert offered(search_of((0.56, 0.95), (0.57, 1.1), (0.55, 0.98))) == [0.55, 0.56]


def test_a_cam_with_the_reserve_is_preferred_to_larger_ones_without_it():
    assert offered(search_of((0.5, 0.3), (0.55, 0.7), (0.57, 0.95))) == [0.5, 0.55]


def test_of_cams_that_are_alike_only_the_largest_goes_to_the_verdict():
    assert offered(search_of((0.5, 0.30), (0.5497, 0.70), (0.55, 0.71))) == [0.5, 0.55]


def test_no_cam_found_is_an_input_error_for_who_catches_these():
    assert issubclass(NoCamFound, InputError)
