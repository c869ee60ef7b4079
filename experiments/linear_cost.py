"""Does a linear train cost more since camopt supports force tables, adjusters, friction and gas force?

Event-exact of this tree is compared with that of the last commit before such elements, each in its own processes that
run in turn: the end state of a revolution, a sampled revolution, and a gradient, on linear scenes. The older tree is
extracted from the history of the clone in which the experiment runs. The small size compares this tree with itself.
"""

import json
import os
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable
from functools import partial
from io import BytesIO
from pathlib import Path

from camopt.scene import InputError
from experiments.support.record import RESULTS, run_script, write_result

ROOT = Path(__file__).parents[1]
BEFORE = "b3ce9431"
"""The last commit before such elements."""
SCENES = {"kodama": 6000.0, "motori-1": 4000.0, "pushrod-5mass": 3000.0}
"""Crankshaft speeds [r/min]."""
ROUNDS, REPEATS = {"small": 1, "full": 5}, {"small": 3, "full": 400}
ALLOWED = 1.03


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Times of both trees in turn, and the ratios of the least ones."""
    least: dict[str, dict[str, float]] = {"before": {}, "now": {}}
    with tempfile.TemporaryDirectory() as held:
        trees = {"before": ROOT if size == "small" else older_tree(BEFORE, Path(held)), "now": ROOT}
        for _ in range(ROUNDS[size]):
            for name, tree in trees.items():
                for key, seconds in measured_in(tree, REPEATS[size]).items():
                    least[name][key] = min(seconds, least[name].get(key, seconds))
    ratios = {key: least["now"][key] / seconds for key, seconds in least["before"].items()}
    content = {
        "before": BEFORE,
        "rows": {key: {"before_us": 1e6 * least["before"][key], "ratio": ratio} for key, ratio in ratios.items()},
        "largest_ratio": max(ratios.values()),
        "allowed": ALLOWED,
    }
    return write_result("linear_cost", size, content, {}, folder)


def older_tree(commit: str, folder: Path) -> Path:
    """The package as a commit of this clone's history had it; raises InputError where the history lacks it."""
    try:
        packed = subprocess.run(
            ["git", "archive", commit, "camopt"],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            check=True,
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        raise InputError(f"linear_cost: commit {commit} is not in this history: run it in a whole clone") from None
    with tarfile.open(fileobj=BytesIO(packed)) as archive:
        archive.extractall(folder, filter="data")
    return folder


def measured_in(tree: Path, repeats: int) -> dict[str, float]:
    """The times [s] that `measure` prints with the package `camopt` of a tree."""
    environment = os.environ | {"PYTHONPATH": str(tree)}
    command = [sys.executable, "-c", f"import sys; sys.path.append({str(ROOT)!r}); {MEASURE.format(repeats)}"]
    done = subprocess.run(command, cwd=tree, env=environment, stdout=subprocess.PIPE, check=True, text=True)
    times = json.loads(done.stdout.splitlines()[-1])
    assert Path(times.pop("camopt")).is_relative_to(tree), "another camopt was measured"
    return times


MEASURE = "from experiments.linear_cost import measure; measure({})"


def measure(repeats: int) -> None:
    """Prints the mean of the fastest tenth of the calls [s of the thread], by scene and work, and where camopt lies."""
    import camopt
    from camopt.cam.families.polydyne import polydyne
    from camopt.exact.adjoint.motion import value_and_gradient
    from camopt.exact.engine import prepare
    from camopt.scene import build_train, load_scene
    from camopt.scene.rest import state_at_rest

    times: dict[str, float | str] = {"camopt": str(camopt.__file__)}
    for name, speed_rpm in SCENES.items():
        scene = load_scene(name)
        train, lift, speed = build_train(scene), polydyne(scene), scene.cam_speed(speed_rpm)
        revolve = prepare(train, lift, speed)
        state = revolve.advance(revolve.advance(state_at_rest(train)))
        work = {
            "end state": partial(revolve.advance, state),
            "sampled": partial(revolve, state),
            "gradient": partial(value_and_gradient, train, lift, speed, ["seating_velocity_m_per_s"], state),
        }
        times |= {f"{name}, {key}": fastest_tenth(run, repeats) for key, run in work.items()}
    print(json.dumps(times))


def fastest_tenth(run: Callable[[], object], repeats: int) -> float:
    """Mean processor time [s] of the fastest tenth of the calls, after two calls that fill caches."""
    seconds = []
    for _ in range(repeats + 2):
        begin = time.thread_time()
        run()
        seconds.append(time.thread_time() - begin)
    best = sorted(seconds[2:])[: max(1, repeats // 10)]
    return sum(best) / len(best)


if __name__ == "__main__":
    run_script(main, __doc__)
