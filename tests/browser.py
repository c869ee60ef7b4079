"""Chromium with Playwright, and pages whose faults are recorded, for the browser tests of report and designer."""

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PATIENCE_S = 60.0
"""Longest wait for a page [s], for a machine that is busy with other processes."""


@contextmanager
def started_browser() -> Iterator[Any]:
    """The browser; tests that need it are skipped if it or Playwright is missing. It occupies the event loop of its
    thread until it ends, so that no second browser can be started in that thread meanwhile."""
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
    """Waits until a condition holds; Playwright's own waiting evaluates strings, which the page's policy forbids."""
    begun = time.monotonic()
    while not reached():
        assert time.monotonic() - begun < PATIENCE_S, page.locator("body").inner_text()[:300]
        page.wait_for_timeout(50)


def serious_faults(page: Any) -> list[tuple]:
    """Serious and critical accessibility faults that axe finds on a page, each with its elements."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is not installed")
    violations = [v for v in axe.Axe().run(page).response["violations"] if v["impact"] in ("serious", "critical")]
    return [(v["id"], [n["target"] for n in v["nodes"]][:4]) for v in violations]
