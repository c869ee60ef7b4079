"""The main job end to end, on the one-mass scene: run folder, resume, and what the delivered kodama design keeps."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from camopt.cam.design_file import read_design
from camopt.cam.ramps import scene_ramps
from camopt.exact import prepare
from camopt.measure.sweep import at_speeds
from camopt.optimizer import run as module
from camopt.optimizer.accuracy import ACCURACIES, design_speeds
from camopt.optimizer.baselines import comparison
from camopt.optimizer.run import optimize
from camopt.optimizer.search.judge import Judge
from camopt.report import write_report
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG2, MM_PER_DEG3
from camopt.verifier.methods import rkg

DELIVERED = Path(__file__).parents[1] / "data" / "kodama-design.json"  # camopt optimize kodama


@pytest.fixture(scope="module", autouse=True)
def few_baselines():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(comparison, "SECTIONED", ())
        yield


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A run without gradients, compared with Polydyne alone: the others are tested in test_comparison.py."""
    folder = tmp_path_factory.mktemp("runs") / "plain"
    return optimize(load_scene("motori-1"), "nominal", "draft", "none", folder)


def test_run_folder_holds_the_contract(plain):
    folder = plain.folder
    write_report(folder)
    names = "scene.toml design.json lift.csv verification.json comparison.csv provenance.json history.jsonl report.html"
    assert all((folder / name).stat().st_size > 0 for name in names.split())
    assert {p.suffix for p in (folder / "figures").iterdir()} == {".png", ".svg"}
    record = json.loads((folder / "design.json").read_text())
    assert {"family", "parameters", "pieces", "area_mm_deg", "area_ratio", "area_ratio_bound"} <= record.keys()
    assert {"area_gap_percent", "area_ratio_no_jump", "gradient_gain"} <= record.keys()
    assert record["area_ratio"] <= record["area_ratio_bound"]
    gap = 100 * (1 - record["area_ratio"] / record["area_ratio_bound"])
    assert record["area_gap_percent"] == pytest.approx(gap)
    scene = load_scene(folder / "scene.toml")
    assert scene == load_scene("motori-1")
    again = read_design(folder / "design.json", scene)
    assert again.area_ratio(9.4 * MM) == pytest.approx(record["area_ratio"], rel=1e-12)


def test_verdict_is_confirmed_and_compared(plain):
    assert plain.exit_code == 0 and plain.verdict.verdict == "confirmed"
    found = json.loads((plain.folder / "verification.json").read_text())
    for speed in found["speeds"]:
        assert speed["bounce_mm"] <= 0.05 and speed["jump_mm"] <= 0.05
        assert all(method["converged"] for method in speed["methods"].values())
    with open(plain.folder / "comparison.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["cam"] for row in rows} == {"design", "polydyne"}
    assert len(rows) == 2 * len(load_scene("motori-1").operation.speeds_rpm)


def test_interrupted_run_resumes_to_the_same_design(plain, tmp_path, monkeypatch):
    folder = tmp_path / "run"
    steps = []

    def interrupted(self, lift, briefly=False):
        steps.append(lift)
        if len(steps) == 4:
            raise KeyboardInterrupt
        return judge(self, lift, briefly)

    judge = Judge.__call__
    monkeypatch.setattr(Judge, "__call__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        optimize(load_scene("motori-1"), "nominal", "draft", "none", folder)
    assert len(list((folder / "judged").iterdir())) == 3
    assert not (folder / "design.json").exists()
    monkeypatch.setattr(Judge, "__call__", judge)
    resumed = optimize(load_scene("motori-1"), "nominal", "draft", "none", folder, resume=True)
    assert resumed.record["pieces"]["coefficients_mm"] == pytest.approx(
        plain.record["pieces"]["coefficients_mm"], abs=0
    )
    history = (folder / "history.jsonl").read_text(), (plain.folder / "history.jsonl").read_text()
    assert history[0] == history[1]


def test_folder_of_another_search_is_refused(plain, tmp_path):
    shutil.copytree(plain.folder, tmp_path / "run")
    with pytest.raises(InputError, match="another search"):
        optimize(load_scene("motori-2"), "nominal", "draft", "none", tmp_path / "run", resume=True)


def test_contradictory_limits_leave_no_folder(tmp_path):
    scene = load_scene("motori-1")
    design = scene.design.model_copy(update={"jerk_max_mm_per_deg3": 5e-4, "reach_max_lift": True})
    with pytest.raises(InputError, match=r"jerk_max_mm_per_deg3 would have to rise from 0\.0005 to"):
        optimize(scene.model_copy(update={"design": design}), out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_unconfirmed_design_ends_with_code_3_and_its_folder(plain, tmp_path, monkeypatch):
    from dataclasses import replace

    rejected = replace(plain.verdict, verdict="rejected", broken=("bounce_max_mm at 7000 r/min",))
    monkeypatch.setattr(module, "verdict_on", lambda *a, **k: rejected)
    result = optimize(load_scene("motori-1"), "nominal", "draft", "none", tmp_path / "run")
    assert result.exit_code == 3
    assert json.loads((tmp_path / "run" / "verification.json").read_text())["verdict"] == "rejected"


def test_delivered_design_keeps_its_limits_at_every_thousandth_of_a_degree():
    scene = load_scene("kodama")
    lift, d = read_design(DELIVERED, scene), scene.design
    theta = np.arange(-180_000, 180_000) / 1000 * DEG
    assert lift(theta).max() <= d.max_lift_mm * MM * (1 + 1e-9)
    acceleration, jerk = lift(theta, 2), lift(theta, 3)
    assert acceleration.max() <= d.acceleration_max_mm_per_deg2 * MM_PER_DEG2 * (1 + 1e-9)
    assert acceleration.min() >= d.acceleration_min_mm_per_deg2 * MM_PER_DEG2 * (1 + 1e-9)
    assert np.abs(jerk).max() <= d.jerk_max_mm_per_deg3 * MM_PER_DEG3 * (1 + 1e-9)
    assert acceleration[np.abs(theta) < d.nose_deg * DEG].max() <= 0.0


def test_delivered_design_meets_its_ramps():
    scene = load_scene("kodama")
    lift = read_design(DELIVERED, scene)
    opening, closing = scene_ramps(scene.design)
    for top, ramp, sign in ((-lift.half_duration, opening, 1), (lift.half_duration, closing, -1)):
        for side in (-1, 1):  # from the ramp and from the event
            i = int(np.argmin(np.abs(lift.borders - top))) - (side < 0)
            u = top - lift.borders[i]
            value, slope, curve = (
                sum(
                    np.prod(np.arange(k, k - order, -1)) * c * u ** (k - order)
                    for k, c in enumerate(lift.coefficients[i])
                    if k >= order
                )
                for order in range(3)
            )
            assert value == pytest.approx(ramp.height, abs=1e-12 * MM)
            assert slope == pytest.approx(sign * ramp.velocity, abs=1e-12 * MM_PER_DEG)
            assert curve == pytest.approx(0.0, abs=1e-12 * MM_PER_DEG2)


def test_delivered_design_holds_over_the_band_by_two_methods():
    scene = load_scene("kodama")
    lift, d = read_design(DELIVERED, scene), scene.design
    band = np.arange(5000.0, 7001.0, 20.0)
    assert not np.isin(design_speeds(scene.operation, "band", ACCURACIES["standard"])[1], band).any()
    rows = at_speeds(prepare, scene, lift, band)
    other = at_speeds(lambda *a: rkg.prepare(*a, 14400), scene, lift, scene.operation.speeds_rpm)
    for row in (*rows, *other):
        assert row["bounce_mm"] <= d.bounce_max_mm
        assert row["jump_mm"] <= d.jump_max_mm
        assert row["seating_velocity_m_per_s"] <= d.seating_velocity_max_m_per_s
    assert lift.area_ratio(d.max_lift_mm * MM) >= 0.555
    assert build_train(scene).lash == pytest.approx(0.169 * MM)


@pytest.mark.long
def test_gradient_stage_gains_area(plain, tmp_path):
    result = optimize(load_scene("motori-1"), "nominal", "draft", "smooth", tmp_path / "run")
    assert result.record["gradient_gain"] > 0
    assert result.record["area_ratio"] > plain.record["area_ratio"]
