"""`camopt.sweep`: many tasks, computed by processes or a cluster, with a row for each in a store that resumes."""

import os
from collections.abc import Iterable, Mapping, Sized
from concurrent.futures import Executor
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tqdm import tqdm

from camopt.scene.errors import InputError
from camopt.tasks.engines import AnyExecutor, Engine, ThisProcess
from camopt.tasks.store import TaskStore
from camopt.tasks.swept import SweptTasks
from camopt.tasks.task import filed
from camopt.tasks.workers import LocalProcesses

MOST_WORKERS = 1000


def sweep(
    tasks: Iterable[Mapping[str, Any]],
    store: str | Path,
    executor: Executor | None = None,
    workers: int | None = None,
    *,
    retry_failed: bool = False,
    progress: bool = False,
) -> SweptTasks:
    """Computes the tasks and keeps a row for each of them in the file `store`; returns all rows.

    A task is plain data (`camopt.tasks` says which); `tasks` may be a generator, of which a few are taken at a time, or
    a `camopt.tasks.plan.SweepPlan`. Rows that the store holds already are not computed again, so a sweep that was
    interrupted, or killed, goes on where it was; equal tasks have one row. A task that fails, or of which three
    workers died, has a row "failed" with the reason, and the sweep goes on; with `retry_failed` such rows of the store
    are computed once more.

    Tasks are computed by `workers` processes of this machine (one for each core where none are given, in this process
    where zero), or by any `executor` of `concurrent.futures` that computes `workers` tasks at once. What a row says
    does not depend on who computed it, in whatever order. With `progress` a bar shows how far it is.

    Raises InputError for what is no task, for a store of another version of camopt or of other tasks, and where workers
    cannot begin; what has ended by then is recorded.
    """
    made_by = version("camopt")
    with TaskStore(store, made_by, getattr(tasks, "digest", ""), retry_failed=retry_failed) as rows:
        total = len(tasks) if isinstance(tasks, Sized) else None
        if total is not None and rows.last_number() >= total:
            raise _other_plan(rows, total)
        with (
            _engine(executor, workers, made_by) as engine,
            tqdm(total=total, disable=None if progress else True) as bar,
        ):
            count = _run(tasks, rows, engine, bar, made_by)
        if rows.last_number() >= count:
            raise _other_plan(rows, count)
    return SweptTasks(Path(store))


def _run(tasks: Iterable[Mapping[str, Any]], rows: TaskStore, engine: Engine, bar: tqdm, made_by: str) -> int:
    """Sends what has no row and records what ended; how many tasks there were."""
    flying: set[str] = set()

    def collect() -> None:
        ended = engine.ended()
        rows.record(ended)
        flying.difference_update(task.key for _, task, _ in ended)
        bar.update(len(ended))

    number = -1
    for number, given in enumerate(tasks):
        task = filed(given, made_by, f"task {number}")
        if rows.holds(number, task.key) or task.key in flying:
            bar.update(1)
            continue
        while not engine.has_room():
            collect()
        engine.send(number, task)
        flying.add(task.key)
    while flying:
        collect()
    return number + 1


def _engine(executor: Executor | None, workers: int | None, made_by: str) -> Engine:
    if workers is not None and not 0 <= workers <= MOST_WORKERS:
        raise InputError(f"sweep: workers {workers}: expected a number from 0 to {MOST_WORKERS}")
    count = _cores() if workers is None else workers
    if executor is not None:
        return AnyExecutor(executor, workers or getattr(executor, "_max_workers", count), made_by)
    return LocalProcesses(count, made_by) if count else ThisProcess()


def _cores() -> int:
    """The cores that this process may use, where the system tells; else those of the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _other_plan(rows: TaskStore, count: int) -> InputError:
    return InputError(
        f"{rows.path}: has a row of task {rows.last_number()}, and these are {count} tasks: it belongs to other tasks; "
        f"name another store"
    )
