"""A verdict that is asked for in the page: it runs in a process of its own, tells how far it is, and can be stopped."""

import time
from dataclasses import dataclass, field
from threading import Lock, Thread
from typing import Any

from camopt.cam.lift import Lift
from camopt.designer.slow_parts import VERDICTS
from camopt.designer.worker import SlowProcess, Stopped
from camopt.scene.schema import Scene

STAGES = {
    "draft verdict": "a draft verdict by two methods",
    "verdict": "the full verdict by all methods",
}
assert STAGES.keys() == VERDICTS.keys()


@dataclass
class Verification:
    """The verdict of one designer: none, running, or ended; `subject` is what the page calls what is judged."""

    worker: SlowProcess = field(default_factory=lambda: SlowProcess(niceness=0))  # somebody waits for it
    _lock: Lock = field(default_factory=Lock)
    _state: dict[str, Any] = field(default_factory=lambda: {"state": "none"})
    _begun: float = 0.0
    _number: int = 0

    def start(self, scene: Scene, lift: Lift, subject: str) -> dict[str, Any]:
        """Begin a verdict; one that is running is stopped before."""
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
        """What there is to say now: "state" (none, running, cancelled, done, failed), "stage" with `says`, "seconds",
        and of a stage that has ended "verdict", "broken" and "reason"."""
        with self._lock:
            running = self._state["state"] == "running"
            return self._state | ({"seconds": time.monotonic() - self._begun} if running else {})

    def verified(self, subject: str) -> dict[str, Any] | None:
        """verification.json of a subject whose full verdict has ended, else None."""
        with self._lock:
            done = self._state["state"] == "done" and self._state["subject"] == subject
            return self._state["verification"] if done else None

    def _run(self, number: int, scene: Scene, lift: Lift) -> None:
        for stage, (part, words) in enumerate(STAGES.items(), 1):
            if not self._update(number, stage=stage, says=words):
                return
            try:
                found = self.worker.ask(part, scene, lift)
            except Stopped:
                self._update(number, state="cancelled")
                return
            except Exception as error:  # an InputError's sentence, or a defect of camopt
                self._update(number, state="failed", says=str(error))
                return
            record = found["verification"]
            self._update(number, verdict=record["verdict"], broken=record["broken"], reason=found["reason"])
        self._update(number, state="done", seconds=time.monotonic() - self._begun, verification=record)

    def _update(self, number: int, **more: Any) -> bool:
        """Adds to the state of that verdict; False where it is not the one that runs any more."""
        with self._lock:
            if number == self._number:
                self._state = {**self._state, **more}
            return number == self._number
