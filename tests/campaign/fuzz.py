"""Runs numbered cases in worker processes of `camopt.sweep` and detects excessive time or memory, and crashes."""

import io
import resource
import tempfile
import time
from contextlib import chdir, redirect_stderr, redirect_stdout, suppress
from pathlib import Path

import camopt
from camopt.cli.parser import main
from tests.campaign.inputs import Case, drawn

SECONDS, BYTES = 60.0, 2 * 2**30
"""Processor time [s] after which the process of a case is ended, and largest permitted memory of a case [bytes]."""
LONGEST = 1500
"""Largest readable length of a line in characters; several faults of a scene are on separate lines."""


def outcomes(seeds: range, workers: int = 2, progress: bool = False) -> list[dict]:
    """The outcomes of the cases with these numbers."""
    tasks = ({"verb": "call", "function": f"{__name__}:answer", "arguments": {"seed": seed}} for seed in seeds)
    with tempfile.TemporaryDirectory() as folder:
        swept = camopt.sweep(tasks, Path(folder) / "cases.sqlite", workers=workers, progress=progress)
        return [row if row["state"] == "done" else lost(row["seed"], row["reason"]) for row in swept.rows()]


def lost(seed: int, reason: str) -> dict:
    """The outcome of a case whose process crashed or exceeded its time."""
    case = drawn(seed)
    return {"seed": seed, "kind": case.kind, "ended": "", "wrong": reason, "said": "", "words": case.words}


def answer(seed: int) -> dict:
    """Kind, exit code, seconds and fault of one case, in a process that computes nothing else."""
    case, start = drawn(seed), time.process_time()
    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (int(start + SECONDS) + 1, most))
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")  # resets the peak memory
    with tempfile.TemporaryDirectory() as folder:
        code, said = run(case, Path(folder))
    wrong = verdict(code, said)[:100] or ("over 2 GB" if peak() > BYTES else "")
    return {
        "kind": case.kind,
        "ended": f"code {code}"[:300],
        "seconds": round(time.process_time() - start, 3),
        "wrong": wrong,
        "said": said[-400:] if wrong else "",
        "words": [w[:60] for w in case.words],
    }


def peak() -> int:
    """Peak resident memory of this process [bytes]; 0 on systems other than Linux."""
    with suppress(OSError):
        rows = Path("/proc/self/status").read_text().splitlines()
        return next(int(row.split()[1]) * 1024 for row in rows if row.startswith("VmHWM"))
    return 0


def run(case: Case, folder: Path) -> tuple[object, str]:
    """Exit code and stderr of a case in a new folder."""
    for name, content in case.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    said = io.StringIO()
    with chdir(folder), redirect_stdout(io.StringIO()), redirect_stderr(said):
        try:
            code: object = main(case.words)
        except SystemExit as stop:
            code = stop.code
        except BaseException as error:  # main may only raise SystemExit
            code = f"{type(error).__name__}: {error}"
    return code, said.getvalue()


def verdict(code: object, said: str) -> str:
    """The fault in how a command ended, or "" if there is none."""
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
