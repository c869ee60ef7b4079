"""The page's own files as texts: the HTML around it, and its script as the one ES module that a browser is given."""

from functools import cache
from importlib import resources

SCRIPTS = ("charts.js", "fields.js", "panels.js", "live.js")
"""Parts of the module in the order in which they stand in it; `camopt/report/animation.js` comes first."""


@cache
def module_text() -> str:
    """The ES module: the report's animation and the page's own scripts, one after the other."""
    animation = (resources.files("camopt.report") / "animation.js").read_text(encoding="utf-8")
    page = resources.files("camopt.designer") / "page"
    return "\n".join([animation, *((page / name).read_text(encoding="utf-8") for name in SCRIPTS)])


@cache
def style_text() -> str:
    """The style sheet: the animation's, and the page's own."""
    animation = (resources.files("camopt.report") / "animation.css").read_text(encoding="utf-8")
    return animation + (resources.files("camopt.designer") / "page" / "live.css").read_text(encoding="utf-8")


@cache
def page_text() -> str:
    """The HTML of the served page."""
    return (resources.files("camopt.designer") / "page" / "index.html").read_text(encoding="utf-8")
