"""Every experiment has its line, its page and its stored result, and every line its experiment."""

import json
import re
from pathlib import Path

import pytest

import experiments

FOLDER = Path(experiments.__file__).parent
SCRIPTS = sorted(p.stem for p in FOLDER.glob("*.py") if "run_script(main, __doc__)" in p.read_text())
LINES = dict(re.findall(r"^\| `(\w+)` \| (.+\?) \| \[.+\) \|$", (FOLDER / "README.md").read_text(), re.MULTILINE))
PAGES = FOLDER.parent / "docs" / "results"


def test_lines_and_scripts_are_the_same():
    assert sorted(LINES) == SCRIPTS


@pytest.mark.parametrize("name", SCRIPTS)
def test_result_is_stored_at_full_size_with_its_provenance(name):
    source = json.loads((FOLDER / "results" / f"{name}.json").read_text())["provenance"]
    assert source["command"] == f"python -m experiments.{name} full"
    assert source["versions"] and source["date_utc"]


@pytest.mark.parametrize("name", SCRIPTS)
def test_its_page_answers_the_question_with_a_number(name):
    page = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    question, answer = re.split(r"\n\n", page, maxsplit=2)[1:]
    assert " ".join(question.split()) == f"*{LINES[name]}*"
    assert re.search(r"\d|\{number\}", answer), "an answer has a number"
    assert f"```{{generated}} origin\n{name}\n```" in page
