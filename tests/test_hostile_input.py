"""Paths, numbers and files that nobody would give on purpose: exit code 2 and one sentence, never a defect."""

import json

import pytest

from camopt.cam.design_file import design_record
from camopt.cam.families.polydyne import polydyne
from camopt.cam.read import read_cam
from camopt.scene import InputError, load_scene
from camopt.storage import plain, write_text
from tests.test_cli import run

PATHS = {"too long": "a" * 5000, "too long a folder": "a" * 300 + "/b", "with a NUL": "a\0b", "surrogate": "a\ud800b"}
CAM = ("cam", "kodama", "--cam", "polydyne")


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
@pytest.mark.parametrize(
    "words",
    [
        ("modes", "PATH"),
        ("cam", "kodama", "--cam", "PATH"),
        ("compare", "kodama", "--design", "PATH"),
        ("modes", "kodama", "--json", "PATH"),
        (*CAM, "--csv", "PATH"),
        ("optimize", "kodama", "--out", "PATH"),
        ("optimize", "kodama", "--out", "PATH", "--resume"),
        ("tradeoff", "kodama", "--out", "PATH"),
        ("extremes", "kodama", "--out", "PATH"),
        ("compare", "kodama", "--out", "PATH"),
    ],
)
def test_paths_that_the_system_does_not_take(capsys, tmp_path, monkeypatch, words, path):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *(path if word == "PATH" else word for word in words))
    assert (code, out) == (2, "")
    assert "the system does not take this path" in err
    assert len(err) < 400 and "defect" not in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "option",
    [
        "--speeds=1:1e308:1e-308",
        "--speeds=1:1e15:1e-12",
        "--speeds=1e308",
        "--speeds=5e-324",
        "--speeds=" + "9" * 5000,
        "--accuracy=1e-300",
    ],
)
def test_numbers_beyond_every_engine(capsys, option):
    code, _, err = run(capsys, "verify", "kodama", *CAM[2:], option)
    assert code == 2
    assert "expected" in err or "more than 10000 speeds" in err
    assert len(err.splitlines()[-1]) < 400


@pytest.mark.parametrize("option", ["--revolutions", "--step-deg"])
def test_thousands_of_digits(capsys, option):
    words = ("simulate", "kodama", *CAM[2:], "--speed", "6000", option, "9" * 5000)
    code, _, err = run(capsys, *words)
    assert code == 2
    assert "expected" in err and len(err.splitlines()[-1]) < 400


def changed(record: dict, case: str) -> str:
    """The text of a design file with one thing wrong."""
    pieces = record["pieces"]
    if case == "integer beyond floats":
        pieces["coefficients_mm"][3][0] = 10**400
    if case == "duration beyond floats":
        record["duration_deg"] = 10**400
    if case == "overflow inside":
        pieces["coefficients_mm"][3][-1] = 1e308
    text = json.dumps(record)
    if case == "5,000 digits":
        return text.replace('"duration_deg": ', '"x": 1' + "0" * 5000 + ', "duration_deg": ')
    if case == "nested":
        return '{"pieces": ' + "[" * 100_000
    return text


@pytest.mark.parametrize(
    "case", ["integer beyond floats", "duration beyond floats", "overflow inside", "5,000 digits", "nested"]
)
def test_design_files(tmp_path, case):
    scene = load_scene("kodama")
    record = plain(design_record(polydyne(scene), 9.4e-3))
    file = tmp_path / "design.json"
    file.write_text(json.dumps(record))
    assert read_cam(file, scene).area > 0
    file.write_text(changed(record, case))
    with pytest.raises(InputError, match=r"design\.json: ") as error:
        read_cam(file, scene)
    assert len(str(error.value)) < 600


def test_a_name_that_utf8_cannot_say_is_written_all_the_same(tmp_path):
    write_text(tmp_path / "names.csv", "cam\nd\udcff\n")  # how Python reads the byte 255 of a file's name
    assert (tmp_path / "names.csv").read_text() == "cam\nd\\udcff\n"
