"""Assumed numbers ranked by their influence, paths in the commands, and the permissible stress beside the stress."""

import os
import shlex
from pathlib import Path

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import motion_limits
from camopt.report.advice import advice, assumed_numbers, first_to_measure, ranked
from camopt.report.cams import stress
from camopt.report.folder import read_run_folder
from camopt.report.motion import RunCams
from camopt.report.wording import used
from camopt.scene import build_train, load_scene, parse_scene
from camopt.scene.parameters import with_numbers
from camopt.scene.text_file import scene_toml

SCENE = load_scene("motori-1")
CAM = polydyne(SCENE)


def test_every_assumed_number_of_masses_and_elements_is_ranked():
    """kodama marks 45 non-zero numbers as assumed, each once."""
    kodama = load_scene("kodama")
    marked = [(row.name, key) for row in (*kodama.mass, *kodama.element) for key in row.assumed if getattr(row, key)]
    assert len(assumed_numbers(kodama)) == len(marked) == 45
    assert {(n.named(kodama)) for n in assumed_numbers(kodama)} == {f"{name}.{key}" for name, key in marked}


def test_ranking_is_by_the_effect_of_ten_per_cent_on_the_limits():
    """The first row is recomputed: the settled motion at the top speed with the number 10 % lower and higher."""
    rows = ranked(SCENE, CAM)
    assert {row["name"] for row in rows} == {n.named(SCENE) for n in assumed_numbers(SCENE)} and len(rows) > 1
    moved = [row["moved_to"] - row["share"] for row in rows]
    assert moved == sorted(moved, reverse=True) and moved[0] > 0
    first = rows[0]
    (number,) = (n for n in assumed_numbers(SCENE) if n.named(SCENE) == first["name"])
    limit, shares = motion_limits(SCENE.design)[first["limit"]], []
    for factor in (0.9, 1.1):
        scene = with_numbers(SCENE, {number: factor * number.of(SCENE)})
        worst = settled_metrics([build_train(scene)], [CAM], [scene.cam_speed(SCENE.operation.speeds_rpm[-1])])
        shares.append(float(limit.share(worst.worst(limit.metric)[0, 0])[0]))
    assert first["moved_to"] == pytest.approx(np.max(shares), rel=1e-9)


def test_the_table_and_the_sentence_name_them_in_order():
    rows = [{"name": f"m{i}.mass_kg", "moved_to": 0.9 - 0.1 * i} for i in range(6)]
    rows[0] = {"name": "seat.damping_N_s_per_m", "moved_to": np.inf}
    assert [used(row["moved_to"]) for row in rows[:2]] == ["no settled motion that seats", "80 %"]
    sentence = "seat.damping_N_s_per_m, m1.mass_kg and 4 more, ranked in the valve train's section"
    assert first_to_measure(rows) == sentence
    assert first_to_measure(rows[:2]) == "seat.damping_N_s_per_m, m1.mass_kg" and first_to_measure([]) == ""


def test_stress_is_shown_with_the_permissible_stress():
    text = scene_toml(SCENE) + '\n[geometry]\nfollower = "flat"\nbase_radius_mm = 40\nface_width_mm = 30\n'
    borne = parse_scene(text + "hertz_max_MPa = 1000\n", "borne")
    rows = stress(RunCams(borne, {"design": CAM}, []))[0]
    assert len(rows) == len(SCENE.operation.speeds_rpm) + 1
    for row in rows:
        assert row[-1] == f"{float(row[1]) / 10:.0f} % of 1000 MPa"
    silent = stress(RunCams(parse_scene(text, "silent"), {"design": CAM}, []))[0]
    assert {row[-1] for row in silent} == {"–"}


@pytest.mark.parametrize(
    ("folder", "here"),
    [("runs/first", "."), ("first", "."), ("a b", "."), ("runs/first", "runs"), ("first", "elsewhere")],
)
def test_commands_work_in_the_folder_where_the_report_is_made(tmp_path, monkeypatch, folder, here):
    place = tmp_path / folder
    for path in (place, tmp_path / here):
        path.mkdir(parents=True, exist_ok=True)
    (place / "scene.toml").write_text(scene_toml(SCENE))
    (place / "design.json").write_text("{}")
    monkeypatch.chdir(tmp_path / here)
    run = read_run_folder(Path(os.path.relpath(place)))
    words = shlex.split(advice(run, f"{run.path}/scene.toml", run.path)[0]["command"])
    assert words[:2] == ["camopt", "verify"] and Path(words[2]).is_file() and Path(words[-1]).is_dir()
    assert Path(words[2]).resolve() == place / "scene.toml"
    assert Path(words[2]).is_absolute() is (here == "elsewhere")
