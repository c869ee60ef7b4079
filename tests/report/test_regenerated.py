"""One command recomputes every stated number of a run, for a confirmed and a rejected cam with real verdicts."""

import csv
import json
import re
import shutil

import pytest

from camopt.cam.design_file import as_written, write_design
from camopt.cam.read import read_cam
from camopt.cli.parser import main
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.baselines import comparison
from camopt.optimizer.baselines.comparison import compare_in
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.candidates import full_verdict
from camopt.report import write_report
from camopt.report.regenerated import regenerate
from camopt.scene import load_scene
from camopt.scene.text_file import scene_toml
from camopt.scene.units import MM
from camopt.storage import write_json
from tests.report.test_report_page import page_of
from tests.report.test_stated_numbers import states_what_verification_says

FREE = dict.fromkeys(
    ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3", "nose_deg")
)
BANDS = {"confirmed": (5950.0, 6050.0), "rejected": (6600.0, 6800.0)}
"""Bands [r/min] in which the exponent polynomial of motori-1 holds its limits, or jumps above its listed speed."""


@pytest.fixture(scope="module", params=BANDS)
def run(request, tmp_path_factory):
    """The folder of a run without a search, whose cam is the exponent polynomial."""
    folder, band = tmp_path_factory.mktemp("runs") / request.param, BANDS[request.param]
    scene = load_scene("motori-1")
    operation = scene.operation.model_copy(update={"speeds_rpm": (band[0],), "band_rpm": band})
    scene = scene.model_copy(update={"operation": operation, "design": scene.design.model_copy(update=FREE)})
    folder.mkdir()
    (folder / "scene.toml").write_text(scene_toml(scene))
    lift, bound = as_written(read_cam("exponent", scene)), area_ratio_bound(scene.design).bound
    ratio = lift.area_ratio(scene.design.max_lift_mm * MM)
    areas = {"area_ratio_bound": bound, "area_gap_percent": 100 * (bound - ratio) / bound, "area_ratio_no_jump": ratio}
    write_design(folder / "design.json", lift, scene.design.max_lift_mm * MM, gradient_gain=0.0, **areas)
    step = {"stage": "no-jump program", "area_ratio": ratio, "worst_bounce_mm": 0.3, "confirmed": True}
    (folder / "history.jsonl").write_text(json.dumps(step) + "\n")
    write_json(folder / "provenance.json", {"settings": {"speeds": "band", "accuracy": "draft", "gradient": "none"}})
    effort = ACCURACIES["draft"]
    verdict = full_verdict(scene, lift, "band", effort)
    assert verdict.verdict == request.param
    write_json(folder / "verification.json", verdict.as_dict())
    compare_in(folder, scene, {"design": lift}, {"design": verdict}, effort, {"kurz": "no member, because of that"})
    write_report(folder)
    return folder


def test_every_place_states_the_values_of_the_verdict(run, capsys):
    states_what_verification_says(run)
    verification = json.loads((run / "verification.json").read_text())
    if verification["verdict"] == "rejected":  # between its listed speeds
        assert verification["speeds"][0]["verdict"] == "confirmed" and verification["broken"]
        assert page_of(run).table("limit")["jump"]["state"] == "✗ broken"
    with open(run / "comparison.csv", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["cam"] == "design"]
    judged = {s["speed_rpm"]: s for s in verification["worst_in_band"] + verification["speeds"]}
    assert [float(row["speed_rpm"]) for row in rows] == sorted(judged)
    for row in rows:
        speed = judged[float(row["speed_rpm"])]
        assert float(row["jump_mm"]) == speed["jump_mm"] and row["verdict"] == speed["verdict"]


def test_a_family_that_failed_is_shown_with_its_sentence(run):
    page = page_of(run)
    row = next(row for table in page.tables for row in table if row[0] == "kurz" and "failed" in row)
    assert row[-1] == "no member, because of that"
    assert "kurz" not in page.table("cam")  # no bar beside the legal cams


def test_the_command_makes_the_same_folder_again(run, capsys):
    """The cam read from its file differs by round-off from the one that was written, visible only in an outline."""
    names = ["comparison.csv", "figures/bounce_against_speed.svg", "figures/valve_motion.svg"]
    before = {name: (run / name).read_bytes() for name in names[:2]}
    words = [t for table in page_of(run).tables for t in table]
    for name in names:
        (run / name).write_text("spoilt")
    assert main(["report", str(run)]) == 0
    assert {name: (run / name).read_bytes() for name in names[:2]} == before
    assert (run / names[2]).read_bytes().startswith(b"<?xml")
    assert [t for table in page_of(run).tables for t in table] == words
    verdict = json.loads((run / "verification.json").read_text())["verdict"]
    assert f"verdict: {verdict}" in capsys.readouterr().out


def test_the_check_verifies_again_and_finds_changed_numbers(run, capsys):
    assert main(["report", str(run), "--check"]) == 0
    words = capsys.readouterr().out
    assert "every number comes out as it is stated" in words
    assert re.search(r"limit jump: [\d.e−]+ mm, at \d+ r/min  \[verification.json ", words)
    texts = {name: (run / name).read_text(encoding="utf-8") for name in ("verification.json", "report.html")}
    verification = json.loads(texts["verification.json"])
    verification["band"]["worst"]["jump_mm"]["value"] = 0.0123
    row = re.search(r"<td>worst seating velocity</td>.*?→</td><td>([\d.]+)</td>", texts["report.html"])
    assert row is not None
    spoilt = texts["report.html"].replace(row.group(0), row.group(0).replace(row.group(1), "0.98765"))
    try:
        write_json(run / "verification.json", verification)
        (run / "report.html").write_text(spoilt, encoding="utf-8")
        assert main(["report", str(run), "--check"]) == 3
        words = capsys.readouterr().out
        assert "verification.json band.worst.jump_mm.value says 0.0123, it comes out as " in words
        assert "report.html says without a source: worst seating velocity" in words and "0.98765" in words
        assert (run / "report.html").read_text(encoding="utf-8") == spoilt  # a check writes nothing
    finally:
        for name, text in texts.items():
            (run / name).write_text(text, encoding="utf-8")


def test_the_check_of_a_folder_without_its_verdict_ends_in_sentences(run, capsys):
    """Input number 1082127 of the campaign."""
    original = run / "verification.json"
    original.rename(run / "away.json")
    try:
        assert main(["report", str(run), "--check"]) == 3
    finally:
        (run / "away.json").rename(original)
    assert "verdict says None, it comes out as " in capsys.readouterr().out


def test_no_run_folder_is_bad_input(tmp_path, capsys):
    assert main(["report", str(tmp_path / "nowhere")]) == 2
    assert "no such run folder" in capsys.readouterr().err


def test_the_command_draws_the_speeds_that_the_run_drew(run, tmp_path, monkeypatch):
    folder, drawn = tmp_path / "run", []
    shutil.copytree(run, folder)
    scene = load_scene(folder / "scene.toml")
    low = scene.operation.speeds_rpm[0]
    listed = (low, low + 10.0, low + 20.0)
    operation = scene.operation.model_copy(update={"speeds_rpm": listed})
    (folder / "scene.toml").write_text(scene_toml(scene.model_copy(update={"operation": operation})))
    monkeypatch.setattr(comparison, "draw", lambda *given: drawn.append(given[-1]))
    provenance = folder / "provenance.json"
    for settings in ({"accuracy": "draft"}, {"accuracy": "standard"}, {"accuracy": ["draft"]}, "draft"):
        write_json(provenance, {"settings": settings})
        regenerate(folder)
    assert drawn == [listed[::2], listed, listed, listed]
