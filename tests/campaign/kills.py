"""SIGKILL at random instants: no file is damaged, and the resumed run ends like an uninterrupted one."""

import csv
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from tests.tasks.tasks_of_tests import opened

UNLIKE = {"seconds", "stages", "started_utc", "finished_utc", "times", "cpu_s", "clock_s", "peak_memory_MB"}
"""Keys with times and costs, which differ from run to run."""
PLAN = 'format = 1\nverb = "settled"\nscenes = ["motori-1"]\ncams = ["polydyne"]\nspeeds_rpm = [3000, 4000, 5000]\n'


@dataclass(frozen=True)
class Killed:
    """A command that writes files: its words, the option that resumes it, and the files that must be the same."""

    words: tuple[str, ...]
    resume: tuple[str, ...]
    same: tuple[str, ...]


COMMANDS = {
    "cam": Killed(
        ("cam", "kodama", "--cam", "polydyne", "--csv", "lift.csv", "--figure", "lift.svg"), (), ("lift.csv",)
    ),
    "sweep": Killed(("sweep", "plan.toml", "--store", "x.sqlite", "--csv", "x.csv"), ("--resume",), ("x.sqlite",)),
    "yield": Killed(
        ("yield", "motori-1", "--cam", "polydyne", "--trains", "40", "--json", "yield.json", "--out", "run"),
        ("--resume",),
        ("yield.json",),
    ),
    "optimize": Killed(
        ("optimize", "motori-1", "--speeds", "nominal", "--accuracy", "draft", "--out", "run"),
        ("--resume",),
        ("run/design.json", "run/lift.csv", "run/verification.json", "run/comparison.csv"),
    ),
}


def timeless(data: Any) -> Any:
    """Nested data without times and costs."""
    if isinstance(data, dict):
        return {k: timeless(v) for k, v in data.items() if k not in UNLIKE}
    return [timeless(v) for v in data] if isinstance(data, list) else data


def digest(path: Path) -> str:
    """SHA-256 of the data of a file without times."""
    if path.suffix == ".sqlite":
        with opened(path) as db:
            data: Any = db.execute("SELECT key, number, state, outcome FROM row ORDER BY key").fetchall()
    elif path.suffix == ".json":
        data = timeless(json.loads(path.read_text(encoding="utf-8")))
    else:
        data = path.read_text(encoding="utf-8")
    return hashlib.sha256(repr(data).encode()).hexdigest()


def _closed(ending: str) -> Callable[[Path], None]:
    def check(path: Path) -> None:
        assert path.read_text(encoding="utf-8").rstrip().endswith(ending), f"{path.name} is cut off"

    return check


READERS: dict[str, Callable[[Path], Any]] = {
    ".json": lambda path: json.loads(path.read_text(encoding="utf-8")),
    ".toml": lambda path: tomllib.loads(path.read_text(encoding="utf-8")),
    ".csv": lambda path: list(csv.reader(path.read_text(encoding="utf-8").splitlines(), strict=True)),
    ".svg": _closed("</svg>"),
    ".html": _closed("</html>"),
}


def torn(folder: Path) -> list[str]:
    """Files that cannot be parsed any more; the last line of a log may be cut off, since resuming repairs it."""
    faults = []
    for path in folder.rglob("*"):
        if path.name.startswith(".camopt-") or path.suffix not in READERS:
            continue
        try:
            READERS[path.suffix](path)
        except Exception as error:
            faults.append(f"{path.name}: {error}")
    return faults


def start(words: tuple[str, ...], folder: Path) -> subprocess.Popen:
    """Starts camopt in its own process group, so that its workers are killed with it."""
    command = [sys.executable, "-m", "camopt", *words, "--quiet"]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=folder, start_new_session=True, stdout=pipe, stderr=pipe, text=True)


def ended(words: tuple[str, ...], folder: Path) -> tuple[int, str, float]:
    """Exit code, output and seconds of an uninterrupted command."""
    begin = time.monotonic()
    process = start(words, folder)
    out, err = process.communicate()
    return process.returncode, out + err, time.monotonic() - begin


def killings(name: str, folder: Path, kills: int, seed: int = 0) -> Iterator[dict]:
    """Starts a command `kills` times, each time in a new folder, kills and resumes it, and yields its fault or "".

    Every third run is killed a second time after it has been resumed.
    """
    command, draw = COMMANDS[name], Random(seed)
    whole = _folder(folder / f"{name}-whole")
    code, said, seconds = ended(command.words, whole)
    assert code in (0, 3), said
    truth = {file: digest(whole / file) for file in command.same}
    for number in range(kills):
        here = _folder(folder / f"{name}-{number}")
        words, at = command.words, []
        for _ in range(1 + (number % 3 == 0)):
            at.append(draw.uniform(0, seconds))
            process = start(words, here)
            time.sleep(at[-1])
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            wrong = torn(here)
            begun = any(p.name != "plan.toml" for p in here.iterdir())
            words = command.words + (command.resume if begun else ())
        wrong = "; ".join(wrong) or _resumed(words, here, code, truth)
        yield {"kind": name, "ended": "the same", "killed_at_s": at, "wrong": wrong}


def _folder(path: Path) -> Path:
    path.mkdir()
    (path / "plan.toml").write_text(PLAN, encoding="utf-8")
    return path


def _resumed(words: tuple[str, ...], folder: Path, expected: int, truth: dict[str, str]) -> str:
    """The fault of a run that is resumed and runs to its end, or "" for none."""
    code, said, _ = ended(words, folder)
    if "finished" in said and code == 2:  # it was killed after its last file
        code = expected
    if code != expected:
        return f"exit {code}: {said[-300:]}"
    return "; ".join(f"{file} differs" for file, known in truth.items() if digest(folder / file) != known)
