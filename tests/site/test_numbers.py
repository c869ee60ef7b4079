"""Numbers of the pages come from the stored results: every expression can be evaluated, and results determine pages."""

import json
import re
from pathlib import Path

import pytest

from docs.generators.results import RESULTS, ROLE, filled_numbers, number, stored

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").rglob("*.md"))
NUMBER = r"−?\d+(\.\d+)?(e−?\d+)?"
TEXTS = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in [*PAGES, ROOT / "docs/claims.toml"]}


@pytest.mark.parametrize("page", [name for name, text in TEXTS.items() if ROLE.search(text)])
def test_every_expression_of_a_page_gives_numbers(page):
    for expression in ROLE.findall(TEXTS[page]):
        assert re.fullmatch(rf"{NUMBER}(, {NUMBER})*", number(expression)), expression


def test_a_page_shows_the_number_of_its_result(tmp_path):
    """A page shows a changed number if the result file changes."""
    content = json.loads((RESULTS / "optimiser.json").read_text(encoding="utf-8"))
    page = "It has {number}`optimiser.rows['kodama, band'].area_ratio | .4f`."
    (row,) = [row for row in content["rows"] if row["case"] == "kodama, band"]
    assert filled_numbers(page) == f"It has {row['area_ratio']:.4f}."
    row["area_ratio"] = 0.1234
    (tmp_path / "optimiser.json").write_text(json.dumps(content), encoding="utf-8")
    assert filled_numbers(page, tmp_path) == "It has 0.1234."


@pytest.fixture
def folder(tmp_path):
    rows = [{"cam": "a", "limits": "all", "x": 1.0}, {"cam": "a", "limits": "none", "x": -2.5}, {"cam": "b", "x": 4}]
    (tmp_path / "found.json").write_text(
        json.dumps({"rows": rows, "by name": {"c": 3}, "list": [1.0, 20.0, 3e-7]}), encoding="utf-8"
    )
    stored.cache_clear()
    return tmp_path


@pytest.mark.parametrize(
    ("expression", "shown"),
    [
        ("found.rows['a', 'none'].x | .1f", "−2.5"),
        ("found.rows['b'].x | d", "4"),
        ("100 * found.rows[0].x / found['by name'].c | .1f", "33.3"),
        ("max(r.x for r in found.rows if r.cam == 'a') | .0f", "1"),
        ("len(found.rows) | d", "3"),
        ("found.list | g", "1, 20, 3e−7"),
        ("found.list[1] | .0e", "20"),
        ("max(a for a, r in zip(found.list, found.rows) if r.x > 0) | g", "1"),
    ],
)
def test_expressions(folder, expression, shown):
    assert number(expression, folder) == shown


@pytest.mark.parametrize(
    "expression", ["found.rows['a'].x | .1f", "found.other | d", "lost.rows[0] | d", "open('x') | s"]
)
def test_a_missing_name_or_key_is_an_error(folder, expression):
    with pytest.raises((KeyError, ValueError, NameError, FileNotFoundError)):
        number(expression, folder)


def test_no_line_begins_with_a_per_cent_sign(folder):
    assert filled_numbers("It is\n{number}`found.rows['b'].x | d`\n% more.", folder) == "It is\n4 % more."
