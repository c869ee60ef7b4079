"""Journals from which interrupted work resumes: each finished item is a line in a file, flushed to disk before the next
item begins. The arrays of a search's steps are stored in separate files."""

import io
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from camopt.scene.errors import InputError
from camopt.storage import plain, write_bytes, write_text


class Records:
    """Records of finished work, looked up by their values of the fields `names`. Each is a line of JSON in a file; with
    `path` None they are held in memory only.

    A record is on the disk before `add` returns, and an incomplete last line is ignored, so that interrupted work
    resumes after its last complete record. `identity`, where given, identifies the work and is the first line of the
    file. Raises InputError for a file with another identity, or one that is not such a journal.
    """

    def __init__(self, path: str | Path | None, *names: str, identity: Mapping[str, Any] | None = None):
        self.names = names
        self._path = None if path is None else Path(path)
        lines = [] if self._path is None else whole_lines(self._path)
        head = [] if identity is None else [json.dumps(plain(identity))]
        if lines and lines[: len(head)] != head:
            raise InputError(
                f"{path}: belongs to other work, of another version or scene or with other settings, and nothing in it "
                f"was changed: name another file, or repeat the original arguments"
            )
        try:
            self._records = {self._key(record): record for record in map(json.loads, lines[len(head) :])}
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path}: is no journal of {', '.join(names)} ({error}): name another file") from error
        if self._path is not None and not lines and head:
            append_line(self._path, head[0])

    def get(self, *key: Any) -> dict[str, Any] | None:
        """The record with these values of `names`; None where there is none."""
        return self._records.get(_hashable(key))

    def add(self, *records: Mapping[str, Any]) -> None:
        """Stores records in one write; values that are not finite become null."""
        new = [plain(record) for record in records]
        if self._path is not None:
            append_line(self._path, "\n".join(json.dumps(record, allow_nan=False) for record in new))
        self._records |= {self._key(record): record for record in new}

    def _key(self, record: Mapping[str, Any]) -> Any:
        return _hashable([record[name] for name in self.names])


def _hashable(value: Any) -> Any:
    return tuple(map(_hashable, value)) if isinstance(value, list | tuple) else value


def append_line(path: str | Path, line: str) -> None:
    """Appends a line to a log; the line is on the disk before this returns."""
    with open(path, "a", encoding="utf-8", newline="") as file:
        file.write(line + "\n")
        file.flush()
        os.fsync(file.fileno())


def whole_lines(path: str | Path) -> list[str]:
    """The lines of a log, none where the file is missing; an incomplete last line is removed from the file."""
    path = Path(path)
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        write_text(path, whole)
    return whole.split("\n")[:-1]


HISTORY = "history.jsonl"


class StepFiles:
    """`history.jsonl`, a line per step, and `NAME/*.npz`, the arrays of a step; in a run folder, or nowhere."""

    def __init__(self, folder: Path | None, name: str):
        self._folder, self._name, self._noted = folder, name, 0
        if folder is not None:
            (folder / name).mkdir(exist_ok=True)
            self._noted = len(whole_lines(folder / HISTORY))

    @property
    def kept(self) -> bool:
        """Whether anything is stored: a search without a run folder stores nothing."""
        return self._folder is not None

    def beside(self, name: str) -> "StepFiles":
        """The step files under another name in the same run folder, or nowhere."""
        return StepFiles(self._folder, name)

    def stored(self, step: int, z: np.ndarray, names: Sequence[str]) -> dict[str, np.ndarray] | None:
        """The arrays of this step of an interrupted run, None where there are none; z (m) is the step's cam. Raises
        InputError where they belong to another cam or lack one of `names`: the folder is another search's."""
        path = self._path(step)
        if path is None or not path.exists():
            return None
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
        complete = {"z", *names} <= set(arrays) and arrays["z"].shape == z.shape
        if not (complete and np.allclose(arrays["z"], z, rtol=0, atol=1e-9)):
            raise InputError(
                f"{path}: belongs to another search: resume with the scene, the options and the seed of the "
                f"interrupted run, or choose another --out"
            )
        return arrays

    def store(self, step: int, z: np.ndarray, arrays: dict[str, np.ndarray]) -> None:
        """Stores the arrays of a step with its cam z (m)."""
        if (path := self._path(step)) is not None:
            content = io.BytesIO()
            np.savez(content, allow_pickle=False, z=z, **arrays)
            write_bytes(path, content.getvalue())

    def note(self, line: dict) -> None:
        """Appends a line to the history, unless an interrupted run has written the line of this step already."""
        if self._folder is not None and line["iteration"] > self._noted:
            append_line(self._folder / HISTORY, json.dumps(plain(line), allow_nan=False))

    def _path(self, step: int) -> Path | None:
        return None if self._folder is None else self._folder / self._name / f"{step:04d}.npz"
