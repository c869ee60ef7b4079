"""Local worker processes: one pool of the standard library for each, so that a death is one worker's and one task's.

A pool of several processes breaks as a whole when one of them dies, and does not tell which task it was. Here each
worker has a pool of its own and computes its tasks in the order in which they were sent: the first one that has no
result is the one that it died of. Only that one is blamed; it and those behind it are sent again to a new process.
"""

import multiprocessing
import os
import signal
import threading
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from queue import SimpleQueue

from camopt.scene.errors import InputError
from camopt.tasks.compute import Outcome, compute_at_worker
from camopt.tasks.engines import AHEAD, MOST_DEATHS, Ended, cannot_go_on, deadly, every
from camopt.tasks.task import FiledTask

MOST_FALSE_STARTS = 8
"""Processes of one worker in a row that may end before they have begun: more than whoever kills workers will hit."""


@dataclass(eq=False)
class Sent:
    """A task that a worker was sent, with its number in the plan; `taken` unless the process was dead already."""

    number: int
    task: FiledTask
    deaths: int = 0
    taken: bool = False
    future: Future[Outcome] = field(default_factory=Future)

    def has_result(self) -> bool:
        """Whether an outcome has come back."""
        return self.future.done() and not self.future.cancelled() and self.future.exception() is None


Event = tuple["Worker", Sent, Future]
"""A future of a task that a worker was sent has ended."""


class Worker:
    """A process and the tasks that it was sent, in order; `events` gets an event for each that ended."""

    def __init__(self, events: SimpleQueue[Event], version: str):
        self._events, self._version, self._false_starts = events, version, 0
        self.sent: list[Sent] = []
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(1, mp_context=context, initializer=_begin)
        self._process = self._pool.submit(os.getpid)

    def send(self, one: Sent) -> None:
        """Sends a task."""
        self.sent.append(one)
        self._submit(one)

    def _submit(self, one: Sent) -> None:
        try:
            future, one.taken = self._pool.submit(compute_at_worker, one.task, self._version), True
        except BrokenProcessPool as error:
            future, one.taken = Future(), False
            future.set_exception(error)
        one.future = future
        future.add_done_callback(lambda done: self._events.put((self, one, done)))

    def revive(self) -> Sent | None:
        """A new process for a dead one, which is sent what that had not done; the task to be given up, if any."""
        began = self._process.done() and self._process.exception() is None
        self._false_starts = 0 if began else self._false_starts + 1
        if self._false_starts == MOST_FALSE_STARTS:
            raise InputError(
                "sweep: worker processes end before they begin; a script that sweeps needs `if __name__ == "
                '"__main__":` around what it does, because every worker reads it too (or give workers=0)'
            )
        waiting = [one for one in self.sent if not one.has_result()]
        blamed, given_up = waiting[0], None
        if began and blamed.taken:
            blamed.deaths += 1
            if blamed.deaths == MOST_DEATHS:
                given_up = waiting.pop(0)
                self.sent.remove(given_up)
        self._pool.shutdown(wait=False)
        self._start()
        for one in waiting:
            self._submit(one)
        return given_up

    def stop(self, at_once: bool) -> None:
        """Ends the process, `at_once` in the middle of a task."""
        if at_once and self._process.done() and self._process.exception() is None:
            for child in multiprocessing.active_children():
                if child.pid == self._process.result():
                    child.kill()
        self._pool.shutdown(wait=not at_once, cancel_futures=True)


class LocalProcesses:
    """So many worker processes on this machine."""

    def __init__(self, workers: int, version: str):
        self._events: SimpleQueue[Event] = SimpleQueue()
        self._workers = [Worker(self._events, version) for _ in range(workers)]

    def __enter__(self) -> "LocalProcesses":
        return self

    def __exit__(self, kind, *exception) -> None:
        for worker in self._workers:
            worker.stop(at_once=kind is not None)

    def has_room(self) -> bool:
        """Whether another task may be sent."""
        return any(len(worker.sent) < AHEAD for worker in self._workers)

    def send(self, number: int, task: FiledTask) -> None:
        """Sends a task to the worker that has the fewest."""
        min(self._workers, key=lambda worker: len(worker.sent)).send(Sent(number, task))

    def ended(self) -> list[Ended]:
        """The tasks that ended since it was last asked, one at least."""
        found: list[Ended] = []
        while not found:
            for worker, one, future in every(self._events):
                if one not in worker.sent or one.future is not future:
                    continue  # of a process that died before: it was sent again, or given up
                if one.has_result():
                    worker.sent.remove(one)
                    found.append((one.number, one.task, future.result()))
                elif isinstance(future.exception(), BrokenProcessPool):
                    given_up = worker.revive()
                    found += [] if given_up is None else [(given_up.number, given_up.task, deadly())]
                else:
                    raise cannot_go_on(future.exception())
        return found


def _begin() -> None:
    """Of every worker process: an interrupt from the keyboard is the parent's business, whose death ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None, "a worker is a child"
    parent.join()
    os._exit(1)
