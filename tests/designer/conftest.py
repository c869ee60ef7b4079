"""A served designer and a browser, for the tests of the page."""

import shutil
import threading

import pytest

from camopt.designer.desk import Desk
from camopt.designer.server import DesignServer
from camopt.designer.session import Session

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


class Served:
    """A server of a scene in a thread."""

    def __init__(self, scene, folder):
        self.desk = Desk(Session(scene), folder)
        self.server = DesignServer(self.desk)
        self.address = self.server.address
        self._thread = threading.Thread(target=self.server.serve_forever)
        self._thread.start()

    def end(self):
        self.server.shutdown()
        self._thread.join()
        self.server.server_close()
        self.desk.stop()


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


@pytest.fixture(scope="session")
def browser():
    """Chromium by Playwright; tests that want it are skipped where either is missing."""
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine")
    with playwright.sync_playwright() as driver:
        # root in a container has no sandbox; the page is this test's own
        started = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()
