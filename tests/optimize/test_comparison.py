"""The comparison's two tables: baselines under all limits and without the jerk limit, and families without a member."""

import csv

import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.optimize import comparison
from camopt.optimize.comparison import NO_JERK, best_baselines, compare, comparison_rows, plain_baselines
from camopt.scene import InputError, load_scene
from camopt.scene.units import MM
from camopt.verify.limits import broken_by_shape
from camopt.verify.verdict import verify

KODAMA = load_scene("kodama")
MOTORI = load_scene("motori-1")


def test_plain_baselines_fill_both_tables(monkeypatch):
    assert comparison.SECTIONED == ("multi-pol", "new-design")
    monkeypatch.setattr(comparison, "SECTIONED", ("multi-pol",))
    cams = plain_baselines(KODAMA)
    assert list(cams) == ["polydyne", "multi-pol", "multi-pol" + NO_JERK]
    limited, free = cams["multi-pol"], cams["multi-pol" + NO_JERK]
    assert broken_by_shape(limited, KODAMA.design) == []
    assert broken_by_shape(free, KODAMA.design) == ["jerk_max_mm_per_deg3"]
    assert free.area_ratio(9.4 * MM) > limited.area_ratio(9.4 * MM) + 0.02


def test_best_baselines_walk_the_registry(monkeypatch):
    asked = []

    def found(scene, name, jerk, limit, progress):
        asked.append((name, jerk, limit))
        raise InputError("none")

    monkeypatch.setattr("camopt.optimize.baselines.largest_area_member", found)
    cams = best_baselines(KODAMA)
    assert asked == [(name, jerk, 0.05) for jerk in (True, False) for name in comparison.FAMILIES]
    assert set(cams.values()) == {"none"}


def test_the_jerk_limit_does_not_reject_in_the_table_without_it():
    design = KODAMA.design.model_copy(update={"acceleration_max_mm_per_deg2": 0.016, "jerk_max_mm_per_deg3": 0.003})
    scene = KODAMA.model_copy(update={"design": design})
    lift = polydyne(scene)
    assert broken_by_shape(lift, design) == ["jerk_max_mm_per_deg3"]
    verdict = verify(scene, lift, (5000.0,), ("event",), None, 5.0, 0)
    (row,) = comparison_rows(scene, "polydyne", lift, verdict.as_dict())
    assert (row["limits"], row["verdict"]) == ("no-jerk", verdict.speeds[0].verdict)
    assert "jerk" not in row["broken"]


def test_a_family_without_member_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(comparison, "draw", lambda *a: None)
    monkeypatch.setitem(comparison.BASELINES, "plain", lambda *_: {"polydyne": "no member, because"})
    lift = polydyne(MOTORI)
    verdict = verify(MOTORI, lift, None, ("event",), None, 5.0, 0)
    monkeypatch.setattr(comparison, "verify", lambda *a: verdict)
    folder = compare(MOTORI, {"mine": lift}, tmp_path / "out")
    with open(folder / "comparison.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [r["cam"] for r in rows] == ["design"] * len(MOTORI.operation.speeds_rpm) + ["polydyne"]
    assert rows[-1]["broken"] == "no member, because"
    assert rows[-1]["area_ratio"] == rows[-1]["speed_rpm"] == ""


def test_faults(tmp_path):
    with pytest.raises(InputError, match="expected plain or best"):
        compare(MOTORI, {}, tmp_path / "out", baselines="worst")
    assert not (tmp_path / "out").exists()
