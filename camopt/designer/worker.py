"""Processes for computations that take seconds and must not delay the designer's answers: slow parts and verdicts."""

import os
import signal
import time
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from threading import Lock, Thread
from typing import Any

from camopt.cam.lift import Lift
from camopt.designer.cams import Cancelled
from camopt.scene import InputError, Scene
from camopt.storage import plain
from camopt.verifier import DRAFT, STANDARD

NICENESS = 15
"""Niceness of a worker, so that interactive answers get the processor first."""
STAGES = {DRAFT: "a draft verdict by two methods", STANDARD: "the full verdict by all methods"}
"""Stages of a verdict by their accuracy, a quick preliminary one and the final one, with the page's words for them."""


class SlowProcess:
    """One process with this niceness, started at the first request; it computes one request at a time."""

    def __init__(self, niceness: int = NICENESS) -> None:
        self._niceness = niceness
        self._computing, self._starting = Lock(), Lock()
        self._process: SpawnProcess | None = None
        self._connection: Connection | None = None

    def compute(self, part: str, scene: Scene, lift: Lift | None) -> dict[str, Any]:
        """One part of the answer, as JSON; other callers wait meanwhile. Raises the InputError of the part, and
        Cancelled where the process is stopped."""
        with self._computing:
            connection = self.start()
            try:
                connection.send((part, scene, lift))
                outcome, content = connection.recv()
            except (EOFError, OSError):
                raise Cancelled(f"{part}: stopped before it was done") from None
        if outcome == "refused":
            raise InputError(content)
        if outcome == "failed":
            raise RuntimeError(content)
        return content

    def stop(self) -> None:
        """End the process; a pending request raises Cancelled."""
        with self._starting:
            process, self._process = self._process, None
            if process is not None:
                process.kill()
                process.join()
                process.close()

    def start(self) -> Connection:
        """Start the process, if it is not alive, and return the connection to it."""
        with self._starting:
            if self._process is None or not self._process.is_alive():
                context = get_context("spawn")
                self._connection, theirs = context.Pipe()
                self._process = context.Process(target=answer_requests, args=(theirs, self._niceness), daemon=True)
                self._process.start()
                theirs.close()
            assert self._connection is not None, "made with the process"
            return self._connection


def answer_requests(connection: Connection, niceness: int) -> None:
    """Main function of the process: answers requests until the connection closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the designer's own process handles the keyboard interrupt
    os.nice(niceness)
    from threadpoolctl import threadpool_limits

    from camopt.designer.slow_parts import PARTS, verdict_at

    answers = PARTS | {accuracy: partial(verdict_at, accuracy=accuracy) for accuracy in STAGES}
    threadpool_limits(limits=1, user_api="blas")  # small matrices, and the interactive answers need the cores
    while True:
        try:
            part, scene, lift = connection.recv()
        except (EOFError, OSError):
            return
        try:
            outcome, content = "done", plain(answers[part](scene, lift))
        except InputError as error:
            outcome, content = "refused", str(error)
        except Exception as error:  # a defect must not end the process; the page reports it
            outcome, content = "failed", f"{type(error).__name__}: {error}"
        try:
            connection.send((outcome, content))
        except OSError:
            return


class Verification:
    """The verdict of one designer: none, running, or ended; `subject` identifies the numbers that are verified."""

    def __init__(self) -> None:
        self.worker = SlowProcess(niceness=0)  # the user waits for it
        self._lock, self._begun, self._number = Lock(), 0.0, 0
        self._state: dict[str, Any] = {"state": "none"}

    def start(self, scene: Scene, lift: Lift, subject: str) -> dict[str, Any]:
        """Begin a verdict, after stopping one that is running."""
        self.cancel()
        with self._lock:
            self._number += 1
            self._begun = time.monotonic()
            self._state = {"state": "running", "subject": subject, "stages": len(STAGES)}
            number = self._number
        Thread(target=self._run, args=(number, scene, lift), daemon=True).start()
        return self.state()

    def cancel(self) -> dict[str, Any]:
        """Stop the verdict that is running."""
        with self._lock:
            running = self._state["state"] == "running"
            if running:
                self._number += 1
                self._state = {**self._state, "state": "cancelled"}
        if running:
            self.worker.stop()
        return self.state()

    def state(self) -> dict[str, Any]:
        """The present state: "state" (none, running, cancelled, done, failed), "stage" with its words `says`,
        "seconds", and "verdict", "broken" and "reason" of the last completed stage."""
        with self._lock:
            running = self._state["state"] == "running"
            return self._state | ({"seconds": time.monotonic() - self._begun} if running else {})

    def verified(self, subject: str) -> dict[str, Any] | None:
        """verification.json of a subject whose full verdict is complete, else None."""
        with self._lock:
            done = self._state["state"] == "done" and self._state["subject"] == subject
            return self._state["verification"] if done else None

    def _run(self, number: int, scene: Scene, lift: Lift) -> None:
        for stage, (part, words) in enumerate(STAGES.items(), 1):
            if not self._update(number, stage=stage, says=words):
                return
            try:
                answer = self.worker.compute(part, scene, lift)
            except Cancelled:
                self._update(number, state="cancelled")
                return
            except Exception as error:  # an InputError's sentence, or a defect of camopt
                self._update(number, state="failed", says=str(error))
                return
            record = answer["verification"]
            self._update(number, verdict=record["verdict"], broken=record["broken"], reason=answer["reason"])
        self._update(number, state="done", seconds=time.monotonic() - self._begun, verification=record)

    def _update(self, number: int, **more: Any) -> bool:
        """Add to the state of that verdict; returns False where a newer one has replaced it."""
        with self._lock:
            if number == self._number:
                self._state = {**self._state, **more}
            return number == self._number
