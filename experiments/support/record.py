"""Shared by the experiments: cases computed by `camopt.sweep`, and stored results as a small JSON and PNG figures."""

import argparse
import platform
import tempfile
import time
from collections.abc import Callable, Iterable
from importlib.metadata import version
from pathlib import Path

from matplotlib.figure import Figure

import camopt
from camopt.plots.style import picture
from camopt.storage import write_bytes, write_json

WORKERS = {"small": 0, "full": None}
"""Number of worker processes: none in addition to the calling one at small size, one for each core at full size."""
OF_THE_TASK = ("task", "state", "verb", "function")


def called(function: str, cases: Iterable[dict], size: str, store: Path | None = None) -> list[dict]:
    """Results of `function`, "package.module:name", merged with its arguments, for each case, a dictionary of them.

    Values that are not finite are returned as None. With a `store` an interrupted run resumes. Raises RuntimeError with
    the reason if a case fails.
    """
    tasks = [{"verb": "call", "function": function, "arguments": case} for case in cases]
    with tempfile.TemporaryDirectory() as made:
        swept = camopt.sweep(tasks, store or Path(made) / "x.sqlite", workers=WORKERS[size], progress=size == "full")
        rows = list(swept.rows())
    if failed := [row for row in rows if row["state"] == "failed"]:
        raise RuntimeError(f"{len(failed)} of {len(rows)} cases of {function} failed: {failed[0]['reason']}")
    return [{key: value for key, value in row.items() if key not in OF_THE_TASK} for row in rows]


PACKAGES = ("camopt", "numpy", "scipy", "numba", "jax")
RESULTS = Path(__file__).parents[1] / "results"
PAGE_BYTES = 4096
DPI = 110
"""Resolution of the figures, for reading on a screen; they are stored in the repository and must stay small."""


def provenance(command: str) -> dict:
    """The origin of a results file."""
    return {
        "command": command,
        "versions": {name: version(name) for name in PACKAGES} | {"python": platform.python_version()},
        "machine": platform.machine(),
        "date_utc": time.strftime("%Y-%m-%d", time.gmtime()),
    }


def write_result(name: str, size: str, content: dict, figures: dict[str, Figure], folder: Path) -> dict:
    """Writes `<name>.json` with provenance and `<name>-<key>.png` for each figure, prints and returns `content`."""
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / f"{name}.json", {"provenance": provenance(f"python -m experiments.{name} {size}"), **content})
    for key, figure in figures.items():
        write_bytes(folder / f"{name}-{key}.png", picture(figure, "png", DPI))
    print(name, {key: value for key, value in content.items() if not isinstance(value, list)}, flush=True)
    return content


def resident_MB(process: str | int = "self") -> float:
    """Resident memory of a process, by default of this one, on Linux."""
    pages = int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])
    return pages * PAGE_BYTES / 1000**2


def printed(row: dict) -> dict:
    """The row, which is printed while the experiment goes on."""
    print(row, flush=True)
    return row


def run_script(main: Callable[[str], object], description: str | None) -> None:
    """`python -m experiments.<name> [small|full]`."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("size", nargs="?", choices=("small", "full"), default="full")
    main(parser.parse_args().size)
