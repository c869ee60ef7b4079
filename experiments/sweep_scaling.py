"""What does a sweep cost in addition to its tasks, how do tasks per second grow with workers, and does memory stay
constant?

The tasks are empty tasks, and settled motions of `motori-1` at random speeds of its band, computed by one and two
processes and, at full size and where dask is installed, by a cluster of two workers on the loopback interface. The
times are those between two requests for a task once every worker runs, so that the start, which is reported separately,
is not included. Then a large number of empty tasks is computed: measured are the memory of the parent after a tenth of
them and at the end, and the size of the store. On a shared machine the times by the clock are upper bounds; the
processor time of the parent is reported too.
"""

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import camopt
from camopt.scene import load_scene
from camopt.tasks.engines import cluster
from experiments.support.record import RESULTS, resident_MB, run_script, write_result

EMPTY = {"small": (200, 1000), "full": (1000, 10_000)}
SETTLED = {"small": (24, 72), "full": (200, 2000)}
"""(first task that is timed, number of tasks)."""
MANY = {"small": (20_000, 0), "full": (1_000_000, 2)}
"""(number of tasks, processes that compute them; 0: the parent itself)."""
EARLY = 0.1
"""Share of the tasks after which memory is first measured."""


@contextmanager
def engines(size: str) -> Iterator[dict[str, dict]]:
    """The arguments of `camopt.sweep` by the name of the workers."""
    local = {"one process": {"workers": 1}, "two processes": {"workers": 2}}
    if size == "small" or find_spec("distributed") is None:
        yield local
        return
    from distributed import LocalCluster

    with LocalCluster(2, processes=True, threads_per_worker=1, dashboard_address=None, silence_logs=50) as scheduler:
        with cluster(scheduler.scheduler_address) as (executor, workers):
            yield {**local, "cluster of two": {"executor": executor, "workers": workers}}


def empty(count: int) -> Iterator[dict]:
    """Empty tasks."""
    return ({"verb": "rehearse", "number": i} for i in range(count))


def settled(count: int) -> Iterator[dict]:
    """Tasks that compute settled motions at random speeds."""
    band = load_scene("motori-1").required_operation.band_rpm
    speeds = np.random.default_rng(0).uniform(*band, count).tolist()
    return ({"verb": "settled", "scene": "motori-1", "cam": "polydyne", "speed_rpm": speed} for speed in speeds)


def timed(tasks: Iterator[dict], start: int, how: dict, store: Path) -> dict[str, float]:
    """Times per task from task `start` on, and the seconds until then."""
    seen = []

    def watched() -> Iterator[dict]:
        for i, task in enumerate(tasks):
            if i >= start:
                seen.append((time.perf_counter(), time.process_time()))
            yield task

    begin = time.perf_counter()
    camopt.sweep(watched(), store, **how)
    (first, processor_first), (last, processor_last), more = seen[0], seen[-1], len(seen) - 1
    return {
        "ms_per_task": 1e3 * (last - first) / more,
        "parent_ms_per_task": 1e3 * (processor_last - processor_first) / more,
        "tasks_per_second": more / (last - first),
        "first_seconds": first - begin,
    }


def memory(count: int, workers: int, folder: Path) -> dict[str, float]:
    """The parent's memory early and late in a sweep of many empty tasks, and the size of a row."""
    seen = {}

    def watched() -> Iterator[dict]:
        for i, task in enumerate(empty(count)):
            if i in (int(EARLY * count), count - 1):
                seen[i] = resident_MB()
            yield task

    begin = time.perf_counter()
    swept = camopt.sweep(watched(), folder / "many.sqlite", workers=workers)
    early, late = seen.values()
    assert swept.counts == {"done": count}
    return {
        "tasks": count,
        "early_MB": early,
        "late_MB": late,
        "bytes_per_row": (folder / "many.sqlite").stat().st_size / count,
        "seconds": time.perf_counter() - begin,
    }


def main(size: str, folder=RESULTS) -> dict:
    """Measures, prints and writes `sweep_scaling.json`."""
    content: dict = {"empty": {}, "settled": {}}
    with engines(size) as every, tempfile.TemporaryDirectory() as place:
        for name, how in every.items():
            for kind, tasks, (start, count) in (("empty", empty, EMPTY[size]), ("settled", settled, SETTLED[size])):
                row = timed(tasks(count), start, how, Path(place) / f"{kind} {name}")
                content[kind][name] = row
                print(kind, name, row)
    rates = {name: row["tasks_per_second"] for name, row in content["settled"].items()}
    content["speedup"] = {name: rate / rates["one process"] for name, rate in rates.items()}
    with tempfile.TemporaryDirectory() as place:
        content["many"] = memory(*MANY[size], Path(place))
    return write_result("sweep_scaling", size, content, {}, folder)


if __name__ == "__main__":
    run_script(main, __doc__)
