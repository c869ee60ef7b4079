"""Many verdicts in one process: memory, threads and open files stay where they were."""

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
    """What this process holds: resident memory [MB], threads, open files. What the allocator keeps of memory that was
    freed, which comes and goes with the order of requests, is given back first."""
    gc.collect()
    with contextlib.suppress(AttributeError, OSError):  # glibc alone has it
        ctypes.CDLL(None).malloc_trim(0)
    resident = int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")
    return {"memory_MB": resident / 1e6, "threads": threading.active_count(), "files": len(os.listdir("/proc/self/fd"))}


def soaked(verdicts: int, every: int) -> Iterator[dict]:
    """What the process holds each time that so `many` verdicts more were given, each of another train and speed."""
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
    """Whether a process holds more threads or files than before, or a tenth more memory."""
    return any(after[key] > before[key] * (1.1 if key == "memory_MB" else 1) for key in usage())
