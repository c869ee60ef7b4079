"""Runs numbered cases in processes that are watched: a case over its time or memory is killed and counted."""

import json
import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event, Lock, Thread

from tests.campaign.inputs import drawn

SECONDS, BYTES = 60.0, 2 * 2**30
ROOT = Path(__file__).parents[2]


class Worker:
    """A process that computes cases, replaced when one of them ends it."""

    def __init__(self):
        self.process: subprocess.Popen | None = None

    def _started(self) -> subprocess.Popen:
        if self.process is None or self.process.poll() is not None:
            self.stop()
            words = [sys.executable, "-m", "tests.campaign.worker"]
            pipe = subprocess.PIPE
            self.process = subprocess.Popen(
                words, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True, cwd=ROOT
            )
        return self.process

    def answer(self, seed: int) -> dict:
        """What came of a case; where the process was ended, why."""
        process = self._started()
        assert process.stdin is not None and process.stdout is not None
        done = Event()
        watch = Thread(target=_watched, args=(process, done), daemon=True)
        watch.start()
        process.stdin.write(f"{seed}\n")
        process.stdin.flush()
        line = process.stdout.readline()
        done.set()
        if not line:
            wrong = f"over {SECONDS:g} s" if process.wait() == -signal.SIGTERM else f"died ({process.returncode})"
            case = drawn(seed)
            return {
                "seed": seed,
                "kind": case.kind,
                "code": None,
                "seconds": SECONDS,
                "wrong": wrong,
                "words": case.words,
            }
        found = json.loads(line)
        if peak(process.pid) > BYTES:
            found["wrong"] = found["wrong"] or "over 2 GB"
            self.stop()
        return found

    def stop(self) -> None:
        """Ends the process."""
        if self.process is not None:
            with self.process:  # closes its pipes
                self.process.kill()


def _watched(process: subprocess.Popen, done: Event) -> None:
    """Ends a process that took more than its processor time since now before `done`; a clock would tell of others."""
    start = processor_time(process.pid)
    while not done.wait(1.0):
        if processor_time(process.pid) - start > SECONDS:
            process.terminate()
            return


def processor_time(pid: int) -> float:
    """Seconds that a process has computed; 0 where there is none."""
    file = Path(f"/proc/{pid}/stat")
    if not file.exists():
        return 0.0
    ticks = file.read_text().rpartition(")")[2].split()[11:13]
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")


def peak(pid: int) -> int:
    """Greatest resident memory of a process so far [bytes]."""
    status = Path(f"/proc/{pid}/status")
    if not status.exists():
        return 0
    rows = [line.split() for line in status.read_text().splitlines() if line.startswith("VmHWM")]
    return int(rows[0][1]) * 1024 if rows else 0


def outcomes(seeds: range, workers: int = 2) -> Iterator[dict]:
    """Outcomes of the cases of these numbers, as they come."""
    idle, lock = [Worker() for _ in range(workers)], Lock()

    def one(seed: int) -> dict:
        with lock:
            worker = idle.pop()
        try:
            return worker.answer(seed)
        finally:
            with lock:
                idle.append(worker)

    try:
        with ThreadPoolExecutor(workers) as pool:
            yield from pool.map(one, seeds)
    finally:
        for worker in idle:
            worker.stop()


def table(found: list[dict]) -> str:
    """Counts by class and exit code, and what was wrong, as lines."""
    counts = Counter((f["kind"], f["wrong"] or f"code {f['code']}") for f in found)
    rows = [f"{kind:10s} {what:40s} {count:7d}" for (kind, what), count in sorted(counts.items())]
    slowest = max((f["seconds"] for f in found), default=0.0)
    return "\n".join(
        [*rows, f"{len(found)} cases, {sum(bool(f['wrong']) for f in found)} wrong, slowest {slowest:.1f} s"]
    )
