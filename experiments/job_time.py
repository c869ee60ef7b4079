"""What does `camopt optimize kodama` take, cold, warm and at draft, and where do the seconds go?

`camopt optimize kodama` in a fresh process each: standard with every cache of compiled programs empty, standard again
with the programs that this left, and draft twice, of which the first compiles what has the shape of its speeds. By
stage: clock, processor time and compilation, from provenance.json; of the whole process, imports included: clock,
processor time and peak memory, from the system. A fixed loop of arithmetic is timed before each of them, so that runs
of different days and machines can be compared. The small size is `motori-1` at its listed speeds and draft without
gradients, on whatever caches there are.

Where `CAMOPT_OLDER_TREE` names the folder of an older checkout, its warm and its draft job run beside these, from
caches of their own, and what the jobs take is said as a ratio too.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from experiments.support.record import RESULTS, run_script, write_result

LOOP = 3_000_000
CACHES = {"NUMBA_CACHE_DIR": "numba", "JAX_COMPILATION_CACHE_DIR": "jax", "XDG_CACHE_HOME": "cache"}
"""By environment variable, the folder inside the experiment's own in which compiled programs are kept."""
KODAMA = ("optimize", "kodama", "--seed", "0", "--quiet")
CASES = {
    "cold": (*KODAMA, "--accuracy", "standard"),
    "warm": (*KODAMA, "--accuracy", "standard"),
    "first draft": (*KODAMA, "--accuracy", "draft"),
    "draft": (*KODAMA, "--accuracy", "draft"),
}
SMALL = {
    "draft": ("optimize", "motori-1", "--quiet", "--accuracy", "draft", "--speeds", "nominal", "--gradient", "none")
}
OLDER_TREE = "CAMOPT_OLDER_TREE"
OLDER = ("warm", "draft")
"""The cases that an older tree runs too, after one that fills its caches."""
TARGETS = {
    "cold": {"clock_s": 180.0, "peak_memory_MB": 1000.0},
    "warm": {"processor_s": 100.0, "peak_memory_MB": 1000.0},
    "draft": {"processor_s": 20.0, "peak_memory_MB": 1000.0},
}
"""What each case may take at most; the clock counts on two idle cores."""


def arithmetic_loop() -> float:
    """Processor time of a fixed loop [s]."""
    begun, total = time.process_time(), 0.0
    for i in range(LOOP):
        total += i * 0.5
    assert total > 0
    return time.process_time() - begun


def job(words: tuple[str, ...], out: Path, environment: dict[str, str], tree: str | None = None) -> dict:
    """One job in a process of its own, of another tree where one is named: what it cost, and what it came to."""
    environment = environment | ({"PYTHONPATH": tree} if tree else {})
    loop, begun = arithmetic_loop(), time.perf_counter()
    command = [sys.executable, "-m", "camopt", *words, "--out", str(out)]
    with open(os.devnull, "wb") as nowhere:
        process = subprocess.Popen(command, env=os.environ | environment, stdout=nowhere, cwd=tree)
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    clock = time.perf_counter() - begun
    provenance = json.loads((out / "provenance.json").read_text(encoding="utf-8"))
    design = json.loads((out / "design.json").read_text(encoding="utf-8"))
    kib = 1 if sys.platform == "darwin" else 1024
    return {
        "exit_code": process.returncode,
        "area_ratio": design["area_ratio"],
        "clock_s": clock,
        "processor_s": used.ru_utime + used.ru_stime,
        "peak_memory_MB": used.ru_maxrss * kib / 1000**2,
        "loop_s": loop,
        "stages": provenance["stages"],
        "cams_judged": provenance["cams_judged"],
    }


def within(name: str, row: dict) -> dict[str, bool]:
    """By figure, whether a case keeps its target; nothing of a case that has none."""
    return {key: row[key] <= most for key, most in TARGETS.get(name, {}).items()}


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Runs and prints every case, and writes job_time.json into `folder`."""
    rows = {}
    with tempfile.TemporaryDirectory() as held:
        caches = {} if size == "small" else {name: str(Path(held, part)) for name, part in CACHES.items()}
        for name, words in (SMALL if size == "small" else CASES).items():
            rows[name] = job(words, Path(held, f"run-{name}"), caches)
            rows[name]["within_target"] = within(name, rows[name])
            print(name, rows[name], flush=True)
        older = older_jobs(Path(held), caches) if size == "full" and OLDER_TREE in os.environ else {}
    content = {"targets": TARGETS, "cases": rows}
    content |= {"older": older, "ratios": ratios(rows, older)} if older else {}
    return write_result("job_time", size, content, {}, folder)


def older_jobs(held: Path, caches: dict[str, str]) -> dict[str, dict]:
    """What the older tree's jobs take, from caches of their own."""
    tree, found = os.environ[OLDER_TREE], {}
    caches = {name: f"{path}-older" for name, path in caches.items()}
    for number, name in enumerate((OLDER[0], *OLDER)):  # the first one compiles
        found[name] = job(CASES[name], held / f"older-{number}", caches, tree)
        print("older,", name, found[name], flush=True)
    return found


def ratios(rows: dict[str, dict], older: dict[str, dict]) -> dict[str, dict[str, float]]:
    """By case what it takes over what the older tree takes."""
    keys = ("processor_s", "peak_memory_MB", "area_ratio")
    return {name: {key: rows[name][key] / older[name][key] for key in keys} for name in older}


if __name__ == "__main__":
    run_script(main, __doc__)
