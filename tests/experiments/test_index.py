"""Every experiment has its line of verdict and its stored result, and every line its experiment."""

import json
import re
from pathlib import Path

import pytest

import experiments

FOLDER = Path(experiments.__file__).parent
SCRIPTS = sorted(p.stem for p in FOLDER.glob("*.py") if "run_script(main, __doc__)" in p.read_text())
LINES = dict(re.findall(r"^\| `(\w+)` \| .+\? \| (.+) \|$", (FOLDER / "README.md").read_text(), re.MULTILINE))


def test_lines_and_scripts_are_the_same():
    assert sorted(LINES) == SCRIPTS


@pytest.mark.parametrize("name", SCRIPTS)
def test_result_is_stored_at_full_size_with_its_provenance(name):
    source = json.loads((FOLDER / "results" / f"{name}.json").read_text())["provenance"]
    assert source["command"] == f"python -m experiments.{name} full"
    assert source["versions"] and source["date_utc"]
    assert re.search(r"\d", LINES[name]), "a verdict has a number"
