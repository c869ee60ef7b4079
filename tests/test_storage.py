"""Files are written atomically, and run folders are never overwritten."""

import csv
import json
import math
import os

import numpy as np
import pytest

from camopt import storage
from camopt.scene import InputError, load_scene
from camopt.storage import (
    RUN_FILE,
    check_run_folder,
    create_run_folder,
    default_run_folder,
    run_folder,
    run_identity,
    write_csv,
    write_csv_rows,
    write_json,
    write_text,
)
from camopt.storage.journal import Records
from tests.command_line import contents

MOTOR = load_scene("motori-1")
IDENTITY = run_identity("optimize", MOTOR, speeds="band", seed=0)


def test_text_replaces_the_old_file_and_leaves_no_other_file(tmp_path):
    file = tmp_path / "a.txt"
    write_text(file, "old")
    write_text(file, "Δ new\n")
    assert file.read_bytes() == "Δ new\n".encode()
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_failure_while_writing_keeps_the_old_file(tmp_path, monkeypatch):
    file = tmp_path / "a.txt"
    write_text(file, "old")

    def disk_full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(storage.os, "fsync", disk_full)
    with pytest.raises(InputError, match=r"a\.txt: cannot be written \(No space left on device\)"):
        write_text(file, "new")
    assert file.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_temporary_files_of_killed_processes_are_removed(tmp_path):
    old, new, foreign = (tmp_path / f".camopt-{name}.tmp" for name in ("0" * 16, "1" * 16, "mine"))
    for file in (old, new, foreign):
        file.touch()
    for file in (old, foreign):
        os.utime(file, (0, 0))
    write_text(tmp_path / "a.txt", "x")
    assert set(os.listdir(tmp_path)) == {new.name, foreign.name, "a.txt"}


def test_written_content_is_flushed_before_the_rename(tmp_path, monkeypatch):
    calls = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(storage.os, "fsync", lambda f: (calls.append("fsync"), fsync(f))[1])
    monkeypatch.setattr(storage.os, "replace", lambda a, b: (calls.append("replace"), replace(a, b))[1])
    write_text(tmp_path / "a.txt", "x")
    assert calls == ["fsync", "replace"]


def test_a_symbolic_link_is_kept(tmp_path):
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


def test_json_refuses_unknown_types(tmp_path):
    with pytest.raises(TypeError, match="set cannot be stored"):
        write_json(tmp_path / "a.json", {"a": {1, 2}})
    assert os.listdir(tmp_path) == []


def test_csv_keeps_full_precision(tmp_path):
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


def test_a_table_written_row_by_row_is_complete_or_absent(tmp_path):
    file = tmp_path / "a.csv"
    write_csv_rows(file, ["x", "y"], ([i / 3, None if i else "é"] for i in range(3)))
    assert file.read_text(encoding="utf-8").splitlines() == ["x,y", "0.0,é", f"{1 / 3!r},", f"{2 / 3!r},"]

    def interrupted():
        yield [1, 2]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_csv_rows(file, ["x", "y"], interrupted())
    assert len(file.read_text(encoding="utf-8").splitlines()) == 4
    assert os.listdir(tmp_path) == ["a.csv"]
    with pytest.raises(InputError, match="cannot be written"):
        write_csv_rows(tmp_path / "none" / "a.csv", ["x"], [])


def begun(folder, error=None, worth=("design.json",), resume=False, identity=IDENTITY, results=("design.json",)):
    """A run that writes `results` and ends with `error`."""
    with run_folder(folder, identity, resume, worth) as inside:
        for name in results:
            (inside / name).write_text(f"of {name}")
        if error is not None:
            raise error
    return folder


def test_a_run_folder_is_created_once(tmp_path):
    folder = create_run_folder(tmp_path / "runs" / "first")
    assert os.listdir(folder) == []
    (folder / "design.json").write_text("{}")
    with pytest.raises(InputError, match=r"exists already and is not a camopt run: give another --out"):
        create_run_folder(folder)
    with pytest.raises(InputError, match="exists already"):
        check_run_folder(folder)
    check_run_folder(folder, resume=True)
    assert os.listdir(folder) == ["design.json"]


def test_only_one_of_two_simultaneous_processes_creates_the_folder(tmp_path, monkeypatch):
    for made, begin in {"a": create_run_folder, "b": begun}.items():
        checked = lambda folder, resume=False: folder.mkdir(exist_ok=True)  # noqa: E731 - made by another process meanwhile
        monkeypatch.setattr("camopt.storage.check_run_folder", checked)
        with pytest.raises(InputError, match=f"{made}: another run began in this folder just now: give another --out"):
            begin(tmp_path / made)


def test_a_finished_run_is_only_resumed_by_the_same_run_and_not_changed(tmp_path):
    folder = begun(tmp_path / "run")
    before = contents(folder)
    others = {
        "there, 0.0 now)": {"version": "0.0"},
        "its settings differ (seed: 0 there, 1 now)": {"settings": {"speeds": "band", "seed": 1}},
        "its command differs (optimize there, tradeoff now)": {"command": "tradeoff"},
        "its scene differs (motori-1; kodama)": {"scene": run_identity("optimize", load_scene("kodama"))["scene"]},
    }
    softer = MOTOR.model_copy(update={"operation": MOTOR.operation.model_copy(update={"band_rpm": (5000.0, 6900.0)})})
    others["its scene differs (motori-1)"] = {"scene": run_identity("optimize", softer)["scene"]}
    for words, changed in others.items():
        with pytest.raises(InputError) as error, run_folder(folder, {**IDENTITY, **changed}, resume=True):
            (folder / "design.json").write_text("overwritten")
        assert "belongs to another run, and nothing in it was changed" in str(error.value)
        assert words in str(error.value)
        assert contents(folder) == before
    with pytest.raises(InputError, match=r"holds a finished optimize run: give another --out, or remove the folder"):
        begun(folder)
    assert contents(folder) == before
    begun(folder, resume=True)
    assert json.loads((folder / RUN_FILE).read_text())["state"] == "finished"


def test_a_folder_without_a_run_cannot_be_resumed(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "history.jsonl").write_text("mine")
    with pytest.raises(InputError, match=r"there is no run\.json, so the run cannot be resumed"):
        begun(tmp_path / "run", resume=True)
    assert contents(tmp_path / "run") == {"history.jsonl": b"mine"}


def test_a_run_that_fails_without_results_removes_its_folder(tmp_path):
    with pytest.raises(InputError, match="no confirmed cam"):
        begun(tmp_path / "run", InputError("no confirmed cam"), results=("history.jsonl",))
    assert not (tmp_path / "run").exists()
    begun(tmp_path / "run", results=())  # the retry is not blocked


def test_a_failed_run_with_results_is_reported(tmp_path):
    with pytest.raises(ZeroDivisionError):
        begun(tmp_path / "run", ZeroDivisionError("division by zero"))
    with pytest.raises(
        InputError, match=r"holds a failed optimize run \(division by zero\): remove the folder or give"
    ):
        begun(tmp_path / "run")
    assert (tmp_path / "run" / "design.json").exists()
    with pytest.raises(InputError, match="again"):  # a resumed run does not remove a folder that it did not create
        begun(tmp_path / "run", InputError("again"), worth=(), resume=True)
    assert (tmp_path / "run" / "design.json").exists()


def test_an_interrupted_run_is_reported_and_resumed(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        begun(tmp_path / "run", KeyboardInterrupt())
    with pytest.raises(InputError, match=r"holds an interrupted optimize run: --resume goes on in it"):
        check_run_folder(tmp_path / "run")
    assert begun(tmp_path / "run", resume=True) == tmp_path / "run"


class TestJournal:
    def test_records_survive_an_interruption_and_are_found_by_key(self, tmp_path):
        path = tmp_path / "x.jsonl"
        journal = Records(path, "case", "at", identity={"seed": 1})
        journal.add({"case": "a", "at": [1.0, 2.0], "error": math.inf}, {"case": "b", "at": [], "error": 0.5})
        path.write_text(path.read_text() + '{"case": "c", "at"')
        again = Records(path, "case", "at", identity={"seed": 1})
        for records in (journal, again):
            assert records.get("a", (1.0, 2.0)) == {"case": "a", "at": [1.0, 2.0], "error": None}
            assert records.get("b", ())["error"] == 0.5 and records.get("c", ()) is None
        assert len(path.read_text().splitlines()) == 3

    def test_a_journal_of_other_work_is_not_changed(self, tmp_path):
        path = tmp_path / "x.jsonl"
        Records(path, "case", identity={"seed": 1}).add({"case": "a"})
        before = path.read_bytes()
        with pytest.raises(InputError, match=r"belongs to other work, .* nothing in it was changed"):
            Records(path, "case", identity={"seed": 2})
        with pytest.raises(InputError, match="is no journal of setting"):
            Records(path, "setting", identity={"seed": 1})
        assert path.read_bytes() == before

    def test_without_a_file_records_are_in_memory(self):
        journal = Records(None, "case")
        journal.add({"case": 1, "value": 2.0})
        assert journal.get(1) == {"case": 1, "value": 2.0} and journal.get(2) is None


def test_a_run_folder_in_the_place_of_a_file(tmp_path):
    (tmp_path / "file").write_text("kept")
    with pytest.raises(InputError, match="not a folder"):
        create_run_folder(tmp_path / "file")
    for resume in (False, True):
        with pytest.raises(InputError, match="not a folder"):
            begun(tmp_path / "file", resume=resume)
    with pytest.raises(InputError, match="cannot be written to"):
        create_run_folder(tmp_path / "file" / "below")
    assert (tmp_path / "file").read_text() == "kept"


def test_a_run_folder_that_cannot_be_written_leaves_no_file(tmp_path, monkeypatch):
    def read_only(self, exist_ok=True):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(storage.Path, "touch", read_only)
    with pytest.raises(InputError, match=r"cannot be written to \(Permission denied\)"):
        create_run_folder(tmp_path / "runs" / "first")
    assert os.listdir(tmp_path) == []


def test_the_default_run_folder_names_scene_and_time():
    folder = default_run_folder("kodama")
    assert folder.parts[0] == "runs"
    assert folder.name.startswith("kodama-20")
    assert folder.name.endswith("Z")
