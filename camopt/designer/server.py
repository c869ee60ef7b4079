"""The designer's page and its messages over HTTP, for browsers on this machine only.

The server listens on the loopback interface only. It refuses a request that names another host or comes from the page
of another site, so no page of the network can use it through a browser of this machine (DNS rebinding, cross-site
requests). Its addresses are a fixed table; none leads to a file.
"""

import json
import sys
import traceback
from collections.abc import Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import Any

from camopt.designer.requests import RequestHandler
from camopt.scene.errors import InputError

HOST = "127.0.0.1"
NAMES = (HOST, "localhost")
MOST_BYTES = 64_000
"""Longest message [bytes], ten times that of the page."""
QUIET_S = 120.0
"""Time after which a connection without requests is closed [s]."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
SHARED = ("animation", "charts")
"""Scripts and style sheets of the report that precede those of the page: the animation of the train, and the charts."""
SCRIPTS = ("fields.js", "panels.js", "verdict.js", "mark.js", "slow.js", "saving.js", "live.js", "start.js")
"""The page's own parts of the module, in their order after the shared ones."""


def module_text() -> str:
    """The ES module: the scripts shared with the report, followed by the page's own."""
    return "\n".join([*_shared("js"), *map(_page, SCRIPTS)])


def style_text() -> str:
    """The style sheet: the rules shared with the report, followed by the page's own."""
    return "\n".join([*_shared("css"), _page("live.css")])


def _page(name: str) -> str:
    return (resources.files("camopt.designer") / "page" / name).read_text(encoding="utf-8")


def _shared(kind: str) -> list[str]:
    report = resources.files("camopt.report")
    return [(report / f"{name}.{kind}").read_text(encoding="utf-8") for name in SHARED]


class DesignServer(ThreadingHTTPServer):
    """Serves one handler of requests; `port` 0 selects a free port. Raises InputError where the port is taken."""

    daemon_threads = True

    def __init__(self, requests: RequestHandler, port: int = 0):
        self.requests = requests
        self.pages = {
            "/": ("text/html; charset=utf-8", _page("index.html")),
            "/live.js": ("text/javascript; charset=utf-8", module_text()),
            "/live.css": ("text/css; charset=utf-8", style_text()),
        }
        try:
            super().__init__((HOST, port), Handler)
        except OSError as error:
            raise InputError(
                f"--port {port}: cannot be listened on ({error.strerror}): give another one, or leave it out"
            ) from error

    @property
    def port(self) -> int:
        """The port on which it listens."""
        return self.server_address[1]

    @property
    def address(self) -> str:
        """The address for a browser."""
        return f"http://{HOST}:{self.port}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Reports a defect, but not a connection that the browser closed."""
        if not isinstance(sys.exc_info()[1], ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    """One connection: fixed pages by GET, messages by POST to /ask."""

    server: DesignServer
    protocol_version = "HTTP/1.1"
    timeout = QUIET_S
    disable_nagle_algorithm = True  # else the end of an answer may wait for the browser's acknowledgement
    wbufsize = -1  # head and body of an answer are sent together

    def version_string(self) -> str:
        """The name of the program, without versions."""
        return "camopt"

    def log_message(self, format: str, *args: Any) -> None:
        """Logs nothing, to keep the user's terminal free."""

    def do_GET(self) -> None:
        """A page of the fixed table."""
        if self._is_foreign():
            return
        if self.path == "/alive":
            self._send_json(200, {"alive": True})
        elif self.path in self.server.pages:
            self._send(200, *self.server.pages[self.path])
        else:
            self._send_json(404, {"says": "there is no such page"})

    def do_POST(self) -> None:
        """A message, as JSON, to /ask."""
        if self._is_foreign():
            return
        if self.path != "/ask":
            self._refuse(404, "messages go to /ask")
            return
        message = self._message()
        if message is None:
            return
        try:
            self._send_json(200, self.server.requests.reply(message))
        except InputError as error:
            self._send_json(400, {"says": str(error)})
        except ConnectionError:
            raise
        except Exception as error:
            traceback.print_exc()
            self._send_json(500, {"says": f"a defect of camopt ({type(error).__name__}: {error})"})

    def _is_foreign(self) -> bool:
        """Refuse a request that does not come from this server's page, and return whether it was refused."""
        hosts = {f"{name}:{self.server.port}" for name in NAMES}
        host, origin = self.headers.get("Host"), self.headers.get("Origin")
        cross = self.headers.get("Sec-Fetch-Site", "same-origin") not in ("same-origin", "none")
        same = host in hosts and (origin is None or origin in {f"http://{name}" for name in hosts})
        if same and not (cross and self.command == "POST"):
            return False
        self._refuse(403, "only the designer's own page may send requests")
        return True

    def _message(self) -> Mapping[str, Any] | None:
        """The body as a JSON object; for any other body, sends the error and returns None."""
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit() and len(length) < 12):
            self._refuse(411, "its length is missing")
        elif int(length) > MOST_BYTES:
            self._refuse(413, f"a message has at most {MOST_BYTES} bytes")
        elif self.headers.get_content_type() != "application/json":
            self._refuse(415, "a message is application/json")
        else:
            try:
                message = json.loads(self.rfile.read(int(length)), parse_constant=_no_constant)
            except (ValueError, RecursionError):
                message = None
            if isinstance(message, dict):
                return message
            self._send_json(400, {"says": "the message is no JSON object"})
        return None

    def _refuse(self, status: int, says: str) -> None:
        """Send the error and close the connection without reading the rest of the request."""
        self.close_connection = True
        self._send_json(status, {"says": says})

    def _send_json(self, status: int, content: Mapping[str, Any]) -> None:
        text = json.dumps(content, separators=(",", ":"), allow_nan=False)
        self._send(status, "application/json", text)

    def _send(self, status: int, kind: str, text: str) -> None:
        body = text.encode()
        self.send_response(status)
        for name, value in {"Content-Type": kind, "Content-Length": str(len(body)), **HEADERS}.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is no number of JSON")
