"""The designer's server on real sockets of the loopback interface: permitted and refused requests, and saved files."""

import http.client
import json
import signal
import subprocess
import sys
import threading
import time

import pytest

import camopt
from camopt.designer.cams import Cancelled
from camopt.designer.server import HOST, MOST_BYTES, DesignServer
from camopt.designer.session import Session
from camopt.scene import InputError, load_scene

SCENE = load_scene("motori-1")


@pytest.fixture(scope="module")
def server(serve, tmp_path_factory):
    """A server that saves into a temporary folder."""
    return serve(SCENE, tmp_path_factory.mktemp("designer"))


def request(server, method="GET", path="/", body=None, **headers):
    """Status, headers and text of one request."""
    connection = http.client.HTTPConnection(HOST, server.port, timeout=60)
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.putrequest(method, path, skip_host="Host" in given, skip_accept_encoding=True)
    if body is not None and "Content-Length" not in given:
        given["Content-Length"] = str(len(body))
    for name, value in given.items():
        connection.putheader(name, value)
    connection.endheaders(body)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, dict(answer.getheaders()), text


def ask(server, message, **headers):
    """Status and content of the reply to a message."""
    body = message if isinstance(message, bytes) else json.dumps(message).encode()
    status, _, text = request(server, "POST", "/ask", body, **({"Content_Type": "application/json"} | headers))
    return status, json.loads(text)


def test_the_server_listens_on_the_loopback_interface_only(server):
    assert server.server_address[0] == "127.0.0.1"
    assert server.address == f"http://127.0.0.1:{server.port}/"


def test_the_page_has_a_restrictive_policy(server):
    for path, kind in {"/": "text/html", "/live.js": "text/javascript", "/live.css": "text/css"}.items():
        status, headers, text = request(server, path=path)
        assert status == 200 and headers["Content-Type"].startswith(kind) and len(text) > 100
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "script-src 'self'" in policy and "unsafe" not in policy
        assert headers["X-Content-Type-Options"] == "nosniff" and headers["Cache-Control"] == "no-store"
    assert request(server, path="/alive")[0] == 200


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1", "127.0.0.1:1", "", "localhost.evil"])
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_a_foreign_host_is_refused(server, host, method):
    body = b"{}" if method == "POST" else None
    assert request(server, method, "/ask" if body else "/", body, Host=host)[0] == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1", "http://127.0.0.1:1"])
def test_a_foreign_origin_is_refused(server, origin):
    assert ask(server, {"kind": "start"}, Origin=origin)[0] == 403
    assert request(server, Origin=origin)[0] == 403


def test_the_server_s_origin_and_localhost_are_accepted(server):
    assert ask(server, {"kind": "start"}, Origin=f"http://127.0.0.1:{server.port}")[0] == 200
    host = f"localhost:{server.port}"
    assert ask(server, {"kind": "start"}, Host=host, Origin=f"http://{host}")[0] == 200
    assert ask(server, {"kind": "start"}, Sec_Fetch_Site="cross-site")[0] == 403


@pytest.mark.parametrize(
    "path", ["/../etc/passwd", "/%2e%2e/etc/passwd", "//etc/passwd", "/live.js/..", "/scene.toml", "/?x"]
)
def test_no_address_leads_to_a_file(server, path):
    status, _, text = request(server, path=path)
    assert status == 404 and "root:" not in text


@pytest.mark.parametrize("name", ["../out", "/tmp/out", "a/b", "..", "", "a" * 65, "a.b", None, 3, "CON\0"])
@pytest.mark.parametrize("what", ["scene", "run"])
def test_no_name_leads_out_of_the_folder(server, name, what):
    status, content = ask(server, {"kind": "save", "what": what, "name": name, "values": {}})
    assert status == 400 and "expected letters" in content["says"]


def test_malformed_messages_are_refused(server):
    assert request(server, "POST", "/ask", b"{}", Content_Type="application/json", Content_Length="")[0] == 411
    assert ask(server, b" " * (MOST_BYTES + 1))[0] == 413
    assert request(server, "POST", "/ask", b"", Content_Type="application/json", Content_Length="9" * 11)[0] == 413
    assert ask(server, {"kind": "start"}, Content_Type="text/plain")[0] == 415
    for body in (b"", b"{", b"[1]", b'{"a": NaN}', b"[" * 60_000, b'{"a": ' + b"9" * 50_000 + b"}", b"\xff"):
        status, content = ask(server, body)
        assert status == 400 and "JSON" in content["says"], body[:9]
    assert request(server, "POST", "/other", b"{}", Content_Type="application/json")[0] == 404
    assert request(server, "PUT", "/ask", b"{}")[0] == 501


@pytest.mark.parametrize(
    "message",
    [
        {},
        {"kind": "shutdown"},
        {"kind": ["start"]},
        {"kind": "answer", "part": "cam"},
        {"kind": "answer", "part": "other", "values": {}},
        {"kind": "answer", "part": "cam", "values": {}, "sequence": "1"},
        {"kind": "newest", "sequence": "1"},
        {"kind": "save", "what": "all", "name": "a", "values": {}},
    ],
)
def test_invalid_requests_are_answered_with_a_sentence(server, message):
    status, content = ask(server, message)
    assert status == 400 and "expected" in content["says"]


@pytest.mark.parametrize(("max_lift_mm", "state"), [(9.0, "ok"), (-1, "refused")])
def test_an_answer_is_the_session_s(server, max_lift_mm, state):
    values = {"max_lift_mm": max_lift_mm}
    status, reply = ask(server, {"kind": "answer", "part": "cam", "values": values, "client": "a", "sequence": 1})
    assert status == 200 and reply["state"] == state and reply["sequence"] == 1
    expected = Session(SCENE).answer(values)
    assert reply.get("area_ratio") == pytest.approx(expected.get("area_ratio"), abs=1e-9)
    assert reply.get("faults") == expected.get("faults")


def test_the_newest_request_of_a_page_wins(server):
    def message(sequence, client):
        return {"kind": "answer", "part": "sketch", "values": {}, "client": client, "sequence": sequence}

    assert ask(server, message(7, "c"))[1]["state"] == "ok"
    assert ask(server, message(6, "c"))[1]["state"] == "superseded"
    assert ask(server, message(6, "d"))[1]["state"] == "ok"  # another page has its own numbers


def test_a_newer_request_cancels_the_computation(server, monkeypatch):
    """An endless answer, which only checks whether it is wanted, ends for a newer request that computes nothing."""
    message, begun = {"kind": "answer", "part": "sketch", "values": {}, "client": "e", "sequence": 1}, threading.Event()

    def endless(values, part, wanted):
        begun.set()
        while wanted():
            time.sleep(0.01)
        raise Cancelled

    monkeypatch.setattr(server.requests.session, "answer", endless)
    replies: list = []
    thread = threading.Thread(target=lambda: replies.append(ask(server, message)))
    thread.start()
    assert begun.wait(30)
    assert ask(server, {"kind": "newest", "client": "f", "sequence": 9})[1]["state"] == "ok"  # another page
    thread.join(0.1)
    assert thread.is_alive()
    assert ask(server, {"kind": "newest", "client": "e", "sequence": 2}) == (200, {"state": "ok", "sequence": 2})
    thread.join(30)
    assert replies == [(200, {"sequence": 1, "part": "sketch", "state": "superseded"})]


def test_a_slow_part_is_stopped(server):
    assert ask(server, {"kind": "stop"}) == (200, {"state": "ok"})  # there is none
    replies: list = []
    bound = {"kind": "answer", "part": "bound", "values": {}, "client": "g", "sequence": 1}
    thread = threading.Thread(target=lambda: replies.append(ask(server, bound)[1]))
    thread.start()
    while thread.is_alive() and not replies:  # effective once the process has started
        ask(server, {"kind": "stop"})
        time.sleep(0.05)
    thread.join(60)
    assert replies[0]["state"] == "no cam" and "stopped before it was done" in replies[0]["says"]


def test_a_scene_and_a_run_folder_are_saved_once(server):
    values = {"max_lift_mm": 9.0}
    save = {"kind": "save", "what": "scene", "name": "mine", "values": values}
    assert ask(server, save) == (200, {"state": "ok", "saved": "mine.toml"})
    folder = server.requests.folder
    assert load_scene(folder / "mine.toml").design.max_lift_mm == 9.0
    assert "exists already" in ask(server, save)[1]["says"]
    status, reply = ask(server, save | {"what": "run", "name": "run-1"})
    assert (status, reply["saved"]) == (200, "run-1")
    scene = load_scene(folder / "run-1" / "scene.toml")
    cam = camopt.read_cam(str(folder / "run-1"), scene)
    assert cam.area_ratio_in(scene.design) == pytest.approx(
        server.requests.session.design(values).cam.area_ratio, abs=1e-9
    )
    assert (folder / "run-1" / "report.html").exists() and (folder / "run-1" / "lift.csv").exists()
    assert ask(server, save | {"what": "run", "name": "run-1"})[0] == 400
    assert {p.name for p in folder.iterdir()} == {"mine.toml", "run-1"}


def test_a_verdict_reports_its_progress_and_can_be_cancelled(server):
    assert ask(server, {"kind": "cancel"})[1]["state"] in ("none", "cancelled")
    begun = ask(server, {"kind": "verify", "values": {}})[1]
    assert begun["state"] == "running" and begun["stages"] == 2
    state = ask(server, {"kind": "verification"})[1]
    assert state["state"] == "running" and state["seconds"] >= 0 and "verdict" in state["says"]
    assert ask(server, {"kind": "cancel"})[1]["state"] == "cancelled"
    assert ask(server, {"kind": "answer", "part": "sketch", "values": {}, "client": "e", "sequence": 1})[0] == 200


@pytest.mark.long
def test_a_verdict_is_that_of_verify_and_is_saved_in_the_run_folder(server):
    ask(server, {"kind": "verify", "values": {}})
    for _ in range(1200):
        state = ask(server, {"kind": "verification"})[1]
        if state["state"] != "running":
            break
        time.sleep(0.2)
    from camopt.cam.design_file import as_written

    direct = camopt.verify(SCENE, as_written(server.requests.session.design({}).cam.lift))
    assert state["state"] == "done" and state["verdict"] == direct.verdict
    ask(server, {"kind": "save", "what": "run", "name": "verified", "values": {}})
    stored = json.loads((server.requests.folder / "verified" / "verification.json").read_text())
    assert stored["verdict"] == direct.verdict


def test_a_port_that_is_taken_is_named(server):
    with pytest.raises(InputError, match=f"--port {server.port}: cannot be listened on"):
        DesignServer(server.requests, server.port)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_the_command_prints_its_address_and_ends_cleanly(tmp_path, name):
    words = [sys.executable, "-m", "camopt", "design", "motori-1"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(words, cwd=tmp_path, text=True, **pipes) as process:
        try:
            line = process.stdout.readline()
            port = int(line.split("http://127.0.0.1:")[1].split("/")[0])
            connection = http.client.HTTPConnection(HOST, port, timeout=30)
            connection.request("GET", "/alive")
            assert connection.getresponse().read() == b'{"alive":true}'
            connection.close()
            process.send_signal(getattr(signal, name))
            _, err = process.communicate(timeout=30)
        finally:
            process.kill()
    assert process.returncode == 0
    assert err.splitlines()[0] == "the designer has ended" and "Traceback" not in err
