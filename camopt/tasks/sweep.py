"""`camopt.sweep`: many tasks, computed by processes or a cluster, with one row each in a store that resumes."""

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sized
from concurrent.futures import Executor, Future
from contextlib import nullcontext
from importlib.metadata import version
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import xarray as xr
from tqdm import tqdm

from camopt.scene.errors import InputError
from camopt.storage import write_csv_rows
from camopt.tasks.compute import FAILED, Outcome, compute, compute_at_worker
from camopt.tasks.engines import LocalProcesses, executor_error, outcome_of
from camopt.tasks.store import TaskStore
from camopt.tasks.task import PART, StoredTask, stored_task

MOST_WORKERS = 1000
AHEAD = 4
"""Most tasks in flight per worker: enough to keep it busy, and few enough for a plan of any length."""
FIRST = ("task", "state", "verb", "scene", "cam")
"""Columns that come first."""


class SweptTasks:
    """The rows of a store in the order of the plan, read from the file one at a time on each access."""

    def __init__(self, store: Path):
        self.store = store

    def _open(self) -> TaskStore:
        return TaskStore(self.store, version("camopt"))

    def rows(self) -> Iterator[dict[str, Any]]:
        """One dictionary per row: `task`, its number in the plan, `state`, the task's own keys, and its result, or the
        `reason` of its failure. A scene or cam without a name is given by its digest (see `part`). Raises InputError
        for a damaged row."""
        with self._open() as store:
            for number, text, state, outcome in store.read(
                "SELECT number, task, state, outcome FROM row ORDER BY number"
            ):
                try:
                    task = json.loads(text)
                    varied = {f"vary {name}": value for name, value in task.pop("vary", {}).items()}
                    arguments = task.pop("arguments", {})
                    yield {**arguments, "task": number, "state": state, **task, **varied, **json.loads(outcome)}
                except (ValueError, TypeError, AttributeError) as error:
                    raise InputError(
                        f"row {number} of the sweep's store is damaged ({error}): name another store"
                    ) from error

    def part(self, name: str) -> str:
        """The text of a scene or a cam that rows refer to by its digest."""
        with self._open() as store:
            return store.read("SELECT text FROM part WHERE name = ?", name).fetchone()[0]

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows by state ("done", "failed")."""
        with self._open() as store:
            return dict(store.read("SELECT state, count(*) FROM row GROUP BY state ORDER BY state"))

    def failed(self) -> list[dict[str, Any]]:
        """The rows of the failed tasks, with their reasons."""
        return [row for row in self.rows() if row["state"] == FAILED]

    def columns(self) -> list[str]:
        """The names that occur in the rows; those in FIRST come first."""
        names = dict.fromkeys(name for row in self.rows() for name in row)
        return [name for name in FIRST if name in names] + [name for name in names if name not in FIRST]

    def dataset(self) -> xr.Dataset:
        """The rows along the dimension `task`; a number missing in a row is NaN, a missing text is empty."""
        rows, names = list(self.rows()), self.columns()
        return xr.Dataset({name: ("task", _column([row.get(name) for row in rows])) for name in names})

    def write_csv(self, path: str | Path) -> None:
        """Writes the rows as a table; a missing value is an empty cell, lists are written as JSON."""
        names = self.columns()
        cells = ([_cell(row.get(name)) for name in names] for row in self.rows())
        write_csv_rows(path, names, cells)

    def lines(self) -> list[str]:
        """A line with the number of tasks by state."""
        counts = self.counts
        by_state = ", ".join(f"{count} {state}" for state, count in counts.items()) or "none"
        return [f"{sum(counts.values())} tasks: {by_state}"]

    def __repr__(self) -> str:
        return f"SweptTasks({self.store}, {'; '.join(self.lines())})"

    def _repr_html_(self) -> str:
        return "<br>".join(self.lines())


def _column(values: list) -> list:
    if all(isinstance(v, int | float) or v is None for v in values):
        return [float("nan") if v is None else v for v in values]
    return [_cell(v) if v is not None else "" for v in values]


def _cell(value: Any) -> Any:
    """A value as the content of a cell: lists as JSON, the digest of a long text shortened."""
    if isinstance(value, list | dict):
        return json.dumps(value)
    if isinstance(value, str) and value.startswith(PART):
        return value[: len(PART) + 12]
    return value


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

    A task is plain data (see `camopt.tasks`); `tasks` may be a generator, which is consumed gradually, or a
    `camopt.tasks.plan.SweepPlan`. Tasks whose rows are in the store are not computed again, so that a sweep that was
    interrupted or killed resumes; equal tasks share one row. A task that fails, or on which three workers died, has a
    row "failed" with the reason, and the sweep continues; with `retry_failed` the failed tasks of the store are
    computed once more.

    Tasks are computed by `workers` processes on this machine (default: one per core; zero: in this process), or by any
    `executor` of `concurrent.futures` that computes `workers` tasks at once. The content of a row does not depend on
    who computed it or in which order. With `progress` a progress bar is shown.

    Raises InputError for an invalid task, for a store of another version of camopt or of other tasks, and where workers
    cannot start; tasks that have ended by then are recorded.
    """
    if workers is not None and not 0 <= workers <= MOST_WORKERS:
        raise InputError(f"sweep: workers {workers}: expected a number from 0 to {MOST_WORKERS}")
    installed, total = version("camopt"), len(tasks) if isinstance(tasks, Sized) else None
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    count = cores if workers is None else workers
    with TaskStore(store, installed, getattr(tasks, "digest", ""), retry_failed=retry_failed) as rows:
        if total is not None:
            rows.check_count(total)
        if executor is not None:
            count, computing = workers or getattr(executor, "_max_workers", count), nullcontext(executor)
        else:
            computing = LocalProcesses(count) if count else nullcontext()
        with computing as engine, tqdm(total=total, disable=None if progress else True) as bar:
            task_count = _run(tasks, rows, engine, AHEAD * count, bar, installed)
        rows.check_count(task_count)
    return SweptTasks(Path(store))


def _run(
    tasks: Iterable[Mapping[str, Any]], rows: TaskStore, engine: Executor | None, most: int, bar: tqdm, installed: str
) -> int:
    """Computes the tasks without a row, at most `most` at a time, and records them; returns the number of all tasks."""
    running: dict[Future[Outcome], tuple[int, StoredTask]] = {}
    done: SimpleQueue[Future[Outcome]] = SimpleQueue()

    def record(finished: list[tuple[int, StoredTask, Outcome]]) -> None:
        rows.record(finished)
        bar.update(len(finished))

    def collect() -> None:
        futures = [done.get(), *(done.get() for _ in range(done.qsize()))]
        record([(*running.pop(future), outcome_of(future)) for future in futures])

    number = -1
    try:
        for number, data in enumerate(tasks):
            task = stored_task(data, installed, f"task {number}")
            if rows.holds(number, task.key) or any(task.key == pending.key for _, pending in running.values()):
                bar.update(1)
            elif engine is None:
                record([(number, task, compute(task))])
            else:
                while len(running) >= most:
                    collect()
                try:
                    future = engine.submit(compute_at_worker, task, installed)
                except Exception as error:
                    raise executor_error(error) from error
                running[future] = number, task
                future.add_done_callback(done.put)
        while running:
            collect()
    finally:
        for future in running:
            future.cancel()
    return number + 1
