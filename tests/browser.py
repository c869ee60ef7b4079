"""Chromium by Playwright, and pages that are watched: what the browser tests of the report and the designer share."""

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PATIENCE_S = 60.0
"""How long a page may take on a machine that is busy with others."""


@contextmanager
def started_browser() -> Iterator[Any]:
    """The browser; tests that want it are skipped where it or Playwright is missing. It holds the event loop of its
    thread until it ends, so that no other one may be started there meanwhile."""
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine")
    with playwright.sync_playwright() as driver:
        # root in a container has no sandbox; the pages are the tests' own
        started = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()


@contextmanager
def watched_pages(browser: Any, address: str) -> Iterator[Callable[..., Any]]:
    """Opens an address in new windows. At the end there must be no console message, no error, and no request to another
    address, except below an address that ends with a slash."""
    contexts, faults = [], []

    def note(request: Any) -> None:
        if request.url != address and not (address.endswith("/") and request.url.startswith(address)):
            faults.append(request.url)

    def opened(**settings):
        context = browser.new_context(**{"viewport": {"width": 1366, "height": 768}} | settings)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: faults.append(message.text))
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", note)
        page.goto(address)
        return page

    yield opened
    for context in contexts:
        context.close()
    assert faults == []


def wait(page: Any, reached: Callable[[], Any]) -> None:
    """Until a condition holds; a page's policy forbids the evaluated strings of Playwright's own waiting."""
    begun = time.monotonic()
    while not reached():
        assert time.monotonic() - begun < PATIENCE_S, page.locator("body").inner_text()[:300]
        page.wait_for_timeout(50)


def serious_faults(page: Any) -> list[tuple]:
    """What axe finds on a page that is serious for those who cannot see or point, and where."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is not installed")
    found = [v for v in axe.Axe().run(page).response["violations"] if v["impact"] in ("serious", "critical")]
    return [(v["id"], [n["target"] for n in v["nodes"]][:4]) for v in found]
