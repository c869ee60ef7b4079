"""The requests of a page, received from a server of this machine or a notebook's kernel; they include saving an edited
scene as a file, or with its cam as a run folder."""

import json
import platform
import re
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from threading import Lock
from typing import Any

from camopt.cam.design_file import as_written, write_design
from camopt.cam.tables.lift_table import write_lift_table
from camopt.designer.cams import Cancelled
from camopt.designer.session import QUICK, EditedDesign, Session, no_answer
from camopt.designer.slow_parts import PARTS, WHY
from camopt.designer.worker import SlowProcess, Verification
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.report.page import write_report
from camopt.scene.errors import InputError
from camopt.scene.text_file import excerpt, scene_toml
from camopt.scene.units import MM
from camopt.storage import plain, run_folder, run_identity, write_json, write_text

MOST_CLIENTS = 32
"""Number of pages whose newest request is stored."""
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
"""Permitted names of a saved file or folder: none leads out of the folder in which the designer was started."""


class RequestHandler:
    """Answers the messages of pages about one scene; with a `folder` it also verifies, and saves only there."""

    def __init__(self, session: Session, folder: Path | None):
        self.session, self.folder = session, folder
        self.slow, self.verification = SlowProcess(), Verification()
        self._one_at_a_time, self._newest_lock = Lock(), Lock()
        self._newest: OrderedDict[str, float] = OrderedDict()
        self._kinds: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "start": lambda _: self.session.start() | {"files": folder is not None},
            "answer": self._answer,
            # cancels what is being computed for an older request of the page
            "newest": lambda message: {"state": "ok", "sequence": self._register(message)[1]},
            "stop": self._stop,
        }
        if folder is not None:
            self._kinds |= {
                "verify": self._verify,
                "cancel": lambda _: self.verification.cancel(),
                "verification": lambda _: self.verification.state(),
                "save": self._save,
            }

    def reply(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """The reply to a message, whose "kind" selects the request. Raises InputError for an invalid message."""
        kind = message.get("kind")
        if not isinstance(kind, str) or kind not in self._kinds:
            raise InputError(f"kind {excerpt(str(kind))}: expected one of {', '.join(self._kinds)}")
        return self._kinds[kind](message)

    def verified(self, values: Mapping[str, Any]) -> dict[str, Any] | None:
        """verification.json of values whose full verdict is complete, else None."""
        return self.verification.verified(_subject(values))

    def stop(self) -> None:
        """End all processes."""
        self.verification.cancel()
        self.verification.worker.stop()
        self.slow.stop()

    def _answer(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """A part of the answer to values; the newest request of a page wins, in whatever order they arrive."""
        part, (client, sequence) = message.get("part"), self._register(message)
        if not isinstance(part, str) or part not in (*QUICK, *PARTS):
            raise InputError(f"part {excerpt(str(part))}: expected one of {', '.join((*QUICK, *PARTS))}")

        def wanted() -> bool:
            return self._newest.get(client, sequence) <= sequence

        request = {"sequence": sequence, "part": part}
        try:
            if part in QUICK:
                with self._one_at_a_time:
                    if not wanted():
                        raise Cancelled
                    return request | self.session.answer(_values(message), part, wanted)
            return request | self._slow_answer(part, message)
        except Cancelled:
            return request | {"state": "superseded"}

    def _register(self, message: Mapping[str, Any]) -> tuple[str, int]:
        """Page and sequence number of a request; the number is stored if it is the largest of this page so far."""
        client, sequence = str(message.get("client", ""))[:64], message.get("sequence", 0)
        if isinstance(sequence, bool) or not isinstance(sequence, int):
            raise InputError(f"sequence {excerpt(str(sequence))}: expected an integer")
        with self._newest_lock:
            self._newest[client] = max(sequence, self._newest.pop(client, sequence))
            while len(self._newest) > MOST_CLIENTS:
                self._newest.popitem(last=False)
        return client, sequence

    def _stop(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """Stops the slow part that is being computed."""
        self.slow.stop()
        return {"state": "ok"}

    def _slow_answer(self, part: str, message: Mapping[str, Any]) -> dict[str, Any]:
        values = _values(message)
        try:
            if part == WHY:
                answer = self.slow.compute(part, self.session.edited(values), None)
            else:
                with self._one_at_a_time:
                    design = self.session.design(values, part == "few trains")
                answer = self.slow.compute(part, design.scene, design.cam.lift)
        except (InputError, Cancelled) as error:
            return no_answer(error)
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
            path = self.folder / f"{_checked_name(message.get('name'))}.toml"
            if path.exists():
                raise InputError(f"{path.name}: exists already: give another name")
            write_text(path, scene_toml(design.scene))
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
    """Values as a text, without the speed that is shown: the subject of a verdict."""
    return json.dumps({k: v for k, v in sorted(values.items()) if k != "speed_rpm"})


def save_run(folder: Path, name: object, design: EditedDesign, verification: dict[str, Any] | None) -> Path:
    """Writes scene, cam, lift table, the verdict if there is one, and a report into the new run folder `<name>`."""
    scene, cam = design.scene, design.cam
    path, lift = folder / _checked_name(name), as_written(cam.lift)
    with run_folder(path, run_identity("design", scene, program=cam.program)):
        bound = float(area_ratio_bound(scene.required_design).bound)
        write_design(
            path / "design.json",
            cam.lift,
            scene.required_design.max_lift_mm * MM,
            area_ratio_bound=bound,
            area_gap_percent=100 * (bound - cam.area_ratio) / bound,
            area_ratio_no_jump=cam.area_ratio if cam.margin_price is not None else None,
            gradient_gain=0.0,
            limit_worth=cam.worth,
        )
        write_text(path / "scene.toml", scene_toml(scene))
        write_lift_table(path / "lift.csv", lift)
        if verification is not None:
            write_json(path / "verification.json", verification)
        content = {"versions": {"camopt": version("camopt"), "python": platform.python_version()}}
        content |= {"settings": {"command": "design", "program": cam.program}}
        finished = {"finished_utc": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())}
        write_json(path / "provenance.json", content | finished)
        write_report(path)
    return path


def _checked_name(name: object) -> str:
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise InputError(
            f"name {excerpt(str(name))}: expected letters, digits, - and _, at most 64 of them, a letter or digit first"
        )
    return name
