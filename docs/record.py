"""Records the output of the commands of the tutorials: `python -m docs.record` writes docs/tutorials/recorded.json.

With names of pages (`python -m docs.record an-engineers-day`) it only runs the commands of these pages and keeps the
recorded output of the others.

The commands are in blocks ```` ```{generated} terminal ```` of the pages. They run in the order of the page, in a new
folder for each page with copies of the scenes and tables beside the pages; `docs.generators.terminal` shows them with
their recorded output.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Sequence
from pathlib import Path

from camopt.storage import write_json
from docs.generators.terminal import BLOCK, RECORDED
from experiments.support.record import provenance

PAGES = RECORDED.parent
WIDTH, LONGEST = 100, 600
"""Columns at which a line is folded, and characters of a line above which it is cut off."""


def commands_of(page: Path) -> list[str]:
    """The commands of a page's terminal blocks, in their order."""
    return [line for block in BLOCK.findall(page.read_text(encoding="utf-8")) for line in block.strip().splitlines()]


def printed(command: str, folder: Path) -> dict:
    """Exit code and standard output of a command of camopt in a folder."""
    words = [sys.executable, "-m", "camopt", *command.split()[1:]]
    here = os.environ | {"PYTHONPATH": str(PAGES.parents[1])}  # the camopt of this checkout
    done = subprocess.run(words, cwd=folder, env=here, capture_output=True, text=True, check=False)
    return {
        "exit_code": done.returncode,
        "output": [part for line in done.stdout.splitlines() for part in folded(line)],
    }


def folded(line: str) -> list[str]:
    """A line as it is shown: folded if it is long, cut off if it is very long."""
    if len(line) > LONGEST:
        return [f"{line[:WIDTH]} ..."]
    return textwrap.wrap(line, WIDTH, subsequent_indent="    ") if len(line) > WIDTH else [line]


def furnish(folder: Path) -> None:
    """Copies the scenes and tables beside the pages into a folder."""
    for file in (*PAGES.glob("*.toml"), *PAGES.glob("*.csv")):
        shutil.copy(file, folder)


def main(names: Sequence[str] = ()) -> None:
    """Runs the commands of the named pages, by default of all pages, and writes their output."""
    recorded = json.loads(RECORDED.read_text(encoding="utf-8"))["printed"] if names else {}
    outputs = {}
    for page in sorted(PAGES.glob("*.md")):
        if names and page.stem not in names:
            outputs |= {command: recorded[command] for command in commands_of(page)}
            continue
        with tempfile.TemporaryDirectory() as name:
            furnish(Path(name))
            for command in commands_of(page):
                outputs[command] = printed(command, Path(name))
                print(command, outputs[command]["exit_code"], flush=True)
    write_json(RECORDED, {"provenance": provenance("python -m docs.record"), "printed": outputs})


if __name__ == "__main__":
    main(sys.argv[1:])
