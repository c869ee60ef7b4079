"""The requests of a page, which a server of this machine or a notebook's kernel passes on."""

import json
from collections import OrderedDict
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Lock
from typing import Any

from camopt.cam.design_file import as_written
from camopt.designer.cams import Cancelled
from camopt.designer.controls import Refused
from camopt.designer.saving import save_run, save_scene
from camopt.designer.session import QUICK, Session
from camopt.designer.slow_parts import PARTS, WHY
from camopt.designer.worker import SlowProcess, Verification
from camopt.scene.errors import InputError
from camopt.scene.text_file import excerpt
from camopt.storage import plain

MOST_CLIENTS = 32
"""Pages whose last question is remembered."""


class RequestHandler:
    """Answers the messages of pages about one scene; with a `folder` it verifies, and saves there and nowhere else."""

    def __init__(self, session: Session, folder: Path | None = None):
        self.session, self.folder = session, folder
        self.slow, self.verification = SlowProcess(), Verification()
        self._one_at_a_time, self._newest_lock = Lock(), Lock()
        self._newest: OrderedDict[str, float] = OrderedDict()
        self._kinds: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "start": lambda _: self.session.start() | {"files": folder is not None},
            "answer": self._answer,
        }
        if folder is not None:
            self._kinds |= {
                "verify": self._verify,
                "cancel": lambda _: self.verification.cancel(),
                "verification": lambda _: self.verification.state(),
                "save": self._save,
            }

    def reply(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """The reply to a message: its "kind" says what is asked. Raises InputError for a message that is none."""
        kind = message.get("kind")
        if not isinstance(kind, str) or kind not in self._kinds:
            raise InputError(f"kind {excerpt(str(kind))}: expected one of {', '.join(self._kinds)}")
        return self._kinds[kind](message)

    def verified(self, values: Mapping[str, Any]) -> dict[str, Any] | None:
        """verification.json of values whose verdict has ended, else None."""
        return self.verification.verified(_subject(values))

    def stop(self) -> None:
        """End all processes."""
        self.verification.cancel()
        self.verification.worker.stop()
        self.slow.stop()

    def _answer(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """A part of the answer to values; the last question of a page wins, whichever comes through first."""
        client, sequence, part = str(message.get("client", ""))[:64], message.get("sequence", 0), message.get("part")
        if isinstance(sequence, bool) or not isinstance(sequence, int):
            raise InputError(f"sequence {excerpt(str(sequence))}: expected an integer")
        if not isinstance(part, str) or part not in (*QUICK, *PARTS):
            raise InputError(f"part {excerpt(str(part))}: expected one of {', '.join((*QUICK, *PARTS))}")
        with self._newest_lock:
            self._newest[client] = max(sequence, self._newest.pop(client, sequence))
            while len(self._newest) > MOST_CLIENTS:
                self._newest.popitem(last=False)

        def wanted() -> bool:
            return self._newest.get(client, sequence) <= sequence

        told = {"sequence": sequence, "part": part}
        try:
            if part in QUICK:
                with self._one_at_a_time:
                    if not wanted():
                        raise Cancelled
                    return told | self.session.answer(_values(message), part, wanted)
            return told | self._slow_answer(part, message)
        except Cancelled:
            return told | {"state": "superseded"}

    def _slow_answer(self, part: str, message: Mapping[str, Any]) -> dict[str, Any]:
        values = _values(message)
        try:
            if part == WHY:
                answer = self.slow.ask(part, self.session.edited(values), None)
            else:
                with self._one_at_a_time:
                    design = self.session.design(values, part == "few trains")
                answer = self.slow.ask(part, design.scene, design.cam.lift)
        except Refused as refused:
            return {"state": "refused", "faults": refused.faults}
        except (InputError, Cancelled) as error:
            return {"state": "no cam", "says": str(error)}
        return {"state": "ok", **answer}

    def _verify(self, message: Mapping[str, Any]) -> dict[str, Any]:
        values = _values(message)
        with self._one_at_a_time:
            design = self.session.design(values)
        return self.verification.start(design.scene, as_written(design.cam.lift), _subject(values))

    def _save(self, message: Mapping[str, Any]) -> dict[str, Any]:
        assert self.folder is not None, "without a folder no page may save"
        values, what = _values(message), message.get("what")
        with self._one_at_a_time:
            design = self.session.design(values)
        if what == "scene":
            path = save_scene(self.folder, message.get("name"), design)
        elif what == "run":
            path = save_run(self.folder, message.get("name"), design, self.verified(values))
        else:
            raise InputError(f"what {excerpt(str(what))}: expected scene or run")
        return plain({"state": "ok", "saved": path.name})


def _values(message: Mapping[str, Any]) -> Mapping[str, Any]:
    values = message.get("values")
    if not isinstance(values, Mapping):
        raise InputError("values: expected an object of numbers by key")
    return values


def _subject(values: Mapping[str, Any]) -> str:
    """Values as a text, but for the speed that is shown: the subject of a verdict."""
    return json.dumps({k: v for k, v in sorted(values.items()) if k != "speed_rpm"})
