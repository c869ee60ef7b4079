"""Experiments that draw many cases compute them by `camopt.sweep`."""

import tempfile
from collections.abc import Iterable
from pathlib import Path

import camopt

WORKERS = {"small": 0, "full": None}
"""Processes: none beside the tests' own at small size, one for each core at full size."""
OF_THE_TASK = ("task", "state", "verb", "function")


def called(function: str, cases: Iterable[dict], size: str, store: Path | None = None) -> list[dict]:
    """What `function`, "package.module:name", returns for each case, a dictionary of its arguments; with the arguments.

    What is not finite comes back as None. A `store` that is given goes on after an interruption. Raises RuntimeError
    with the reason where a case fails.
    """
    tasks = [{"verb": "call", "function": function, "arguments": case} for case in cases]
    with tempfile.TemporaryDirectory() as made:
        swept = camopt.sweep(tasks, store or Path(made) / "x.sqlite", workers=WORKERS[size], progress=size == "full")
        rows = list(swept.rows())
    if failed := [row for row in rows if row["state"] == "failed"]:
        raise RuntimeError(f"{len(failed)} of {len(rows)} cases of {function} failed: {failed[0]['reason']}")
    return [{key: value for key, value in row.items() if key not in OF_THE_TASK} for row in rows]
