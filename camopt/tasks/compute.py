"""Computation of one task in any process; the result is the task's state and its outcome as text.

A task that cannot be computed ends as "failed" with the error sentence. BLAS is limited to one thread, and only data
that are the same in every process are cached between tasks, so that a row does not depend on who computed it.
"""

import json
import os
import signal
import time
from functools import cache, partial
from hashlib import sha256
from importlib import import_module
from importlib.metadata import version
from multiprocessing import parent_process
from typing import NamedTuple

from threadpoolctl import ThreadpoolController

from camopt.scene.errors import InputError
from camopt.storage import plain
from camopt.tasks.task import CallTask, RehearseTask, StoredTask, Task, function_at

DONE, FAILED = "done", "failed"
SCENE_VERBS = "camopt.study.task_verbs"
"""Module of the verbs that need a scene: the only module above this layer, named here and imported on use."""
LONGEST_REASON = 600


class Outcome(NamedTuple):
    """How a task ended: its `state`, and as JSON text its result or the reason of its failure."""

    state: str
    text: str


def failed(reason: str) -> Outcome:
    """The outcome of a task that failed for the given reason."""
    return Outcome(FAILED, json.dumps({"reason": reason[:LONGEST_REASON]}))


def compute(stored: StoredTask) -> Outcome:
    """Computes a task in this process with one BLAS thread; the previous thread limits are then restored."""
    task = stored.task()
    with _controller(_function_place(task)).limit(limits=1):
        try:
            function = function_at(_function_place(task))
            returned = function(**task.arguments) if isinstance(task, CallTask) else function(task)
            return Outcome(DONE, json.dumps(plain(returned), separators=(",", ":"), allow_nan=False))
        except InputError as error:
            return failed(str(error))
        except Exception as error:
            return failed(f"{type(error).__name__}: {error}" if str(error) else type(error).__name__)


def compute_at_worker(stored: StoredTask, sent_by: str) -> Outcome:
    """`compute` in a worker; raises InputError where its version of camopt is not the sender's."""
    if (installed := _own_version()) != sent_by:
        raise InputError(
            f"sweep: a worker has camopt {installed}, and the tasks are sent by camopt {sent_by}; nothing of it was "
            f"recorded: install one version everywhere"
        )
    _controller(_function_place(stored.task())).limit(limits=1)  # permanently, because other threads may compute here
    return compute(stored)


def _function_place(task: Task) -> str:
    """The location of a task's function, "package.module:name"."""
    if isinstance(task, CallTask):
        return task.function
    return f"{__name__}:rehearse" if task.verb == "rehearse" else f"{SCENE_VERBS}:{task.verb}_task"


@cache
def _controller(place: str) -> ThreadpoolController:
    """The thread pools that exist once the module of a function, and all that it imports, is loaded."""
    import_module(place.partition(":")[0])
    return ThreadpoolController()


_own_version = cache(partial(version, "camopt"))


def rehearse(task: RehearseTask) -> dict[str, float]:
    """The verb "rehearse": waits, then returns a fraction derived from the number, or ends as `end` requires."""
    if task.seconds:
        time.sleep(task.seconds)
    if task.end == "die":
        if parent_process() is None:
            raise InputError("rehearse: needs a worker process to end in: give workers")
        os.kill(os.getpid(), signal.SIGKILL)
    if task.end == "raise":
        raise InputError(f"rehearse: task {task.number} fails, as it was told to")
    return {"fraction": int.from_bytes(sha256(str(task.number).encode()).digest()[:6], "big") / 2**48}
