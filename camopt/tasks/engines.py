"""What computes tasks: this process, any executor of `concurrent.futures`, or (`camopt.tasks.workers`) local processes.

An engine takes tasks while it has room and gives back those that ended, in any order. None of them writes anything.
"""

from concurrent.futures import CancelledError, Executor, Future
from contextlib import AbstractContextManager
from queue import SimpleQueue
from typing import Protocol, TypeVar

from camopt.scene.errors import InputError
from camopt.tasks.compute import OtherVersion, Outcome, compute, compute_at_worker, failed
from camopt.tasks.task import FiledTask

AHEAD = 4
"""Tasks in flight for each worker at most: enough that none waits for the next, and a plan of any length fits."""
MOST_DEATHS = 3
"""Workers that may die of a task before it is given up."""
T = TypeVar("T")
Ended = tuple[int, FiledTask, Outcome]
"""A task that ended, with its number in the plan."""


class Engine(AbstractContextManager, Protocol):
    """Something that computes tasks; `with engine:` lets go of whatever it holds, at once after an exception."""

    def has_room(self) -> bool:
        """Whether another task may be sent."""
        ...

    def send(self, number: int, task: FiledTask) -> None:
        """Takes a task with its number in the plan."""
        ...

    def ended(self) -> list[Ended]:
        """The tasks that ended since it was last asked, one at least: it waits for it."""
        ...


def deadly() -> Outcome:
    """The outcome of a task of which workers die."""
    return failed(f"{MOST_DEATHS} workers that computed it died (killed by a signal, or out of memory)")


def every(queue: "SimpleQueue[T]") -> list[T]:
    """All that a queue holds, one thing at least: it waits for that."""
    found = [queue.get()]
    while not queue.empty():
        found.append(queue.get())
    return found


class ThisProcess:
    """The tasks one by one, here."""

    def __init__(self) -> None:
        self._ended: list[Ended] = []

    def __enter__(self) -> "ThisProcess":
        return self

    def __exit__(self, *exception) -> None:
        pass

    def has_room(self) -> bool:
        return not self._ended

    def send(self, number: int, task: FiledTask) -> None:
        self._ended.append((number, task, compute(task)))

    def ended(self) -> list[Ended]:
        found, self._ended = self._ended, []
        return found


class AnyExecutor:
    """An executor of somebody else's, who also ends it; it computes `workers` tasks at once."""

    def __init__(self, executor: Executor, workers: int, version: str):
        self._executor, self._most, self._version = executor, AHEAD * workers, version
        self._flying: dict[Future, tuple[int, FiledTask]] = {}
        self._done: SimpleQueue[Future] = SimpleQueue()

    def __enter__(self) -> "AnyExecutor":
        return self

    def __exit__(self, *exception) -> None:
        for future in self._flying:
            future.cancel()

    def has_room(self) -> bool:
        return len(self._flying) < self._most

    def send(self, number: int, task: FiledTask) -> None:
        try:
            future = self._executor.submit(compute_at_worker, task, self._version)
        except Exception as error:
            raise cannot_go_on(error) from error
        self._flying[future] = number, task
        future.add_done_callback(self._done.put)

    def ended(self) -> list[Ended]:
        return [(*self._flying.pop(future), self._outcome(future)) for future in every(self._done)]

    def _outcome(self, future: Future) -> Outcome:
        try:
            return future.result()
        except (Exception, CancelledError) as error:
            if type(error).__name__ == "KilledWorker":  # dask's word for a task of which its workers died
                return deadly()
            raise cannot_go_on(error) from error


def cannot_go_on(error: BaseException | None) -> InputError:
    """The sentence for an executor that cannot go on."""
    if isinstance(error, OtherVersion):
        return InputError(f"sweep: {error}; nothing of it was recorded: install one version everywhere")
    return InputError(
        f"sweep: the executor does not go on ({type(error).__name__}: {error}); what ended is recorded: sweep again "
        f"with the same store and another executor"
    )
