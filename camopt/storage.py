"""Writing results: every file appears whole or not at all, and a run folder is never overwritten by accident."""

import csv
import io
import json
import math
import os
import secrets
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from camopt.scene.errors import InputError
from camopt.scene.text_file import usable_path


def write_text(path: str | Path, text: str) -> None:
    """Writes UTF-8 text; see `write_bytes`."""
    write_bytes(path, text.encode(errors="backslashreplace"))  # the name of a file may hold what UTF-8 cannot


def write_bytes(path: str | Path, content: bytes) -> None:
    """Writes a file so that a reader or a crash sees the old one or the whole new one.

    A device or pipe (/dev/stdout) is written to as it is. Raises InputError where nothing can be written.
    """
    path = Path(path)
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            path.write_bytes(content)
            return
        if path.is_dir():
            raise IsADirectoryError("it is a folder")
        _replace(path.resolve(), content)
    except (OSError, ValueError) as error:  # a ValueError where a name holds a NUL
        reason = error.strerror or error if isinstance(error, OSError) else error
        raise InputError(
            f"{path}: cannot be written ({reason}); name a file in an existing, writable folder"
        ) from error


def check_file(path: str | Path) -> None:
    """Raises InputError where no file can be written, so that nothing is computed in vain."""
    path = usable_path(path, "file")
    reason = "it is a folder" if path.is_dir() else "" if path.parent.is_dir() else "its folder does not exist"
    if reason:
        raise InputError(f"{path}: cannot be written ({reason}); name a file in an existing, writable folder")


def _replace(path: Path, content: bytes) -> None:
    """Temporary file in the same folder (a rename across file systems is not atomic), then the rename."""
    temporary = path.with_name(f".camopt-{secrets.token_hex(8)}.tmp")
    try:
        with open(temporary, "xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_json(path: str | Path, data: Any) -> None:
    """Writes JSON with null for every value that is not finite; NumPy numbers and arrays become plain ones."""
    write_text(path, json.dumps(plain(data), indent=1, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """Data as JSON knows it: dictionaries, lists, strings, finite numbers, null."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):  # NumPy and JAX arrays and scalars
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    raise TypeError(f"{type(value).__name__} cannot be stored as JSON")


def write_csv(path: str | Path, columns: Mapping[str, Any]) -> None:
    """Writes a table of equally long columns; floats with every digit, None and NaN as an empty cell."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    lists = [plain(column) for column in columns.values()]
    writer.writerows(zip(*lists, strict=True))
    write_text(path, text.getvalue())


def default_run_folder(scene_name: str) -> Path:
    """runs/<scene>-<UTC time> below the current folder."""
    return Path("runs") / f"{scene_name}-{datetime.now(UTC):%Y%m%dT%H%M%SZ}"


def check_run_folder(folder: str | Path, resume: bool = False) -> None:
    """Raises InputError where `folder` exists and is not to be resumed, or cannot be a folder."""
    folder = usable_path(folder, "folder")
    if folder.is_dir() and not resume:
        raise InputError(f"{folder}: this run folder exists already: give another --out, or --resume to go on in it")
    if os.path.lexists(folder) and not folder.is_dir():
        raise InputError(f"{folder}: is not a folder: give another --out")


def create_run_folder(folder: str | Path, resume: bool = False) -> Path:
    """The folder, made with its parents where it is missing, and known to be writable.

    With `resume` an existing folder is used as it is. Raises InputError otherwise, and where nothing can be written
    there; folders made on the way to a failure are taken away again.
    """
    folder = Path(folder)
    check_run_folder(folder, resume)
    missing = [p for p in (folder, *folder.parents) if not p.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".camopt-{secrets.token_hex(8)}.tmp"
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        for made in missing:
            if made.is_dir() and not any(made.iterdir()):
                made.rmdir()
        raise InputError(
            f"{folder}: the run folder cannot be written to ({error.strerror}); give a writable place as --out"
        ) from error
    return folder
