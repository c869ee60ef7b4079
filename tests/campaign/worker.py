"""A process that runs the cases whose numbers it reads, one a line, and answers what each came to."""

import io
import json
import os
import sys
import tempfile
import time
from contextlib import chdir, redirect_stderr, redirect_stdout, suppress
from pathlib import Path

from camopt.cli.parser import main
from tests.campaign.inputs import Case, drawn

LONGEST = 1500
"""Characters of a line that a person still reads: several faults of a scene stand on lines of their own."""


def run(case: Case, folder: Path) -> tuple[object, str]:
    """Exit code and stderr of a case in a folder of its own."""
    for name, content in case.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    said = io.StringIO()
    with chdir(folder), redirect_stdout(io.StringIO()), redirect_stderr(said):
        try:
            code: object = main(case.words)
        except SystemExit as stop:
            code = stop.code
        except BaseException as error:  # nothing may leave main but an exit
            code = f"{type(error).__name__}: {error}"
    return code, said.getvalue()


def verdict(code: object, said: str) -> str:
    """What is wrong with how a command ended, or "" where nothing is."""
    if code not in (0, 2, 3):
        return f"exit {code}"
    for word in ("Traceback", "a defect of camopt", "Warning:"):
        if word in said:
            return word
    if code == 2 and not said.strip():
        return "no sentence"
    if any(len(line) > LONGEST for line in said.splitlines()):
        return "a line that nobody reads"
    return ""


def answer(seed: int) -> dict:
    """Class, exit code, seconds and what is wrong with one case."""
    case = drawn(seed)
    with tempfile.TemporaryDirectory() as folder:
        start = time.monotonic()
        code, said = run(case, Path(folder))
        took = time.monotonic() - start
    return {
        "seed": seed,
        "kind": case.kind,
        "code": code if isinstance(code, int) else str(code)[:300],
        "seconds": round(took, 3),
        "wrong": verdict(code, said)[:100],
        "said": said[-400:] if verdict(code, said) else "",
        "words": [w[:60] for w in case.words],
    }


if __name__ == "__main__":
    answers = os.fdopen(os.dup(1), "w")  # camopt's own words to standard output go elsewhere
    sys.stdout = sys.stderr
    with suppress(KeyboardInterrupt):
        for line in sys.stdin:
            print(json.dumps(answer(int(line))), file=answers, flush=True)
