"""A number that is typed into a page is a setting, a definition or a source's: every result is generated.

`docs/given.toml` lists, page by page, the numbers that may be typed. Whoever types another one meets this test, and either
generates it by `{number}` or a table (it is a result), or lists it (it is not).
"""

import re
import tomllib
from pathlib import Path

import pytest

from docs.generators.results import ROLE

ROOT = Path(__file__).parents[2]
DEFINING = {"docs/model.md", "docs/run-folder.md"}
"""Pages of definitions, whose numbers are the code's constants; the reference is made from code and schema."""
PAGES = {
    str(page.relative_to(ROOT)): page
    for page in [ROOT / "README.md", ROOT / "docs" / "claims.toml", *sorted((ROOT / "docs").rglob("*.md"))]
    if "reference" not in page.parts and str(page.relative_to(ROOT)) not in DEFINING
}
GIVEN = tomllib.loads((ROOT / "docs" / "given.toml").read_text(encoding="utf-8"))
NUMBER = re.compile(r"(?<![\w.\-/])[−-]?\d+(?:[ ,]\d{3}(?!\d))*(?:\.\d+)?(?:e[−-]?\d+)?(?![\w\-/]*[\w/]|\.\d)")
"""A number in prose; no part of a name such as `float32`, 2-10-18-26-34 or 0711.1008."""


def typed(text: str) -> set[str]:
    """The numbers in a page's sentences and tables; code, links' targets and what is generated are left out."""
    text = re.sub(r"^(`{3,}).*?^\1$", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(
        r"^commands = .*$|^ {4}.*$|^#.*$" if "[[claim]]" in text else r"^ {4}\S.*$", "", text, flags=re.MULTILINE
    )
    text = re.sub(r"`[^`]*`", " ", ROLE.sub(" ", text))
    return set(NUMBER.findall(re.sub(r"\]\([^)]*\)|^\d+\. ", "]", text, flags=re.MULTILINE)))


@pytest.mark.parametrize("page", PAGES)
def test_typed_numbers_are_given(page):
    found = typed(PAGES[page].read_text(encoding="utf-8"))
    listed = set(GIVEN.get(page, []))
    assert found <= listed, "a result is generated, a setting stands in docs/given.toml"
    assert listed <= found, "no longer in the page"


def test_every_list_has_a_page():
    assert set(GIVEN) <= set(PAGES)


def test_what_counts_as_typed():
    text = "It has 0.575 and 46 080 of 3 % at −7e-3, `0.5`, {number}`a.b | .1f`, [x](y7.md), 2-10-18-26-34, float32.\n"
    assert typed(text + "```text\n12\n```\n") == {"0.575", "46 080", "3", "−7e-3"}
