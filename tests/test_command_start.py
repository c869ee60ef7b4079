"""Start-up time of commands: help and input errors in a new process, without JAX."""

import subprocess
import sys

import pytest

ANSWERS = {
    "help": (0, ["--help"]),
    "help of a command": (0, ["verify", "--help"]),
    "scene that is not there": (2, ["verify", "none.toml", "--cam", "polydyne"]),
    "cam that is not there": (2, ["simulate", "kodama", "--cam", "none.csv", "--speed", "6000"]),
}
BUSIEST_S = 0.3
"""Limit on the processor time of a command that ends with help or an input error; JAX and numba are not loaded [s]."""
PAIRS = 5
"""Largest number of measurements, each paired with one of NumPy; one within the limit is sufficient."""
MEASURE = """
import resource, subprocess, sys
code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(code, used.ru_utime + used.ru_stime)
"""


def processor_time(*command: str) -> tuple[int, float]:
    """Exit code and processor time [s] of a run."""
    words = [sys.executable, "-c", MEASURE, *command]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=60)
    code, seconds = (float(word) for word in done.stdout.split())
    return int(code), seconds


def allowed() -> float:
    """Allowed processor time [s]: larger if starting Python with NumPy also takes longer at the moment."""
    return max(BUSIEST_S, 4 * processor_time(sys.executable, "-c", "import numpy")[1])


@pytest.mark.parametrize("answer", ANSWERS)
def test_a_command_starts_quickly(answer, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, words = ANSWERS[answer]
    pairs = []
    while not pairs or (pairs[-1][0] >= pairs[-1][1] and len(pairs) < PAIRS):
        exit_code, seconds = processor_time(sys.executable, "-m", "camopt", *words)
        assert exit_code == code
        pairs.append((seconds, allowed()))
    assert pairs[-1][0] < pairs[-1][1], pairs


def test_help_written_to_a_pipe_has_no_escape_codes():
    done = subprocess.run([sys.executable, "-m", "camopt", "--help"], capture_output=True, check=True, timeout=60)
    assert done.stdout and b"\x1b" not in done.stdout


FREED = """
import numpy as np

def resident_MB():
    with open("/proc/self/statm") as numbers:
        return int(numbers.read().split()[1]) * 4096 / 1e6

PREPARED
np.ones(3_000_000)  # freed at once, after which glibc keeps arrays of that size on its heap
before, pairs = resident_MB(), [(np.ones(1_000_000), np.ones(10_000)) for _ in range(40)]
kept = [small for _, small in pairs]
pairs.clear()
print(resident_MB() - before)
"""


PREPARED = {
    "a command": "from camopt.cli.parser import prepare_process; prepare_process()",
    "event-exact tables": "from camopt.exact.kernel.propagators import Propagators; "
    "from camopt.scene import build_train, load_scene; Propagators(build_train(load_scene('motori-1')), 1e-6, 8, 4)",
}


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have other allocators")
@pytest.mark.parametrize("process", PREPARED)
def test_the_memory_of_freed_arrays_is_returned_to_the_system(process):
    words = [sys.executable, "-c", FREED.replace("PREPARED", PREPARED[process])]
    kept = float(subprocess.run(words, capture_output=True, text=True, check=True, timeout=60).stdout)
    assert kept < 30.0  # of 323 MB, which a process without the preparation keeps
