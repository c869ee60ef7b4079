"""Programs that a job needs late, compiled by a process of its own while the search compiles those that it needs first.

numba compiles one function at a time in a process. On a new installation the exact gradients and the verdict's methods
would wait for that after the search; a second process leaves them in the cache folder where the job finds them.
"""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from camopt.programs import kept


@contextmanager
def compiling_ahead() -> Iterator[None]:
    """Compiles beside what runs inside, where the exact motion has no programs yet; ends with it at the latest."""
    if kept("exact") is not False:
        yield
        return
    nothing = subprocess.DEVNULL
    other = subprocess.Popen([sys.executable, "-m", __name__], stdin=nothing, stdout=nothing, stderr=nothing)
    try:
        yield
    finally:
        other.kill()
        other.wait()


def compile_late_programs() -> None:
    """One motion with its gradients, then a revolution by each method of a verdict at accuracy standard."""
    from camopt.cam.families.polydyne import polydyne
    from camopt.exact.batch import value_and_gradient_many
    from camopt.measure.limits import limited_metrics
    from camopt.scene.load import load_scene
    from camopt.scene.rest import state_at_rest
    from camopt.scene.train import build_train
    from camopt.verifier.accuracy import EFFORTS
    from camopt.verifier.convergence import FEWEST_STEPS
    from camopt.verifier.verdict import method_named

    scene = load_scene("motori-1")
    assert scene.operation is not None, "motori-1 has speeds"
    train, lift, cam_speed = build_train(scene), polydyne(scene), scene.cam_speed(scene.operation.speeds_rpm[0])
    rest = state_at_rest(train)
    value_and_gradient_many(train, [lift], [cam_speed], limited_metrics(scene.design), np.array([rest]), workers=1)
    for method in EFFORTS["standard"].methods:
        method_named(method)(train, lift, cam_speed, FEWEST_STEPS)(rest)


if __name__ == "__main__":
    compile_late_programs()
