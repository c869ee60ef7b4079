"""Numbered hostile messages to the designer's server: each must get status 200 or 4xx, a sentence and no traceback."""

import http.client
import json
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

from camopt.designer.requests import RequestHandler
from camopt.designer.server import HOST, DesignServer
from camopt.designer.session import QUICK, Session
from camopt.scene import Scene, load_scene
from tests.campaign.values import FACTORS, TEXTS, hostile, spoiled

SCENE = "motori-1"
SECONDS = 60.0
BODIES = (b"", b"{", b"[]", b"null", b'"x"', b"[" * 5000, b"\xff\xfe", b'{"kind": NaN}', b"{}" * 40_000)
KINDS = ("start", "answer", "save", "cancel", "verification")


def drawn(seed: int, own: dict[str, Any]) -> bytes:
    """The body of a message: invalid JSON, or a message with some hostile parts; `own` are the scene's values."""
    draw = Random(seed)
    if draw.random() < 0.1:
        return draw.choice(BODIES)
    values = {key: own[key] for key in draw.sample(sorted(own), draw.randrange(min(5, len(own))))}
    for key, value in values.items():
        if isinstance(value, int | float) and not isinstance(value, bool):
            values[key] = value * draw.choice(FACTORS)
    message = {"kind": draw.choice(KINDS), "part": draw.choice(QUICK), "client": str(seed), "sequence": seed}
    message |= {"what": draw.choice(("scene", "run")), "name": draw.choice(TEXTS), "values": values}
    if draw.random() < 0.5:
        message = spoiled(message, draw)
    if draw.random() < 0.3:
        message["values"] = {draw.choice([*own, *TEXTS]): hostile(draw)}
    return json.dumps(message).encode()


@contextmanager
def served(scene: Scene, folder: Path) -> Iterator[DesignServer]:
    """A designer server for a scene, in a thread, which saves into a folder."""
    requests = RequestHandler(Session(scene), folder)
    with DesignServer(requests) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()
    requests.stop()


def answered(server: DesignServer, seed: int) -> dict[str, Any]:
    """The outcome of a message: its status, and the fault of the answer, "" for none."""
    body = drawn(seed, server.requests.session.values())
    begun = time.process_time()
    connection = http.client.HTTPConnection(HOST, server.port, timeout=10 * SECONDS)
    try:
        connection.request("POST", "/ask", body, {"Content-Type": "application/json"})
        reply = connection.getresponse()
        status, text = reply.status, reply.read().decode()
    except (OSError, http.client.HTTPException) as error:
        status, text = 0, f"{type(error).__name__}: {error}"
    connection.close()
    seconds = time.process_time() - begun
    wrong = wrong_with(status, text) or (f"over {SECONDS:g} s" if seconds > SECONDS else "")
    return {"seed": seed, "kind": "message", "ended": f"status {status}", "wrong": wrong, "said": text[:300]}


def wrong_with(status: int, text: str) -> str:
    """The fault of an answer, or "" if it is valid."""
    if status != 200 and not 400 <= status < 500:
        return f"status {status}"
    try:
        content = json.loads(text)
    except ValueError:
        return "no JSON"
    says = content.get("says", "") if isinstance(content, dict) else None
    if says is None or (status != 200 and not says) or "Traceback" in text:
        return "no sentence"
    return "a sentence that nobody reads" if len(says) > 2000 else ""


def outcomes(seeds: range) -> Iterator[dict[str, Any]]:
    """Outcomes of the messages with these numbers, sent to one server one after another."""
    with tempfile.TemporaryDirectory() as folder, served(load_scene(SCENE), Path(folder)) as server:
        for seed in seeds:
            yield answered(server, seed)
