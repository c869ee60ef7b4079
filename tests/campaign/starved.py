"""Helpers to run commands without disk space, access rights or a home folder."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

QUICK = ("cam", "kodama", "--cam", "polydyne")


def camopt(*words: str, through: tuple[str, ...] = (), **options) -> subprocess.CompletedProcess:
    """One command in a new process, started through the command prefix `through`."""
    command = [*through, sys.executable, "-m", "camopt", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, errors="replace", **options)


def refused(done: subprocess.CompletedProcess) -> bool:
    """Whether a command ended with exit code 2 and a sentence."""
    said = done.stderr
    return done.returncode == 2 and "camopt: " in said and "Traceback" not in said and "a defect" not in said


@contextmanager
def mounted(folder: Path, options: str) -> Iterator[Path]:
    """A file system in memory with these mount options; skips where mounting is not allowed."""
    import pytest

    folder.mkdir()
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)], capture_output=True, check=False
    )
    if done.returncode:
        pytest.skip("mounting a file system is not allowed here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


LEAST_FILES = ("bash", "-c", "trap '' XFSZ; ulimit -f 4; exec \"$@\"", "camopt")
"""A command prefix that limits the size of files to 4 kB."""


def bare(**further: str) -> dict[str, str]:
    """An environment with the search paths only, and the given variables."""
    known = {key: os.environ[key] for key in ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH") if key in os.environ}
    return known | further
