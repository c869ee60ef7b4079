"""`camopt yield`: a known yield by a stand-in for the motions, resuming, halving, and a small one end to end."""

import json

import numpy as np
import pytest
from scipy.stats import norm

import camopt
from camopt.cli.parser import main
from camopt.measure.limits import motion_limits
from camopt.optimizer.as_built import measured
from camopt.scene import InputError, load_scene, parse_scene, scene_text
from camopt.storage.journal import Records
from camopt.study.yields import JOURNAL, SUMMARY, yield_lines
from tests.documented_keys import documented, keys
from tests.scene.test_load import EXAMPLE

MASS = '\n[[tolerance]]\nof = "valve.mass_kg"\nrelative = 0.05\n'
SCENE = parse_scene(EXAMPLE + MASS, "mine.toml")
CAM = camopt.polydyne(SCENE)
LIMITS = 4
"""Limits of the example on the motion."""


@pytest.fixture
def heavy_ones_break(monkeypatch):
    """A train breaks its limits at the second of two speeds where its mass is over 1.05 times the scene's."""
    seen = []

    def used(self, trains):
        seen.extend(one.number for one in trains)
        heavy = np.array([one.train.mass[0] / 0.24 / 1.05 for one in trains])
        return np.stack([0.5 * heavy, heavy], axis=-1)[:, None, :].repeat(LIMITS, axis=1)

    def no_track(scene, lift, speeds_rpm):
        return measured.Track(lift, (), np.zeros(0), motion_limits(scene.design))

    monkeypatch.setattr(measured.Track, "used", used)
    monkeypatch.setattr("camopt.study.yields.track", no_track)
    return seen


def found(trains: int, **more):
    return camopt.manufacturing_yield(SCENE, CAM, trains, speeds_rpm=(6000, 7000), **more)


def test_a_known_yield_and_what_half_of_its_cause_buys(heavy_ones_break):
    result = found(500, halve=True)
    assert result.share.low <= norm.cdf(1.0) <= result.share.high
    assert result.first_broken["bounce_max_mm"]["speeds_rpm"] == {"7000": 500 - round(500 * result.share.share)}
    assert result.blame["valve.mass_kg"] == pytest.approx(1.0, abs=5e-3)
    half = result.halved["valve.mass_kg"]
    assert half["low"] <= norm.cdf(2.0) <= half["high"] and half["lost"] == 0
    assert half["gained"] == round(500 * (half["share"] - result.share.share))
    said = "\n".join(yield_lines(result))
    assert "valve.mass_kg halved" in said
    assert f"; {100 * max(0.0, 1 - sum(result.blame.values())):.0f} % unexplained" in said
    assert result.table.sizes == {"train": 500, "limit": LIMITS, "speed_rpm": 2}


@pytest.mark.long
def test_a_resumed_run_has_the_rows_of_an_unbroken_one(heavy_ones_break, tmp_path, monkeypatch):
    found(50, out=tmp_path / "whole")
    add, wrote = Records.add, []

    def killed(self, *rows):
        if wrote:
            raise KeyboardInterrupt
        wrote.extend(rows)
        add(self, *rows)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Records, "add", killed)
        found(50, out=tmp_path / "broken")
    journal = tmp_path / "broken" / JOURNAL
    with open(journal, "a") as file:
        file.write('{"halved": "", "tra')  # the line that was being written
    heavy_ones_break.clear()
    found(50, out=tmp_path / "broken", resume=True)
    assert heavy_ones_break == list(range(20, 50))
    for name in (JOURNAL, SUMMARY):
        assert (tmp_path / "broken" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    heavy_ones_break.clear()
    assert found(60, out=tmp_path / "broken", resume=True).share.trains == 60
    assert heavy_ones_break == list(range(50, 60))


def test_another_run_is_refused(heavy_ones_break, tmp_path):
    found(3, out=tmp_path / "run")
    with pytest.raises(InputError, match="finished yield run"):
        found(3, out=tmp_path / "run")
    with pytest.raises(InputError, match="belongs to another run"):
        found(3, out=tmp_path / "run", seed=1, resume=True)


def test_files_and_keys_are_documented(heavy_ones_break, tmp_path):
    found(30, out=tmp_path / "run", halve=True)
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert names == {"run.json", "scene.toml", JOURNAL, SUMMARY, "figures"}
    summary = json.loads((tmp_path / "run" / SUMMARY).read_text())
    for content in ("first_broken", "blame", "halved"):  # whose keys are limits, speeds and tolerances
        inner = summary.pop(content)
        if content != "blame":
            summary |= {key: None for entry in inner.values() for key in entry}
    assert keys(summary) | {JOURNAL, SUMMARY, "first_broken", "blame", "halved"} <= documented()
    assert keys(json.loads((tmp_path / "run" / JOURNAL).read_text().splitlines()[0])) - {*SCENE_LIMITS} <= documented()


SCENE_LIMITS = ("bounce_max_mm", "jump_max_mm", "seating_velocity_max_m_per_s", "contact_force_max_N")


def test_a_scene_without_limits_is_refused():
    without = SCENE.model_copy(update={"design": SCENE.design.model_copy(update=dict.fromkeys(SCENE_LIMITS))})
    with pytest.raises(InputError, match="limits nothing of the motion"):
        camopt.manufacturing_yield(without, CAM, 3)


def test_trains_with_an_adjuster_are_drawn_and_measured():
    scene = load_scene("finger-hydraulic")
    found = camopt.manufacturing_yield(scene, camopt.polydyne(scene), 3, speeds_rpm=(5000,))
    assert found.share.trains == 3 and np.all(np.isfinite(found.used.used))


@pytest.mark.parametrize(("rpm", "share"), [(1000.0, 1.0), (7000.0, 0.0)])
def test_with_hardly_any_scatter_all_trains_hold_or_none(rpm, share):
    scene = load_scene("motori-1")
    grinding = scene.grinding.model_copy(update={"error_um": 1e-9})
    scene = scene.model_copy(update={"tolerance": (), "grinding": grinding})
    result = camopt.manufacturing_yield(scene, camopt.polydyne(scene), 3, speeds_rpm=[rpm])
    assert result.share.share == share
    assert np.allclose(result.used.used, result.used.used[0], rtol=1e-5, atol=1e-6)


def test_a_scene_in_which_nothing_scatters_is_refused(tmp_path, capsys):
    """One train drawn many times would hold in all draws or in none, which is no share."""
    scene = load_scene("motori-1").model_copy(update={"tolerance": (), "grinding": None})
    with pytest.raises(InputError, match="without either, every train would be the same"):
        camopt.manufacturing_yield(scene, CAM, 3)
    file, text = tmp_path / "mine.toml", scene_text("motori-1")
    file.write_text(text[: text.index("[[tolerance]]")])
    out = tmp_path / "run"
    assert main(["yield", str(file), "--cam", "polydyne", "--trains", "5", "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert "needs [[tolerance]] or [grinding]" in said.err and said.out == "" and not out.exists()
