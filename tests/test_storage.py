"""Files appear whole or not at all; run folders are never overwritten."""

import csv
import json
import os

import numpy as np
import pytest

from camopt import storage
from camopt.scene import InputError
from camopt.storage import check_run_folder, create_run_folder, default_run_folder, write_csv, write_json, write_text


def test_text_replaces_the_old_file_and_leaves_nothing_else(tmp_path):
    file = tmp_path / "a.txt"
    write_text(file, "old")
    write_text(file, "Δ new\n")
    assert file.read_bytes() == "Δ new\n".encode()
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_failure_on_the_way_keeps_the_old_file(tmp_path, monkeypatch):
    file = tmp_path / "a.txt"
    write_text(file, "old")

    def disk_full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(storage.os, "fsync", disk_full)
    with pytest.raises(InputError, match=r"a\.txt: cannot be written \(No space left on device\)"):
        write_text(file, "new")
    assert file.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_written_content_is_flushed_before_the_rename(tmp_path, monkeypatch):
    calls = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(storage.os, "fsync", lambda f: (calls.append("fsync"), fsync(f))[1])
    monkeypatch.setattr(storage.os, "replace", lambda a, b: (calls.append("replace"), replace(a, b))[1])
    write_text(tmp_path / "a.txt", "x")
    assert calls == ["fsync", "replace"]


def test_a_link_stays_a_link(tmp_path):
    write_text(tmp_path / "real.txt", "old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real.txt")
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


def test_a_device_is_written_to_and_not_replaced():
    write_text(os.devnull, "x")
    assert not os.path.isfile(os.devnull)


@pytest.mark.parametrize("name", ["none/a.txt", "file/a.txt", ".", "n" * 300])
def test_places_that_cannot_be_written(tmp_path, name):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot be written") as error:
        write_text(tmp_path / name, "x")
    assert "\n" not in str(error.value)
    assert os.listdir(tmp_path) == ["file"]


def test_json_has_null_for_what_is_not_finite(tmp_path):
    data = {
        "a": float("nan"),
        "b": [np.inf, np.float64(1.5)],
        "c": np.array([[1, 2]]),
        "d": (True, None, "é"),
        5: -np.inf,
    }
    write_json(tmp_path / "a.json", data)
    text = (tmp_path / "a.json").read_text()
    assert json.loads(text) == {"a": None, "b": [None, 1.5], "c": [[1, 2]], "d": [True, None, "é"], "5": None}
    assert "NaN" not in text


def test_json_refuses_what_it_does_not_know(tmp_path):
    with pytest.raises(TypeError, match="set cannot be stored"):
        write_json(tmp_path / "a.json", {"a": {1, 2}})
    assert os.listdir(tmp_path) == []


def test_csv_keeps_every_digit(tmp_path):
    values = np.array([1 / 3, np.nan, 1e-300])
    write_csv(tmp_path / "a.csv", {"x": values, "name, unit": ["a", None, 'b"']})
    with open(tmp_path / "a.csv", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["x", "name, unit"]
    assert [row[1] for row in rows[1:]] == ["a", "", 'b"']
    assert (float(rows[1][0]), rows[2][0], float(rows[3][0])) == (1 / 3, "", 1e-300)


def test_csv_refuses_columns_of_different_length(tmp_path):
    with pytest.raises(ValueError, match="shorter"):
        write_csv(tmp_path / "a.csv", {"x": [1, 2], "y": [1]})
    assert os.listdir(tmp_path) == []


def test_run_folder_is_made_once(tmp_path):
    folder = create_run_folder(tmp_path / "runs" / "first")
    assert os.listdir(folder) == []
    (folder / "design.json").write_text("{}")
    with pytest.raises(InputError, match=r"exists already.*--resume"):
        create_run_folder(folder)
    with pytest.raises(InputError, match="exists already"):
        check_run_folder(folder)
    assert create_run_folder(folder, resume=True) == folder
    assert os.listdir(folder) == ["design.json"]


def test_run_folder_where_a_file_is(tmp_path):
    (tmp_path / "file").write_text("kept")
    for resume in (False, True):
        with pytest.raises(InputError, match="not a folder"):
            create_run_folder(tmp_path / "file", resume)
    with pytest.raises(InputError, match="cannot be written to"):
        create_run_folder(tmp_path / "file" / "below")
    assert (tmp_path / "file").read_text() == "kept"


def test_run_folder_that_cannot_be_written_leaves_nothing(tmp_path, monkeypatch):
    def read_only(self, exist_ok=True):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(storage.Path, "touch", read_only)
    with pytest.raises(InputError, match=r"cannot be written to \(Permission denied\)"):
        create_run_folder(tmp_path / "runs" / "first")
    assert os.listdir(tmp_path) == []


def test_default_run_folder_names_scene_and_time():
    folder = default_run_folder("kodama")
    assert folder.parts[0] == "runs"
    assert folder.name.startswith("kodama-20")
    assert folder.name.endswith("Z")
