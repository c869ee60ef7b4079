"""The first run of an installation: the job's programs are compiled in processes of their own, side by side.

numba compiles one function at a time in a process, and what that leaves in memory stays there. The processes leave the
programs in the cache folder, from which the job takes them. What they do not finish, the job compiles itself.
"""

import os
import subprocess
import sys
from collections.abc import Callable

import numpy as np

from camopt.programs import kept

SAYING = "compiles its programs, once for an installation: this takes some minutes"
"""What a command says before it compiles."""
EFFORT = {"NUMBA_OPT": "2"}
"""How hard LLVM tries there. At 3, numba's own level, a program takes a fifth longer to compile and runs no faster; the
digits are the same."""


def programs_missing() -> bool:
    """Whether this version's programs of the exact motion have yet to be compiled, and can be kept."""
    return kept("exact") is False


def compile_programs() -> None:
    """Compiles all that a job calls; returns when it is done, and ends all processes where it is interrupted."""
    nothing = subprocess.DEVNULL
    words, environment = [sys.executable, "-m", __name__], EFFORT | os.environ
    running = [
        subprocess.Popen([*words, part], stdin=nothing, stdout=nothing, stderr=nothing, env=environment)
        for part in PARTS
    ]
    try:
        for process in running:
            process.wait()
    finally:
        for process in running:
            process.kill()
            process.wait()


def settled_programs() -> None:
    """What the search's judge and the sweeps call: a settled motion with its metrics."""
    from camopt.exact.settled import settled_metrics

    train, lift, cam_speed, _ = _motion()
    settled_metrics([train], [lift], [cam_speed], workers=1)


def gradient_programs() -> None:
    """What slopes of a yield and the verdict call: gradients, and a revolution by each method of a verdict."""
    from camopt.exact.batch import value_and_gradient_many
    from camopt.scene.rest import state_at_rest
    from camopt.verifier.accuracy import EFFORTS
    from camopt.verifier.convergence import FEWEST_STEPS
    from camopt.verifier.verdict import method_named

    train, lift, cam_speed, metrics = _motion()
    rest = state_at_rest(train)
    for method in EFFORTS["standard"].methods:  # first, so that the other process has the kernel's programs ready
        method_named(method)(train, lift, cam_speed, FEWEST_STEPS)(rest)
    value_and_gradient_many(train, [lift], [cam_speed], metrics, np.array([rest]), workers=1)


PARTS: dict[str, Callable[[], None]] = {"settled": settled_programs, "gradient": gradient_programs}
"""By name, what one process compiles."""


def _motion() -> tuple:
    """A train, a cam, a cam speed [rad/s] and the limited metrics: of which scene makes no difference to a program."""
    from camopt.cam.families.polydyne import polydyne
    from camopt.measure.limits import limited_metrics
    from camopt.scene.load import load_scene
    from camopt.scene.train import build_train

    scene = load_scene("motori-1")
    assert scene.operation is not None, "motori-1 has speeds"
    return (
        build_train(scene),
        polydyne(scene),
        scene.cam_speed(scene.operation.speeds_rpm[0]),
        limited_metrics(scene.design),
    )


if __name__ == "__main__":
    PARTS[sys.argv[1]]()
