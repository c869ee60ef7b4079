"""Chromium by Playwright, and pages that are watched: what the browser tests of the report and the designer share."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


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
def watched_pages(browser: Any, requested: list[str]) -> Iterator[Callable[..., Any]]:
    """Opens empty pages in windows of their own and notes what they ask for; at the end nothing may have been said or
    thrown."""
    contexts, faults = [], []

    def opened(**settings):
        context = browser.new_context(**{"viewport": {"width": 1366, "height": 768}} | settings)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: faults.append(message.text))
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda request: requested.append(request.url))
        return page

    yield opened
    for context in contexts:
        context.close()
    assert faults == []
