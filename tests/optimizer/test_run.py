"""The main job end to end, on the one-mass scene: run folder, resume, and what the delivered kodama design keeps."""

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from camopt.cam.design_file import read_design
from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare
from camopt.measure.settling import settled_from_rest
from camopt.optimizer import candidates
from camopt.optimizer import run as module
from camopt.optimizer.accuracy import ACCURACIES, design_speeds
from camopt.optimizer.baselines import comparison
from camopt.optimizer.run import optimize
from camopt.optimizer.search.judge import Judge
from camopt.optimizer.stage_clock import StageClock
from camopt.report import write_report
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.units import MM
from camopt.storage.journal import StepFiles
from camopt.verifier.methods import rkg
from tests.documented_keys import undocumented

DELIVERED = Path(__file__).parents[1] / "data" / "kodama-design.json"  # camopt optimize kodama


@pytest.fixture(scope="module", autouse=True)
def small_job():
    """Coarse knots, and few families: the job of a draft as it is has its golden file."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(ACCURACIES, "draft", replace(ACCURACIES["draft"], knot_deg=6.0))
        patch.setattr(comparison, "SECTIONED", ())
        patch.setattr(candidates, "FAMILIES", ("polydyne",))
        yield


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A run without gradients, compared with Polydyne alone: the others are tested in test_comparison.py."""
    folder = tmp_path_factory.mktemp("runs") / "plain"
    return optimize(load_scene("motori-1"), "nominal", "draft", "none", folder)


def test_run_folder_holds_the_contract(plain):
    folder = plain.folder
    assert plain.exit_code == 0 and plain.verdict.verdict == "confirmed"
    write_report(folder)
    names = "scene.toml design.json lift.csv verification.json comparison.csv provenance.json history.jsonl report.html"
    assert all((folder / name).stat().st_size > 0 for name in names.split())
    assert {p.suffix for p in (folder / "figures").iterdir()} == {".png", ".svg"}
    scene = load_scene(folder / "scene.toml")
    assert scene == load_scene("motori-1")
    again = read_design(folder / "design.json", scene)
    assert again.area_ratio(9.4 * MM) == pytest.approx(plain.record["area_ratio"], rel=1e-12)
    for judged, written in ((plain.lift.borders, again.borders), (plain.lift.coefficients, again.coefficients)):
        assert judged.tobytes() == written.tobytes()  # the verdict is on the cam that the file holds


def test_the_page_of_the_run_folder_names_every_file_and_key(plain):
    write_report(plain.folder)
    assert undocumented(plain.folder) == set()


def test_interrupted_run_resumes_to_the_same_design(plain, undrawn, tmp_path, monkeypatch):
    folder = tmp_path / "run"
    steps = []

    def interrupted(self, lift):
        steps.append(lift)
        if len(steps) == 2:
            raise KeyboardInterrupt
        return judge(self, lift)

    judge = Judge.__call__
    monkeypatch.setattr(Judge, "__call__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        optimize(load_scene("motori-1"), "nominal", "draft", "none", folder)
    assert len(list((folder / "judged").iterdir())) == 1
    assert not (folder / "design.json").exists()
    monkeypatch.setattr(Judge, "__call__", judge)
    resumed = optimize(load_scene("motori-1"), "nominal", "draft", "none", folder, resume=True)
    assert resumed.record["pieces"]["coefficients_mm"] == pytest.approx(
        plain.record["pieces"]["coefficients_mm"], abs=0
    )
    history = (folder / "history.jsonl").read_text(), (plain.folder / "history.jsonl").read_text()
    assert history[0] == history[1]


OTHERS = {
    "scene": {"scene": load_scene("motori-2")},
    "speeds": {"speeds": "band"},
    "accuracy": {"accuracy": "standard"},
    "gradient": {"gradient": "exact"},
    "seed": {"seed": 3},
}


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
def test_a_finished_folder_resumed_with_other_settings_keeps_every_byte(plain, tmp_path, other):
    """The refusal came after history.jsonl was emptied and scene.toml overwritten."""
    folder = tmp_path / "run"
    shutil.copytree(plain.folder, folder)
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    asked = {"scene": load_scene("motori-1"), "speeds": "nominal", "accuracy": "draft", "gradient": "none"} | other
    with pytest.raises(InputError, match=rf"another run.*{next(iter(other))}.*--resume with the original settings"):
        optimize(out=folder, resume=True, **asked)
    assert {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()} == before


def test_a_resumed_search_that_stops_again_keeps_its_history(plain, tmp_path, monkeypatch):
    folder = tmp_path / "run"
    shutil.copytree(plain.folder, folder)
    before = (folder / "history.jsonl").read_bytes()

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(StepFiles, "stored", interrupted)
    with pytest.raises(KeyboardInterrupt):
        optimize(load_scene("motori-1"), "nominal", "draft", "none", folder, resume=True)
    assert (folder / "history.jsonl").read_bytes() == before


@pytest.mark.parametrize(("word", "value"), [("speeds", "all"), ("gradient", "steep"), ("accuracy", "best")])
def test_unknown_words_leave_no_folder(tmp_path, word, value):
    with pytest.raises(InputError, match=f"{word} '{value}': expected one of"):
        optimize(load_scene("motori-1"), out=tmp_path / "run", **{word: value})
    assert not (tmp_path / "run").exists()


@pytest.fixture
def designed(plain, undrawn, monkeypatch):
    """The search's and the verdict's answers without their cost: (run folder) -> a job that only compares anew."""
    search = SimpleNamespace(course={"source": "exact"}, judge=SimpleNamespace(calls=0))
    found = SimpleNamespace(lift=plain.lift, area_ratio=plain.record["area_ratio"])
    search.confirmed, search.first = [found], found
    monkeypatch.setattr(module, "find_cam", lambda *a, **k: search)
    monkeypatch.setattr(candidates, "verdict_on", lambda *a, **k: plain.verdict)
    return search


FILES = {"scene.toml", "design.json", "lift.csv", "verification.json", "provenance.json", "report.html", "run.json"}


def test_the_design_and_its_report_are_written_before_the_comparison(designed, tmp_path, monkeypatch):
    def broken(*_):
        assert {p.name for p in (tmp_path / "run").iterdir()} >= FILES
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr(comparison, "compare_in", broken)
    with pytest.raises(ZeroDivisionError):
        optimize(load_scene("motori-1"), "nominal", "draft", "none", tmp_path / "run", designed=write_report)
    assert {p.name for p in (tmp_path / "run").iterdir()} >= FILES


def test_without_a_comparison_there_is_a_report_that_says_so(designed, tmp_path):
    """And a job keeps BLAS to one thread."""
    folder, seen = tmp_path / "run", []
    with threadpool_limits(limits=2, user_api="blas"):
        optimize(load_scene("motori-1"), "nominal", "draft", "none", folder, compare=False,
                 designed=lambda _: seen.extend(threadpool_info()))  # fmt: skip
    assert {one["num_threads"] for one in seen if one["user_api"] == "blas"} == {1}
    page = write_report(folder).read_text(encoding="utf-8")
    assert not any((folder / name).exists() for name in ("comparison.csv", "cams", "verdicts"))
    assert "no other cam was compared" in page and "processor s" in page
    assert (folder / "figures" / "bounce_against_speed.svg").exists()


def test_a_family_that_fails_becomes_a_row_and_costs_nothing(designed, tmp_path, monkeypatch):
    """A singular matrix in a pushrod's Polydyne ended the job with exit code 1 after the design was found."""

    def singular(*_):
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr(comparison, "polydyne", singular)
    monkeypatch.setattr(comparison, "MOST_EXCESS", 10.0)
    result = optimize(load_scene("motori-1"), "nominal", "draft", "none", tmp_path / "run")
    assert result.exit_code == 0
    with open(tmp_path / "run" / "comparison.csv", encoding="utf-8") as file:
        *designs, row = csv.DictReader(file)
    assert {r["cam"] for r in designs} == {"design"}
    assert (row["cam"], row["verdict"]) == ("polydyne", "failed")
    assert row["broken"] == "a defect of camopt (LinAlgError: Singular matrix)"
    assert "failed" in write_report(tmp_path / "run").read_text(encoding="utf-8")


def test_a_verdict_that_falls_back_is_said(designed, plain, tmp_path, monkeypatch):
    """The area of the refused cam stood as that of the program beside a smaller delivered one, without a word."""
    first = designed.confirmed[0]
    larger = SimpleNamespace(lift=plain.lift, area_ratio=first.area_ratio + 0.01)
    designed.confirmed, designed.first = [first, larger], larger
    verdicts = iter([replace(plain.verdict, verdict="rejected"), plain.verdict])
    monkeypatch.setattr(candidates, "verdict_on", lambda *a, **k: next(verdicts))
    record = optimize(load_scene("motori-1"), "nominal", "draft", "none", tmp_path / "run").record
    assert record["verdict_fell_back"] == {"candidates_judged": 2, "largest_refused_area_ratio": larger.area_ratio}
    assert record["area_ratio_no_jump"] == larger.area_ratio
    assert record["gradient_gain"] == pytest.approx(-0.01)  # what the refusal cost is not hidden by a zero


def test_contradictory_limits_leave_no_folder(tmp_path):
    scene = load_scene("motori-1")
    design = scene.design.model_copy(update={"jerk_max_mm_per_deg3": 5e-4, "reach_max_lift": True})
    with pytest.raises(InputError, match=r"jerk_max_mm_per_deg3 would have to rise from 0\.0005 to"):
        optimize(scene.model_copy(update={"design": design}), "nominal", "draft", out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_unconfirmed_design_ends_with_code_3_and_its_folder(designed, plain, tmp_path, monkeypatch):
    rejected = replace(plain.verdict, verdict="rejected", broken=("bounce_max_mm at 7000 r/min",))
    monkeypatch.setattr(candidates, "verdict_on", lambda *a, **k: rejected)
    result = optimize(load_scene("motori-1"), "nominal", "draft", "none", tmp_path / "run")
    assert result.exit_code == 3
    assert json.loads((tmp_path / "run" / "verification.json").read_text())["verdict"] == "rejected"


def test_delivered_design_holds_over_the_band_by_two_methods():
    scene = load_scene("kodama")
    lift, d = read_design(DELIVERED, scene), scene.design
    band = np.arange(5000.0, 7001.0, 20.0)
    assert not np.isin(design_speeds(scene.operation, "band", ACCURACIES["standard"])[1], band).any()
    train, cases = build_train(scene), [(prepare, s) for s in band]
    cases += [(lambda *a: rkg.prepare(*a, 14400), s) for s in scene.operation.speeds_rpm]
    for method, speed in cases:
        found = settled_from_rest(method, train, lift, scene.cam_speed(speed)).metrics(lift)
        assert found.worst("bounce_mm") <= d.bounce_max_mm
        assert found.worst("jump_mm") <= d.jump_max_mm
        assert found.worst("seating_velocity_m_per_s") <= d.seating_velocity_max_m_per_s
    assert lift.area_ratio(d.max_lift_mm * MM) >= 0.555
    assert build_train(scene).lash == pytest.approx(0.169 * MM)


@pytest.mark.long
def test_margins_that_are_fed_back_gain_area(plain, tmp_path):
    result = optimize(load_scene("motori-1"), "nominal", "draft", "smooth", tmp_path / "run")
    assert result.record["gradient_gain"] > 0
    assert result.record["area_ratio"] > plain.record["area_ratio"]


@pytest.mark.parametrize(("accuracy", "listed"), [("draft", (5000, 7000)), ("standard", (5000, 6000, 6500, 7000))])
def test_a_draft_alone_draws_the_motion_at_both_ends_too(accuracy, listed, tmp_path, monkeypatch):
    scene, drawn = load_scene("kodama"), []
    monkeypatch.setattr("camopt.optimizer.baselines.figures.draw", lambda *given: drawn.append(given[-1]))
    verdict = SimpleNamespace(as_dict=dict)
    shown = SimpleNamespace(begin=lambda stage: None)
    job = module._OpenRun(scene, {}, ACCURACIES[accuracy], StageClock(), tmp_path, shown, compare=False)
    job.compared(polydyne(scene), verdict)
    assert drawn == [listed]
