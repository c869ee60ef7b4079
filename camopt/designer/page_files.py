"""The page's own files as texts: the HTML around it, and its script as the one ES module that a browser is given."""

from functools import cache
from importlib import resources

SHARED = ("animation", "charts")
"""Scripts and style sheets of the report that come first: the moving train, and the charts."""
SCRIPTS = ("fields.js", "panels.js", "verdict.js", "saving.js", "live.js", "start.js")
"""Parts of the module in the order in which they stand in it, after the shared ones."""


@cache
def module_text() -> str:
    """The ES module: what the report shares, and the page's own scripts, one after the other."""
    page = resources.files("camopt.designer") / "page"
    return "\n".join([*_shared("js"), *((page / name).read_text(encoding="utf-8") for name in SCRIPTS)])


@cache
def style_text() -> str:
    """The style sheet: what the report shares, and the page's own."""
    own = (resources.files("camopt.designer") / "page" / "live.css").read_text(encoding="utf-8")
    return "\n".join([*_shared("css"), own])


@cache
def page_text() -> str:
    """The HTML of the served page."""
    return (resources.files("camopt.designer") / "page" / "index.html").read_text(encoding="utf-8")


def _shared(kind: str) -> list[str]:
    report = resources.files("camopt.report")
    return [(report / f"{name}.{kind}").read_text(encoding="utf-8") for name in SHARED]
