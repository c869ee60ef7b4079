"""Values of a cam for the limits on its shape, compared with values on a dense grid; rows, shares and next steps."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.read import read_cam
from camopt.measure.limits import broken_by_shape, reached_by_shape
from camopt.report.advice import advice
from camopt.report.folder import read_run_folder
from camopt.report.limits import limit_rows, matrix, share_of
from camopt.report.outcome import edge_sentences
from camopt.report.wording import share_kind, used
from camopt.scene import load_scene
from camopt.scene.design import Piston
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG2, MM_PER_DEG3

SCENE = load_scene("motori-1")
LIFT = read_cam("polydyne", SCENE)
GRID = np.linspace(-np.pi, np.pi, 200_001)
PISTON = Piston(stroke_mm=80, rod_mm=140, gap_at_top_mm=9, clearance_mm=1, lobe_centre_deg=110)


def drawn(**limits):
    """The scene's design with further limits, on a flat follower with a base circle of 40 mm radius."""
    geometry = load_scene("kodama").geometry
    assert geometry is not None
    flat = geometry.model_copy(
        update={"follower": "flat", "base_radius_mm": 40.0, "face_width_mm": 60.0}
        | dict.fromkeys(("pad_radius_mm", "pivot_mm", "arm_mm", "valve_arm_mm"))
    )
    assert SCENE.design is not None
    design = SCENE.design.model_copy(update=limits)
    return design.within(flat, SCENE.operation)


def test_values_of_the_shape_are_those_of_a_dense_grid():
    design = drawn(piston=PISTON, nose_radius_min_mm=1.0, entrainment_min_m_per_s=0.1, lift_at=((-30.0, 2.0, 9.0),))
    values = {row.label or row.key: row.value for row in reached_by_shape(LIFT, design)}
    lift, slope, bend = (LIFT(GRID, order) for order in range(3))
    assert values["max_lift_mm"] == pytest.approx(lift.max() / MM, abs=1e-6)
    assert values["acceleration_max_mm_per_deg2"] == pytest.approx(bend.max() / MM_PER_DEG2, rel=1e-5)
    assert values["nose_radius_min_mm"] == pytest.approx((40 * MM + lift + bend).min() / MM, rel=1e-5)
    assert values["face_width_mm"] == pytest.approx(2 * np.abs(slope).max() / MM, rel=1e-5)
    entrained = design.slowest * ((40 * MM + lift) / 2 + bend).min()
    assert values["entrainment_min_m_per_s"] == pytest.approx(entrained, rel=1e-4)
    assert values["lift_at"] == pytest.approx(float(LIFT(-30 * DEG)) / MM, rel=1e-9)
    outside = np.abs(GRID) >= design.duration_deg / 2 * DEG
    ramps = max(values["opening ramp velocity"], values["closing ramp velocity"])
    assert ramps == pytest.approx(np.abs(slope[outside]).max() / MM_PER_DEG, rel=1e-3)


def test_the_clearance_to_the_piston_is_that_of_crank_and_rod():
    row = next(row for row in reached_by_shape(LIFT, drawn(piston=PISTON)) if row.key == "piston")
    crank = PISTON.lobe_centre_deg * DEG + GRID / 0.5
    height = 40 * np.cos(crank) + np.sqrt(140**2 - (40 * np.sin(crank)) ** 2)
    clearance = PISTON.gap_at_top_mm + (180 - height) - LIFT(GRID) / MM
    assert row.value == pytest.approx(clearance.min(), abs=1e-4) and row.least


def test_rows_agree_with_the_check_of_the_shape(write, contents):
    design = drawn(piston=PISTON, lift_at=((0.0, 0.0, 1.0),), duration_at=((2.0, 10.0, 20.0),))
    run = read_run_folder(write(contents, "motori-1"))
    rows = limit_rows(run, (LIFT, design))
    broken = {row["key"] for row in rows if row["held"] is False}
    judged = set(broken_by_shape(LIFT, design))
    assert {"lift_at", "duration_at"} <= broken and broken & {"piston", "max_lift_mm"} == judged & {
        "piston",
        "max_lift_mm",
    }
    named = {row["label"]: row for row in matrix(run, rows)["rows"]}
    assert named["lift at an angle"]["held"] is False and named["lift at an angle"]["shares"] is None


def test_every_limit_on_the_shape_has_a_row_in_words(write, contents):
    design = drawn(waves_max=3, snap_max_mm_per_deg4=1.0, duration_at=((2.0, 10.0, 200.0),))
    rows = limit_rows(read_run_folder(write(contents, "motori-1")), (LIFT, design))
    named = {row["label"]: (row["unit"], row["reached"]) for row in rows}
    waves = next(row for row in reached_by_shape(LIFT, design) if row.key == "waves_max")
    assert named["sign changes of the jerk"] == ("", f"{waves.value:g}")
    assert named["snap max"][0] == "mm/deg⁴" and named["opening ramp velocity"][0] == "mm/deg"
    assert named["duration at 2 mm"][0] == named["duration"][0] == "deg"


@pytest.mark.parametrize(("short", "words"), [(1e-5, "100 %"), (1e-2, "✗ 101 %")])
def test_the_matrix_agrees_with_the_check_of_the_shape(write, contents, short, words):
    """A lift that is slightly too small because of a file's digits counts as reached."""
    design = drawn(max_lift_mm=LIFT.max_lift / MM * (1 + short), reach_max_lift=True)
    run = read_run_folder(write(contents, "motori-1"))
    rows = limit_rows(run, (LIFT, design))
    assert ("reach_max_lift" in broken_by_shape(LIFT, design)) is words.startswith("✗")
    row = {row["label"]: row for row in matrix(run, rows)["rows"]}["lift to be reached"]
    assert used(row["share"], row["held"] is False) == words


@pytest.mark.parametrize("over", [5e-7, -5e-7])
def test_a_row_has_the_tolerance_of_the_verdict(write, contents, over):
    """A limit that the cam exceeds by less than a printed digit is broken in the table, as in the verdict."""
    jerk = float(np.abs(LIFT.extremes(3)).max()) / MM_PER_DEG3 / (1 + over)
    design = drawn(jerk_max_mm_per_deg3=jerk)
    contents["comparison"] = []
    contents["verification"]["speeds"][2]["ranges"]["bounce_mm"] = [0.01, 0.05 * (1 + over)]
    rows = {row["key"]: row for row in limit_rows(read_run_folder(write(contents, "motori-1")), (LIFT, design))}
    assert rows["jerk_max_mm_per_deg3"]["held"] is (over < 0)
    assert ("jerk_max_mm_per_deg3" in broken_by_shape(LIFT, design)) is (over > 0)
    assert rows["bounce_max_mm"]["held"] is (over < 0)


def test_shares_increase_towards_the_limit():
    assert share_of(0.05, False, 0.04) == pytest.approx(0.8)
    assert share_of(50.0, True, 60.0) == pytest.approx(0.8)
    assert share_of(-0.008, True, -0.004) == pytest.approx(0.5)
    assert share_of(0.0, False, 1.0) is None and share_of(1.0, False, None) is None


def test_the_matrix_marks_the_worst_speed_of_each_limit(write, contents):
    contents["verification"]["speeds"][2]["ranges"]["bounce_mm"] = [0.01, 0.0501]
    run = read_run_folder(write(contents))
    table = matrix(run, limit_rows(run))
    assert table["speeds"] == ["5000", "6000", "6500", "7000", "band"]
    bounce = next(row for row in table["rows"] if row["label"] == "bounce")
    assert bounce["shares"].index(max(bounce["shares"])) == 2
    assert share_kind(bounce["shares"][2]) == "bad" and used(bounce["shares"][2], True) == "✗ 100 %"


def test_the_band_uses_no_less_of_a_limit_than_the_speeds_inside_it(write, contents):
    contents["verification"]["speeds"][2]["ranges"]["bounce_mm"] = [0.01, 0.0501]
    contents["verification"]["band"]["worst"]["bounce_mm"]["value"] = 0.02
    for top_rpm, share in ((7000, 0.0501 / 0.05), (6000, 0.4)):  # the third speed is 6500 r/min
        contents["verification"]["band"]["to_rpm"] = top_rpm
        run = read_run_folder(write(contents))
        bounce = next(row for row in matrix(run, limit_rows(run))["rows"] if row["label"] == "bounce")
        assert bounce["shares"][-1] == pytest.approx(share)


def steps_of(run, assumed=()):
    return advice(run, f"{run.path or run.name}/scene.toml", run.path or run.name, assumed)


@pytest.mark.parametrize(
    ("verdict", "accuracy", "command"),
    [
        ("confirmed", "standard", "camopt yield kodama-run/scene.toml --cam kodama-run --trains 200"),
        ("confirmed", "draft", "camopt optimize kodama-run/scene.toml --accuracy standard"),
        ("rejected", "standard", "camopt optimize kodama-run/scene.toml --accuracy fine"),
        ("sensitive", "standard", "camopt optimize kodama-run/scene.toml --accuracy fine"),
        ("not converged", "standard", "camopt verify kodama-run/scene.toml --cam kodama-run --accuracy fine"),
        ("unheard of", "standard", "camopt verify kodama-run/scene.toml --cam kodama-run"),
    ],
)
def test_every_verdict_has_a_next_step(write, contents, verdict, accuracy, command, tmp_path, monkeypatch):
    """A cam is ground after a confirmed verdict that is more than a draft."""
    monkeypatch.chdir(tmp_path)
    contents["verification"]["verdict"] = verdict
    contents["provenance"]["settings"]["accuracy"] = accuracy
    steps = steps_of(read_run_folder(write(contents)))
    assert steps[0]["command"] == command
    table = "camopt cam kodama-run/scene.toml --cam kodama-run --csv lift.csv --digits 5"
    assert [step["command"] for step in steps].count(table) == ((verdict, accuracy) == ("confirmed", "standard"))


def test_an_open_contact_and_assumed_numbers_come_before_the_grinder(write, contents):
    for record in (*contents["verification"]["speeds"], *contents["verification"]["worst_in_band"]):
        record |= {"jump_deg": 78.5, "ranges": {}}
    contents["verification"]["band"]["worst"]["jump_deg"] |= {"value": 78.5, "speed_rpm": 7600}
    run = read_run_folder(write(contents))
    geometry = {"follower": "flat", "base_radius_mm": 18, "assumed": ["base_radius_mm", "face_width_mm"]}
    steps = steps_of(replace(run, scene=run.scene | {"geometry": geometry}))
    assert edge_sentences(run)[-1].startswith("A contact is open over 78.5 deg of the cam at 7600 r/min though by")
    measured = (
        "Measure what the scene assumes (of the geometry base radius, face width), then take the cam to the grinder."
    )
    assert [step["words"] for step in steps[:2]] == ["Ask how many trains as built hold.", measured]
    rows = [{"name": "valve.mass_kg"}]
    both = (
        "Measure what the scene assumes (of the train first valve.mass_kg; of the geometry base radius, face width), "
    )
    assert steps_of(replace(run, scene=run.scene | {"geometry": geometry}), rows)[1]["words"].startswith(both)
    complete = {"design": run.scene["design"] | {"contact_force_min_N": 5}, "tolerance": [], "geometry": {}}
    assert steps_of(replace(run, scene=run.scene | complete))[0]["words"] == "Take the cam to the grinder."
