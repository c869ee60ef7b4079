"""Executors of `concurrent.futures`: local worker processes, and a cluster by `dask.distributed` (the extra `cluster`);
and the outcome of a task from the future of either.

A pool of several processes breaks as a whole when one of them dies, and does not report whose task it was. Each thread
of `LocalProcesses` therefore has a pool of one process, which computes one task at a time.
"""

import importlib.util
import ipaddress
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit

from camopt.scene.errors import InputError
from camopt.scene.text_file import excerpt
from camopt.tasks.compute import Outcome, failed

MOST_DEATHS = 3
"""Number of worker deaths after which a task is given up."""
MOST_FALSE_STARTS = 8
"""Number of processes in a row that may end before they have started."""


class LocalProcesses(ThreadPoolExecutor):
    """The given number of worker processes on this machine, each started when a task first needs it. A task whose
    process dies is computed again, unless `MOST_DEATHS` have died. An exception inside `with` kills the processes."""

    def __init__(self, workers: int):
        if getattr(multiprocessing.current_process(), "_inheriting", False):
            raise SystemExit(1)  # this worker is importing the script that sweeps: see `_started_process`
        super().__init__(workers)
        self._local, self._pids, self._stopped = threading.local(), set[int](), False

    def submit(self, fn: Callable, /, *args, **kwargs) -> Future:
        """Submits a function that a worker process computes; the future's result is its outcome."""
        return super().submit(self._outcome, fn, *args, **kwargs)

    def __exit__(self, kind, *exception) -> None:
        self._stopped = kind is not None
        self.shutdown(wait=not self._stopped, cancel_futures=True)
        for child in multiprocessing.active_children():
            if child.pid in self._pids:
                child.kill()

    def _outcome(self, fn: Callable, *args, **kwargs) -> Outcome:
        for _ in range(MOST_DEATHS):
            with suppress(BrokenProcessPool):
                return self._submitted(fn, *args, **kwargs).result()
        return died_too_often()

    def _submitted(self, fn: Callable, *args, **kwargs) -> Future:
        """Submits a task to a living process; a process that has died is replaced first."""
        while True:
            if not hasattr(self._local, "pool"):
                self._local.pool = self._started_process()
            if self._stopped:
                raise CancelledError
            try:
                return self._local.pool.submit(fn, *args, **kwargs)
            except BrokenProcessPool:
                del self._local.pool

    def _started_process(self) -> ProcessPoolExecutor:
        """A pool of one process that has started."""
        for _ in range(MOST_FALSE_STARTS):
            pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _initialise)
            with suppress(BrokenProcessPool):
                self._pids.add(pool.submit(os.getpid).result())
                return pool
        raise InputError(
            "sweep: worker processes end before they start: a script that sweeps needs `if __name__ == "
            '"__main__":` around what it does, because every worker reads it too (or give workers=0)'
        )


def _initialise() -> None:
    """Initialises a worker process, which ignores keyboard interrupts and ends when its parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None, "a worker is a child"
    parent.join()
    os._exit(1)


def died_too_often() -> Outcome:
    """The outcome of a task whose worker process died at every attempt."""
    return failed(f"{MOST_DEATHS} workers that computed it died (killed by a signal, or out of memory)")


def outcome_of(future: Future[Outcome]) -> Outcome:
    """The outcome of a task that an executor has computed. Raises InputError where the executor cannot continue."""
    try:
        return future.result()
    except (Exception, CancelledError) as error:
        if type(error).__name__ == "KilledWorker":  # dask raises it for a task whose workers died
            return died_too_often()
        raise executor_error(error) from error


def executor_error(error: BaseException) -> InputError:
    """The error for an executor that cannot continue."""
    if isinstance(error, InputError):
        return error
    return InputError(
        f"sweep: the executor failed ({type(error).__name__}: {error}); finished tasks are recorded: run "
        f"the sweep again with the same store and another executor"
    )


WAIT_SECONDS = 20
"""Timeout [s] for a scheduler and for its first worker."""
RETRIES = 2
"""Number of times that dask repeats a task that raised, which only a fault of the cluster causes."""


@contextmanager
def cluster(address: str, insecure: bool = False) -> Iterator[tuple[Executor, int]]:
    """The executor of the scheduler at `address` ("tcp://HOST:PORT" or "tls://HOST:PORT") and its number of threads.

    Anyone who can reach a scheduler without TLS can run any program on its workers and on this machine. An address
    beyond this machine therefore needs tls://, with the certificates of dask's configuration, or `insecure`. Raises
    InputError for an address that is malformed or needs TLS, without `distributed`, and where no scheduler answers.
    """
    check_address(address, insecure)
    if importlib.util.find_spec("distributed") is None:
        raise InputError("--scheduler: dask.distributed is not installed: pip install 'camopt[cluster]'")
    from distributed import Client  # pyright: ignore[reportMissingImports]

    try:
        client = Client(address, timeout=WAIT_SECONDS, set_as_default=False)
    except (OSError, TypeError, ValueError) as error:  # TypeError: tls:// without certificates
        raise InputError(f"--scheduler {address}: no scheduler answers ({error})") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=WAIT_SECONDS)
        except TimeoutError:
            raise InputError(
                f"--scheduler {address}: has no workers; start some with `dask worker {address}`"
            ) from None
        threads: dict[str, int] = dict(client.nthreads())  # type: ignore[arg-type]  # the client is synchronous
        yield client.get_executor(pure=False, retries=RETRIES), sum(threads.values())


def check_address(address: str, insecure: bool) -> None:
    """Raises InputError for an address that is malformed, or that needs TLS and does not use it."""
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError:
        parts, host, port = urlsplit(""), None, None
    if parts.scheme not in ("tcp", "tls") or not host or port is None:
        raise InputError(f"--scheduler {excerpt(address)}: expected tcp://HOST:PORT or tls://HOST:PORT")
    if parts.scheme == "tcp" and not insecure and not _loopback(host):
        raise InputError(
            f"--scheduler {excerpt(address)}: beyond this machine a scheduler without TLS lets anybody run programs on "
            f"its workers: use tls:// with certificates, or add --insecure in a network that you trust"
        )


def _loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
