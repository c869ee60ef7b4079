"""Work that goes on after an interruption: what is finished is a line in a file, on the disk before the next begins."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from camopt.scene.errors import InputError
from camopt.storage import plain, write_text


class Records:
    """Records of finished work, found by the values that they have under `names`: a line of JSON each in a file, or in
    memory alone where `path` is None.

    A record is on the disk before `add` returns, and a line that an interruption cut off does not count, so that
    interrupted work goes on where it was. With an `identity`, which tells one work from another, the file begins with
    it. Raises InputError for a file that begins with another one, or that is no such journal.
    """

    def __init__(self, path: str | Path | None, *names: str, identity: Mapping[str, Any] | None = None):
        self.names = names
        self._path = None if path is None else Path(path)
        lines = [] if self._path is None else whole_lines(self._path)
        head = [] if identity is None else [json.dumps(plain(identity))]
        if lines and lines[: len(head)] != head:
            raise InputError(
                f"{path}: belongs to other work, of another version or scene or with other settings, and nothing in it "
                f"was changed: name another file, or ask as it was asked"
            )
        try:
            self._records = {self._key(record): record for record in map(json.loads, lines[len(head) :])}
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path}: is no journal of {', '.join(names)} ({error}): name another file") from error
        if self._path is not None and not lines and head:
            append_line(self._path, head[0])

    def get(self, *key: Any) -> dict[str, Any] | None:
        """The record with these values of `names`, None where there is none."""
        return self._records.get(_hashable(key))

    def add(self, *records: Mapping[str, Any]) -> None:
        """Keeps records, all of them at once; what is not finite in them is null."""
        new = [plain(record) for record in records]
        if self._path is not None:
            append_line(self._path, "\n".join(json.dumps(record, allow_nan=False) for record in new))
        self._records |= {self._key(record): record for record in new}

    def _key(self, record: Mapping[str, Any]) -> Any:
        return _hashable([record[name] for name in self.names])


def _hashable(value: Any) -> Any:
    return tuple(map(_hashable, value)) if isinstance(value, list | tuple) else value


def append_line(path: str | Path, line: str) -> None:
    """Adds one line to a log, on the disk before this returns."""
    with open(path, "a", encoding="utf-8", newline="") as file:
        file.write(line + "\n")
        file.flush()
        os.fsync(file.fileno())


def whole_lines(path: str | Path) -> list[str]:
    """The lines of a log, none where there is no file; a last one that an interruption cut off goes from the file."""
    path = Path(path)
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        write_text(path, whole)
    return whole.split("\n")[:-1]
