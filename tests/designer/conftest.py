"""A served designer and a browser, for the tests of the page."""

import threading

import pytest

from camopt.designer.requests import RequestHandler
from camopt.designer.server import DesignServer
from camopt.designer.session import Session
from tests.browser import started_browser


class Served:
    """A server of a scene in a thread."""

    def __init__(self, scene, folder):
        self.requests = RequestHandler(Session(scene), folder)
        self.server = DesignServer(self.requests)
        self.address = self.server.address
        self._thread = threading.Thread(target=self.server.serve_forever)
        self._thread.start()

    def end(self):
        self.server.shutdown()
        self._thread.join()
        self.server.server_close()
        self.requests.stop()


@pytest.fixture(scope="session")
def serve():
    """Serves a scene from a folder; everything ends with the session."""
    every = []

    def served(scene, folder) -> Served:
        every.append(Served(scene, folder))
        return every[-1]

    yield served
    for one in every:
        one.end()


@pytest.fixture(scope="module")
def browser():
    """Chromium for the tests of one file: as long as it runs, no other may start in its thread."""
    with started_browser() as started:
        yield started
