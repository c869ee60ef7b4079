"""The first run of an installation: the job's programs are compiled in separate processes, side by side.

numba compiles one function at a time in a process, and the memory that compilation takes is not released there. The job
loads the programs from the cache folder; those that are missing are compiled on demand.
"""

import os
import subprocess
import sys
from collections.abc import Callable

from camopt.programs import kept

SAYING = "compiles its programs, once for an installation: this takes some minutes"
"""Message of a command before it compiles."""
LLVM_LEVEL = {"NUMBA_OPT": "2"}
"""LLVM's optimisation level there. At 3, numba's own level, a program takes a fifth longer to compile and runs no
faster; the digits are the same."""


def programs_missing() -> bool:
    """Whether this version's programs of the exact motion are not compiled yet, and can be stored."""
    return kept("exact") is False


def compile_programs() -> None:
    """Compiles all programs that a job calls. Returns when they are done; ends all processes if it is interrupted."""
    command, quiet = [sys.executable, "-m", __name__], dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    running = [subprocess.Popen([*command, name], env=LLVM_LEVEL | os.environ, **quiet) for name in PARTS]
    try:
        for process in running:
            process.wait()
    finally:
        for process in running:
            process.kill()
            process.wait()


def settled_programs() -> None:
    """Compiles what the search's judge and the sweeps call: a motion, and a settled one with its metrics."""
    from camopt.exact import prepare
    from camopt.exact.affine.lines import rest_of
    from camopt.exact.settled import settled_metrics

    train, lift, cam_speed = _motion()
    prepare(train, lift, cam_speed).advance(rest_of(train))
    settled_metrics([train], [lift], [cam_speed], workers=1)


def verdict_programs() -> None:
    """Compiles what a verdict calls: a revolution by each of its methods; the other process compiles event-exact."""
    from camopt.scene.rest import state_at_rest
    from camopt.verifier import STANDARD
    from camopt.verifier.accuracy import EFFORTS
    from camopt.verifier.convergence import FEWEST_STEPS
    from camopt.verifier.verdict import method_named

    train, lift, cam_speed = _motion()
    for method in (name for name in EFFORTS[STANDARD].methods if name != "event"):
        method_named(method)(train, lift, cam_speed, FEWEST_STEPS)(state_at_rest(train))


PARTS: dict[str, Callable[[], None]] = {"settled": settled_programs, "verdict": verdict_programs}
"""Functions by name, each for a process of its own."""


def _motion() -> tuple:
    """A train, a cam and a cam speed [rad/s]; a program does not depend on the scene."""
    from camopt.cam.families.polydyne import polydyne
    from camopt.scene.load import load_scene
    from camopt.scene.train import build_train

    scene = load_scene("motori-1")
    return build_train(scene), polydyne(scene), scene.cam_speed(scene.required_operation.speeds_rpm[0])


if __name__ == "__main__":
    PARTS[sys.argv[1]]()
