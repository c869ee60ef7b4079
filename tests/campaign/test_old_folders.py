"""Stored run folders and stores of released versions are read, or refused with a sentence."""

import json
import shutil
from pathlib import Path

import pytest

from tests.command_line import contents, refused, run

KEPT = sorted((Path(__file__).parents[1] / "data").glob("version-*"))


@pytest.fixture(params=KEPT, ids=lambda path: path.name)
def old(request, tmp_path) -> Path:
    """A copy of the output of a version, to which commands may write."""
    return Path(shutil.copytree(request.param, tmp_path / "old"))


def test_stored_folders_exist():
    assert KEPT


def test_a_stored_design_is_read_as_the_same_cam(old, capsys):
    known = json.loads((old / "run" / "design.json").read_text(encoding="utf-8"))
    code, out, err = run(capsys, "cam", "motori-1", "--cam", str(old / "run"), "--csv", str(old / "lift.csv"))
    assert code == 0, err
    assert f"{known['area_ratio']:.4f}" in out
    assert (old / "lift.csv").read_text() == (old / "run" / "lift.csv").read_text()


@pytest.mark.parametrize(
    ("words", "where"),
    [
        (("optimize", "motori-1", "--speeds", "nominal", "--accuracy", "draft", "--out", "run", "--resume"), "run"),
        (("yield", "motori-1", "--cam", "polydyne", "--trains", "10", "--out", "yield", "--resume"), "yield"),
        (("sweep", "plan.toml", "--store", "sweep.sqlite", "--resume"), "sweep.sqlite"),
    ],
    ids=["run", "yield", "sweep"],
)
def test_a_stored_run_is_resumed_or_refused_without_a_change(old, capsys, monkeypatch, words, where):
    monkeypatch.chdir(old)
    before = contents(old)
    code, _, err = run(capsys, *words, "--quiet")
    assert code in (0, 2)
    if code == 2:
        assert err.startswith(f"camopt: {where}") and err.count("\n") == 1
        assert contents(old) == before


def test_a_changed_file_of_a_stored_folder_is_detected(old, capsys):
    design = old / "run" / "design.json"
    record = json.loads(design.read_text(encoding="utf-8"))
    record["pieces"]["coefficients_mm"][5][-1] = "x"
    design.write_text(json.dumps(record), encoding="utf-8")
    assert "design.json" in refused(capsys, "cam", "motori-1", "--cam", str(old / "run"))
