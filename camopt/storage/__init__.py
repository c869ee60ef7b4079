"""Writing results: a file appears complete or not at all, and a run folder is never overwritten by accident."""

import csv
import io
import json
import math
import os
import secrets
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, BinaryIO

from camopt.scene.errors import InputError
from camopt.scene.schema import AS_BUILT, Scene
from camopt.scene.text_file import usable_path


def write_text(path: str | Path, text: str) -> None:
    """Writes UTF-8 text; see `write_bytes`."""
    write_bytes(path, text.encode(errors="backslashreplace"))  # a file name may not be valid UTF-8


def write_bytes(path: str | Path, content: bytes) -> None:
    """Writes a file atomically: a reader, or a crash, leaves either the old file or the complete new one. A device or
    pipe (/dev/stdout) is written directly. Raises InputError where the file cannot be written."""
    with _whole_file(path) as file:
        file.write(content)


@contextmanager
def _whole_file(path: str | Path) -> Iterator[BinaryIO]:
    """The open file to write to, with the guarantees of `write_bytes`."""
    path = Path(path)
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            with open(path, "wb") as file:
                yield file
            return
        if path.is_dir():
            raise IsADirectoryError("it is a folder")
        with _temporary_file(path.resolve()) as file:
            yield file
    except InputError:
        raise
    except (OSError, ValueError) as error:  # ValueError: the name contains a NUL
        raise _unwritable(path, error.strerror or error if isinstance(error, OSError) else error) from error


def check_file(path: str | Path) -> None:
    """Raises InputError where a file cannot be written, before anything is computed: a temporary file is created and
    removed in the same folder as `write_bytes` will use. A device or pipe is not touched."""
    path = usable_path(path, "file")
    reason = "it is a folder" if path.is_dir() else "" if path.parent.is_dir() else "its folder does not exist"
    if not reason and (path.is_file() or not path.exists()):
        reason = _refusal_below(path.resolve().parent)
    if reason:
        raise _unwritable(path, reason)


def _unwritable(path: Path, reason: object) -> InputError:
    return InputError(f"{path}: cannot be written ({reason}); name a file in an existing, writable folder")


def _refusal_below(folder: Path) -> str:
    """The system's reason for refusing a file in the folder; empty where it allows one."""
    probe = folder / f".camopt-{secrets.token_hex(8)}.tmp"
    try:
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        return error.strerror or str(error)
    return ""


ABANDONED = 3600.0
"""Age [s] beyond which a temporary file belongs to a process that was killed: writing takes seconds."""


@contextmanager
def _temporary_file(path: Path) -> Iterator[BinaryIO]:
    """A temporary file in the same folder (a rename across file systems is not atomic), which is then renamed to
    `path`. Temporary files left there by killed processes are deleted."""
    for old in path.parent.glob(".camopt-????????????????.tmp"):
        with suppress(OSError):
            if time.time() - old.stat().st_mtime > ABANDONED:
                old.unlink()
    temporary = path.with_name(f".camopt-{secrets.token_hex(8)}.tmp")
    try:
        with open(temporary, "xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_json(path: str | Path, data: Any) -> None:
    """Writes JSON with null for values that are not finite; NumPy numbers and arrays become numbers and lists."""
    write_text(path, json.dumps(plain(data), indent=1, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """Data as JSON represents it: dictionaries, lists, strings, finite numbers, null."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):  # NumPy and JAX arrays and scalars
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        if {*map(type, value)} <= {int, float} and all(map(math.isfinite, value)):
            return list(value)  # shortcut: most data are long lists of numbers
        return [plain(v) for v in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    raise TypeError(f"{type(value).__name__} cannot be stored as JSON")


def write_csv(path: str | Path, columns: Mapping[str, Any]) -> None:
    """Writes a table of columns of equal length; floats in full precision, None and NaN as empty cells."""
    rows = [*zip(*map(plain, columns.values()), strict=True)]
    write_csv_rows(path, [*columns], rows)


def write_csv_rows(path: str | Path, names: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Writes a table of any length row by row; floats in full precision, None as an empty cell. See `write_bytes`."""
    with _whole_file(path) as file:
        text = io.TextIOWrapper(file, encoding="utf-8", newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(rows)
        text.detach()


def default_run_folder(scene_name: str) -> Path:
    """runs/<scene>-<UTC time> below the current folder."""
    return Path("runs") / f"{scene_name}-{datetime.now(UTC):%Y%m%dT%H%M%SZ}"


RUN_FILE = "run.json"
"""The file that identifies a run from its start on: command, version, settings, scene, and the state of the run."""


def run_identity(command: str, scenes: Scene | Sequence[Scene], **settings: Any) -> dict:
    """The identity of a run, for `run_folder`: command, camopt's version, settings and scenes. The manufacturing
    scatter of a scene is left out; a command that draws trains has `AS_BUILT` among its settings."""
    several = [scenes] if isinstance(scenes, Scene) else scenes
    dumped = {scene.name: scene.model_dump(mode="json", exclude=AS_BUILT) for scene in several}
    return {"command": command, "version": version("camopt"), "scene": dumped, "settings": settings}


def check_run_folder(folder: str | Path, resume: bool = False) -> None:
    """Raises InputError, stating what the folder holds, where it exists and is not to be resumed, or cannot be created.

    It cannot be created or resumed where no file can be written to it or, while it is missing, to its nearest parent.
    """
    folder = usable_path(folder, "folder")
    if os.path.lexists(folder) and not folder.is_dir():
        raise InputError(f"{folder}: is not a folder: give another --out")
    if not folder.is_dir() or resume:
        absolute = folder.absolute()
        if reason := _refusal_below(next(p for p in (absolute, *absolute.parents) if os.path.lexists(p))):
            raise InputError(f"{folder}: the folder cannot be written to ({reason}); give a writable place as --out")
        return
    started = _read_run(folder)
    if started is None:
        raise InputError(
            f"{folder}: this folder exists already and is not a camopt run: give another --out, or remove it"
        )
    command, state = started.get("command", "run"), started.get("state")
    if state == "finished":
        raise InputError(f"{folder}: holds a finished {command} run: give another --out, or remove the folder")
    if state == "failed":
        raise InputError(
            f"{folder}: holds a failed {command} run ({started.get('sentence')}): remove the folder or give another "
            f"--out, or --resume to try again what failed"
        )
    raise InputError(
        f"{folder}: holds an interrupted {command} run: --resume goes on in it with the same scene and settings; or "
        f"give another --out"
    )


@contextmanager
def run_folder(
    folder: str | Path, identity: Mapping[str, Any], resume: bool = False, worth: Iterable[str] = ()
) -> Iterator[Path]:
    """The folder of one run, as a context manager around the run.

    `identity` is `run_identity`'s. It is stored before anything else, and with `resume` it is compared before anything
    is written. A run that ends without an error is marked as finished, an interrupted one stays marked as running. A
    run that fails is marked as failed with its error sentence; if the run created the folder and none of the files in
    `worth` exists, the folder is deleted. Raises InputError as `check_run_folder`, and for the folder of another run.
    """
    folder = Path(folder)
    check_run_folder(folder, resume)
    if created := not (resume and folder.is_dir()):  # another process may have created it since the check
        create_run_folder(folder)
    else:
        _same_run(folder, plain(identity))
    record = plain(identity) | {"started_utc": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"}
    write_json(folder / RUN_FILE, record | {"state": "running"})
    try:
        yield folder
    except Exception as error:
        if not folder.is_dir():
            raise InputError(f"{folder}: was deleted during the run: run again in another folder") from error
        if created and not any((folder / name).exists() for name in worth):
            shutil.rmtree(folder)
        else:
            write_json(folder / RUN_FILE, record | {"state": "failed", "sentence": str(error) or type(error).__name__})
        raise
    write_json(folder / RUN_FILE, record | {"state": "finished"})


def _same_run(folder: Path, identity: dict) -> None:
    """Raises InputError, naming what differs, where the folder belongs to another run."""
    if not any(folder.iterdir()):
        return
    started = _read_run(folder)
    if started is None:
        raise InputError(f"{folder}: there is no {RUN_FILE}, so the run cannot be resumed: give another --out")
    for key, now in identity.items():
        stored = started.get(key)
        if stored == now:
            continue
        differ = "differ" if key == "settings" else "differs"
        raise InputError(
            f"{folder}: belongs to another run, and nothing in it was changed: its {key} {differ}"
            f"{_differences(stored, now)}; use --resume with the original settings, or give another --out"
        )


def _differences(stored: Any, now: Any) -> str:
    """The difference, in brackets: the names of settings or scenes, with their values unless these are dictionaries."""
    if not isinstance(stored, dict) or not isinstance(now, dict):
        return f" ({stored} there, {now} now)"
    differences = []
    for name in {**stored, **now}:
        before, after = stored.get(name), now.get(name)
        if before != after:
            long = isinstance(before, dict) or isinstance(after, dict)
            differences.append(str(name) if long else f"{name}: {before} there, {after} now")
    return f" ({'; '.join(differences)})"


def _read_run(folder: Path) -> dict | None:
    """The record of the run that created the folder; None where there is none that can be read."""
    try:
        record = json.loads((folder / RUN_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return record if isinstance(record, dict) else None


def create_run_folder(folder: str | Path) -> Path:
    """Creates a folder and its parents. Raises InputError as `check_run_folder`, and where another process was
    faster."""
    folder = Path(folder)
    check_run_folder(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        folder.mkdir()
    except FileExistsError as error:
        raise InputError(f"{folder}: another run began in this folder just now: give another --out") from error
    return folder
