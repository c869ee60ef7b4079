"""Many verdicts in one process: memory, threads and open files do not grow."""

import contextlib
import ctypes
import gc
import os
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import camopt
from camopt.scene.parameters import Tied, matching
from camopt.verifier.verdict import verdict_on


def usage() -> dict[str, float]:
    """Resources of this process: resident memory [MB], threads, open files. Freed memory that the allocator keeps,
    whose amount depends on the order of requests, is first returned to the system."""
    gc.collect()
    with contextlib.suppress(AttributeError, OSError):  # only glibc has it
        ctypes.CDLL(None).malloc_trim(0)
    resident = int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")
    return {"memory_MB": resident / 1e6, "threads": threading.active_count(), "files": len(os.listdir("/proc/self/fd"))}


def soaked(verdicts: int, every: int) -> Iterator[dict]:
    """Resources of the process after every `every` verdicts, each of which has a different train and speed."""
    scene = camopt.load_scene("motori-1")
    cam = camopt.polydyne(scene)
    draw, preload = np.random.default_rng(0), Tied("preload", tuple(matching(scene, "spring.preload_N")))
    for done in range(1, verdicts + 1):
        one = preload.scaled(scene, float(draw.uniform(0.9, 1.1)))
        speed = float(draw.integers(2000, 6000))
        verdict_on(one, cam, (speed,), ("event",), band_step_rpm=None)
        if done % every == 0:
            yield {"verdicts": done, **usage()}


def grown(before: dict, after: dict) -> bool:
    """Whether a process has more threads or files than before, or over a tenth more memory."""
    return any(after[key] > before[key] * (1.1 if key == "memory_MB" else 1) for key in usage())
