"""What every experiment leaves: a small JSON with its provenance, and figures as PNG."""

import argparse
import io
import platform
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from camopt.plots.style import RC
from camopt.storage import write_bytes, write_json

PACKAGES = ("camopt", "numpy", "scipy", "numba", "jax")
RESULTS = Path(__file__).parents[1] / "results"
DPI = 110
"""Enough for reading on a screen; the figures live in the repository and shall stay small."""


def provenance(script: str, size: str) -> dict:
    """What a results file says of its origin."""
    return {
        "command": f"python -m experiments.{Path(script).stem} {size}",
        "versions": {name: version(name) for name in PACKAGES} | {"python": platform.python_version()},
        "machine": platform.machine(),
        "date_utc": time.strftime("%Y-%m-%d", time.gmtime()),
    }


def write_result(name: str, size: str, content: dict, figures: dict[str, Figure], folder: Path) -> dict:
    """Writes `<name>.json` (the content under its provenance) and `<name>-<key>.png` for each figure; the content."""
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / f"{name}.json", {"provenance": provenance(name, size), **content})
    for key, figure in figures.items():
        buffer = io.BytesIO()
        with matplotlib.rc_context(RC):
            figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
        write_bytes(folder / f"{name}-{key}.png", buffer.getvalue())
    return content


def run_script(main: Callable[[str], object], description: str | None) -> None:
    """`python -m experiments.<name> [small|full]`."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("size", nargs="?", choices=("small", "full"), default="full")
    main(parser.parse_args().size)
