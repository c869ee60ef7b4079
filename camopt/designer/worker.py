"""A process that computes slow parts while the designer goes on answering; it can be stopped in the middle of one."""

import os
import signal
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from threading import Lock
from typing import Any

from camopt.cam.lift import Lift
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.storage import plain

NICENESS = 15
"""The hand goes first: a worker takes what processor time the answers to it leave."""


class Stopped(Exception):
    """The process was stopped, or ended by itself, before it had answered."""


class SlowProcess:
    """One process, started when it is first asked; it answers one question at a time, at this niceness."""

    def __init__(self, niceness: int = NICENESS) -> None:
        self._niceness = niceness
        self._asking, self._starting = Lock(), Lock()
        self._process: SpawnProcess | None = None
        self._connection: Connection | None = None

    def ask(self, part: str, scene: Scene, lift: Lift | None) -> dict[str, Any]:
        """One part of the answer, as JSON knows it; whoever asks meanwhile waits. Raises InputError as the part does,
        and Stopped."""
        with self._asking:
            connection = self._started()
            try:
                connection.send((part, scene, lift))
                outcome, content = connection.recv()
            except (EOFError, OSError):
                raise Stopped(f"{part}: stopped before it was done") from None
        if outcome == "refused":
            raise InputError(content)
        if outcome == "failed":
            raise RuntimeError(content)
        return content

    def start(self) -> None:
        """Start the process now, so that the first question does not wait for it."""
        self._started()

    def stop(self) -> None:
        """End the process; what it was asked ends with Stopped."""
        with self._starting:
            process, self._process = self._process, None
            if process is not None:
                process.kill()
                process.join()
                process.close()

    def _started(self) -> Connection:
        with self._starting:
            if self._process is None or not self._process.is_alive():
                context = get_context("spawn")
                self._connection, theirs = context.Pipe()
                self._process = context.Process(target=answer_all, args=(theirs, self._niceness), daemon=True)
                self._process.start()
                theirs.close()
            assert self._connection is not None, "made with the process"
            return self._connection


def answer_all(connection: Connection, niceness: int) -> None:
    """The process: answers questions until nobody is there to ask any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the keyboard's interrupt is the designer's business
    os.nice(niceness)
    from threadpoolctl import threadpool_limits

    from camopt.designer.slow_parts import PARTS, VERDICTS

    threadpool_limits(limits=1, user_api="blas")  # small matrices, and cores that the hand needs
    while True:
        try:
            part, scene, lift = connection.recv()
        except (EOFError, OSError):
            return
        try:
            outcome, content = "done", plain((PARTS | VERDICTS)[part](scene, lift))
        except InputError as error:
            outcome, content = "refused", str(error)
        except Exception as error:  # a defect must not end the process, and the page says what it was
            outcome, content = "failed", f"{type(error).__name__}: {error}"
        try:
            connection.send((outcome, content))
        except OSError:
            return
