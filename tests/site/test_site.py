"""The site builds without warnings (dead links are warnings), and loads nothing from other hosts."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from tests.browser import started_browser

pytest.importorskip("sphinx", reason="the extra `docs` is not installed; .ci/run installs it")
ROOT = Path(__file__).parents[2]
LOADING = {"script": "src", "img": "src", "iframe": "src", "link": "href", "source": "src"}
"""Elements whose sources a browser loads automatically, and the attribute with the address."""
READ = (
    "index", "tutorials/your-valve-train", "model", "reference/scene", "reference/commands", "run-folder",
    "validation/claims", "validation/handbook", "results/optimiser", "notebooks/first_design",
)  # fmt: skip
SCREENS = ({"width": 1366, "height": 768}, {"width": 390, "height": 844})
"""A laptop and a phone, in pixels."""
CUT_OFF = """() => [...document.querySelectorAll("article table, article img, article pre")].filter(one => {
    let around = one;
    while (around && getComputedStyle(around).overflowX === "visible") around = around.parentElement;
    return one.getBoundingClientRect().width > innerWidth && around === document.documentElement;
}).map(one => one.outerHTML.slice(0, 80)).concat(document.documentElement.scrollWidth > innerWidth ? ["page"] : [])"""
"""JavaScript that finds elements wider than the screen without horizontal scrolling of their own."""


class Page(HTMLParser):
    """The addresses that a page loads."""

    def __init__(self, text: str):
        super().__init__()
        self.loads = set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.loads |= {value or "" for name, value in attrs if name == LOADING.get(tag)}


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built as in .ci/run; tests/test_notebooks.py executes the notebooks."""
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html"]
    done = subprocess.run(
        [*command, "-d", str(out / "doctrees"), "docs", str(out / "html")],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=280,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return out / "html"


def test_nothing_is_loaded_from_other_hosts(site):
    loads = {path.name: Page(path.read_text(encoding="utf-8")).loads for path in sorted(site.rglob("*.html"))}
    assert not {(name, url) for name, urls in loads.items() for url in urls if urlsplit(url).netloc}
    for path in [*site.rglob("*.css"), *site.rglob("*.js")]:
        text = path.read_text(encoding="utf-8", errors="replace")
        assert not re.search(r"@import\s+(url\()?[\"']?(https?:)?//|url\([\"']?(https?:)?//", text), path


def test_pages_fit_a_laptop_and_a_phone(site):
    with started_browser() as browser:
        for screen in SCREENS:
            page = browser.new_page(viewport=screen)
            for name in READ:
                page.goto((site / f"{name}.html").as_uri())
                assert page.evaluate(CUT_OFF) == [], (name, screen)


def test_the_pages_have_their_generated_parts(site):
    def text(page):
        return re.sub(r"<[^>]+>", "", (site / page).read_text(encoding="utf-8"))

    assert "camopt tradeoff" in text("reference/commands.html")
    assert "acceleration_min_mm_per_deg2" in text("reference/scene.html")
    assert "camopt.manufacturing_yield" in text("reference/python.html")
    assert "{number}" not in "".join(text(page.relative_to(site)) for page in site.rglob("*.html"))
