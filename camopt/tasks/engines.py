"""Executors of `concurrent.futures`: local worker processes, and a cluster by `dask.distributed`, the extra `cluster`;
and the outcome of a task from the future of any one.

A pool of several processes breaks as a whole when one of them dies, and does not tell which task it was. So each thread
of `LocalProcesses` has a pool of one process, to which it gives one task at a time: a death is one task's.
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
"""Workers that may die of a task before it is given up."""
MOST_FALSE_STARTS = 8
"""Processes of one worker in a row that may end before they have begun."""


class LocalProcesses(ThreadPoolExecutor):
    """So many worker processes on this machine, each begun when a task first needs it. A task whose process dies is
    computed again by a new one, at most `MOST_DEATHS` times. An exception inside `with` kills the processes."""

    def __init__(self, workers: int):
        if getattr(multiprocessing.current_process(), "_inheriting", False):
            raise SystemExit(1)  # a worker that reads the script which sweeps: `_begun` says why none begins
        super().__init__(workers)
        self._own, self._pids, self._stopped = threading.local(), set[int](), False

    def submit(self, fn: Callable, /, *args, **kwargs) -> Future:
        """The outcome to be of a function, which a process computes."""
        return super().submit(self._computed, fn, *args, **kwargs)

    def __exit__(self, kind, *exception) -> None:
        self._stopped = kind is not None
        self.shutdown(wait=not self._stopped, cancel_futures=True)
        for child in multiprocessing.active_children():
            if child.pid in self._pids:
                child.kill()

    def _computed(self, fn: Callable, *args, **kwargs) -> Outcome:
        for _ in range(MOST_DEATHS):
            with suppress(BrokenProcessPool):
                return self._sent(fn, *args, **kwargs).result()
        return given_up()

    def _sent(self, fn: Callable, *args, **kwargs) -> Future:
        """The future of a task that a living process has; a process that died before it is replaced."""
        while True:
            if not hasattr(self._own, "pool"):
                self._own.pool = self._begun()
            if self._stopped:
                raise CancelledError
            try:
                return self._own.pool.submit(fn, *args, **kwargs)
            except BrokenProcessPool:
                del self._own.pool

    def _begun(self) -> ProcessPoolExecutor:
        """A process that has begun."""
        for _ in range(MOST_FALSE_STARTS):
            pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _begin)
            with suppress(BrokenProcessPool):
                self._pids.add(pool.submit(os.getpid).result())
                return pool
        raise InputError(
            "sweep: worker processes end before they begin; a script that sweeps needs `if __name__ == "
            '"__main__":` around what it does, because every worker reads it too (or give workers=0)'
        )


def _begin() -> None:
    """Initialises a worker process: it ignores an interrupt from the keyboard, and ends when its parent does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None, "a worker is a child"
    parent.join()
    os._exit(1)


def given_up() -> Outcome:
    """The outcome of a task whose worker process died at every attempt."""
    return failed(f"{MOST_DEATHS} workers that computed it died (killed by a signal, or out of memory)")


def outcome_of(future: Future[Outcome]) -> Outcome:
    """How a task ended that an executor has computed. Raises InputError where the executor cannot go on."""
    try:
        return future.result()
    except (Exception, CancelledError) as error:
        if type(error).__name__ == "KilledWorker":  # raised by dask for a task whose workers died
            return given_up()
        raise cannot_go_on(error) from error


def cannot_go_on(error: BaseException) -> InputError:
    """The sentence for an executor that cannot go on."""
    if isinstance(error, InputError):
        return error
    return InputError(
        f"sweep: the executor does not go on ({type(error).__name__}: {error}); what ended is recorded: sweep again "
        f"with the same store and another executor"
    )


WAIT_SECONDS = 20
"""How long a scheduler and its first worker are waited for."""
RETRIES = 2
"""How often dask computes a task again that raised, which only a fault of the cluster makes it do."""


@contextmanager
def cluster(address: str, insecure: bool = False) -> Iterator[tuple[Executor, int]]:
    """The executor of the scheduler at `address` ("tcp://HOST:PORT" or "tls://HOST:PORT") and its number of threads.

    Whoever reaches a scheduler without TLS can run any program on its workers and here. So an address beyond this
    machine needs tls://, with the certificates of dask's own configuration, or `insecure`. Raises InputError for an
    address that is none or needs TLS, where `distributed` is not installed, and where nobody answers.
    """
    check_address(address, insecure)
    if importlib.util.find_spec("distributed") is None:
        raise InputError("--scheduler: dask.distributed is not installed: pip install 'camopt[cluster]'")
    from distributed import Client  # pyright: ignore[reportMissingImports]

    try:
        client = Client(address, timeout=WAIT_SECONDS, set_as_default=False)
    except (OSError, TypeError, ValueError) as error:  # a TypeError where tls:// has no certificates
        raise InputError(f"--scheduler {address}: no scheduler answers ({error})") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=WAIT_SECONDS)
        except TimeoutError:
            raise InputError(
                f"--scheduler {address}: has no workers; start some with `dask worker {address}`"
            ) from None
        threads: dict[str, int] = dict(client.nthreads())  # type: ignore[arg-type]  # a synchronous client answers
        yield client.get_executor(pure=False, retries=RETRIES), sum(threads.values())


def check_address(address: str, insecure: bool) -> None:
    """Raises InputError for an address that is none, or that needs TLS and does not ask for it."""
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
