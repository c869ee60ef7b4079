"""A Sphinx extension that fills in pages before they are parsed, so that no generated text is in the repository.

A page may contain two elements that Markdown does not have:

- `{number}` followed by an expression in backquotes, which is replaced by a number of a stored result
  (`docs.generators.results`);
- a fenced block ```` ```{generated} KIND ```` , which is replaced by the Markdown that the function of that kind makes
  from its content (`docs.generators.expansion`).

Both replacements are made in the text of the page. The tests call the same functions without Sphinx.
"""

import re
from pathlib import Path

from docs.generators.claims import CLAIMS
from docs.generators.expansion import expanded
from docs.generators.results import RESULTS

NOTEBOOK_LINK = re.compile(r"\]\(\.\./((?:\.\./)*)notebooks/")
"""A link from a page to a notebook of the repository; on the site both are below the same folder."""
FIGURE = re.compile(r"^!\[([^\]]+)\]\(.*\)$", re.MULTILINE)
"""A figure of a result on a line of its own; its description is also shown below it."""
WITH_CAPTIONS = ("results/", "validation/")
CODE = re.compile(r'(?<=<span class="pre">)[^<]+')
"""A word in code font, in HTML."""


def setup(app) -> dict:
    """Called by Sphinx."""
    _bring_notebooks(Path(app.srcdir))
    app.connect("source-read", _fill)
    app.connect("html-page-context", _let_names_break)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _bring_notebooks(docs: Path) -> None:
    """Copies the repository's notebooks below the pages, where Sphinx expects them; unchanged ones stay."""
    (docs / "notebooks").mkdir(exist_ok=True)
    for path in (docs.parent / "notebooks").glob("*.py"):
        copy, text = docs / "notebooks" / path.name, path.read_text(encoding="utf-8")
        if not copy.exists() or copy.read_text(encoding="utf-8") != text:
            copy.write_text(text, encoding="utf-8")


def _fill(app, page: str, source: list[str]) -> None:
    """Fills in a page's text; a page with generated parts is read again when results or claims have changed."""
    if page.startswith("notebooks/"):
        return
    filled = expanded(source[0])
    if filled != source[0]:
        for path in (CLAIMS, *RESULTS.glob("*.json")):
            app.env.note_dependency(str(path))
    if page.startswith(WITH_CAPTIONS):
        filled = FIGURE.sub(r"\g<0>\n\n*\1.*", filled)
    source[0] = NOTEBOOK_LINK.sub(r"](\1notebooks/", filled)


def _let_names_break(app, page: str, template: str, context: dict, tree) -> None:
    """Allows line breaks inside names and lists of choices, for tables on narrow screens."""
    if "body" in context:
        context["body"] = CODE.sub(lambda word: re.sub("[_,]", r"\g<0><wbr>", word[0]), context["body"])
