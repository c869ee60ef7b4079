"""Every experiment has its page and its stored result, and its small size passes its checks.

`small_motions`, `small_cams` and `stored_results` have the checks of the content of an experiment under its name.
"""

import ast
import json
import re
import shutil
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

import experiments
from camopt.optimizer.accuracy import ACCURACIES
from camopt.scene import builtin_scenes
from tests.experiments import small_cams, small_motions, stored_results

FOLDER = Path(experiments.__file__).parent
SCRIPTS = sorted(p.stem for p in FOLDER.glob("*.py") if p.stem != "__init__")
PAGES = FOLDER.parent / "docs" / "results"
SMALL = vars(small_motions) | vars(small_cams)
LONG = {
    "cost_scaling", "first_gradient", "fronts", "gradient_batch", "gradient_bias", "gradient_quality", "stated_yields",
}  # fmt: skip
ELSEWHERE = {"tradeoff"}
"""Its small size is that of `camopt tradeoff`, which tests/study/test_tradeoff.py runs."""
NEEDED = {"contact_laws": "exudyn", "outside_judges": "exudyn", "optimisers": "cma", "live_latency": "playwright"}
"""Packages of the extras that a small size needs."""
STORED_ALONE = {
    "job_time": {"older", "ratios"},  # of the full size alone
    "yield_price": {"beside"},  # of an older tree
    "optimiser": {"rows.area_ratio_no_jump"},
    "work_precision": {"times_slower_by_round.CVODE Adams", "over_older"},  # of the extra `peers`, of an older tree
}
"""Fields of a stored result that a small size does not have."""
DRAWN = {
    "cam_families", "classical_laws", "drawn_trains", "flat_follower", "fronts", "handbook", "optimisers",
    "work_precision",
}  # fmt: skip
"""Experiments with a figure at small size too."""
SMALLER = {
    "architectures": ("camopt.optimizer.baselines.comparison.SECTIONED", ()),
    "extremes": ("camopt.smooth.simulate.MOST_GRID_STEPS", 8192),  # a layer that no grid resolves is tried on each
    "yield_price": ("camopt.optimizer.as_built.search.KNOT_DEG", 6.0),
}
"""Settings of the package that are smaller in these tests."""
RESUMED = {"near_limit": "verdict_of", "never_nothing": "optimised", "starts": "searched"}
"""Functions that an experiment must not call again if its store has all rows."""


def stored(name: str) -> dict:
    return json.loads((FOLDER / "results" / f"{name}.json").read_text())


def question(name: str) -> str:
    """The first paragraph of a script's docstring."""
    docstring = ast.get_docstring(ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8"))) or ""
    return " ".join(docstring.partition("\n\n")[0].split())


def test_every_script_has_a_judge():
    assert {name for name in SMALL if name in SCRIPTS} == set(SCRIPTS) - ELSEWHERE


@pytest.mark.parametrize("name", SCRIPTS)
def test_result_is_stored_at_full_size_with_its_provenance(name):
    content = stored(name)
    source = content["provenance"]
    assert source["command"] == f"python -m experiments.{name} full"
    assert source["versions"] and source["date_utc"]
    getattr(stored_results, name, dict)(content)


@pytest.mark.parametrize("name", SCRIPTS)
def test_its_page_answers_the_question_with_a_number(name):
    page = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    asked, answer = re.split(r"\n\n", page, maxsplit=2)[1:]
    assert " ".join(asked.split()) == f"*{question(name)}*"
    assert re.search(r"\d|\{number\}", answer), "an answer has a number"
    assert f"```{{generated}} origin\n{name}\n```" in page


def small_size(name: str):
    marks = [pytest.mark.long, pytest.mark.timeout(600)] if name in LONG else []
    if name in NEEDED:
        marks.append(pytest.mark.skipif(not find_spec(NEEDED[name]), reason=f"{NEEDED[name]} is not installed"))
    if name == "live_latency":
        marks.append(pytest.mark.skipif(shutil.which("chromium") is None, reason="no Chromium on this machine"))
    return pytest.param(name, marks=marks)


@pytest.mark.parametrize("name", [small_size(name) for name in SCRIPTS if name not in ELSEWHERE])
def test_small_size(name, tmp_path, monkeypatch):
    """It has the fields of the stored result, its figures are drawn, and its checks pass."""
    if name in SMALLER:
        monkeypatch.setattr(*SMALLER[name])
    if name in ("fronts", "never_nothing"):
        coarse = replace(ACCURACIES["draft"], knot_deg=8.0, program_speeds=2)
        monkeypatch.setitem(ACCURACIES, "draft", coarse)
    if name == "accuracy_curves":
        refused = "the small size is not for the package"
        monkeypatch.setattr("experiments.accuracy_curves.write_json", lambda *_: pytest.fail(refused))
    module = import_module(f"experiments.{name}")
    content = module.main("small", tmp_path)
    (path,) = tmp_path.glob(f"{name}*.json")
    written = json.loads(path.read_text())
    assert written["provenance"]["command"] == f"python -m experiments.{name} small"
    tables = {key for key, value in written.items() if isinstance(value, list) and value and isinstance(value[0], dict)}
    assert fields(stored(name), tables) - fields(written, tables) <= STORED_ALONE.get(name, set())
    drawn = [figure.stat().st_size for figure in tmp_path.glob(f"{name}*.png")]
    assert all(size > 10_000 for size in drawn) and (drawn or name not in DRAWN)
    SMALL[name](content)
    if name in RESUMED:
        monkeypatch.setattr(module, RESUMED[name], None)
        assert module.main("small", tmp_path)["rows"] == content["rows"], "kept rows are not computed again"


def fields(content: dict, tables: set[str]) -> set[str]:
    """Names of the entries, and of the fields that all rows of a table have, except scenes and speeds."""
    of_rows = {f"{key}.{name}" for key in tables for name in set.intersection(*map(set, content[key]))}
    return {name for name in (set(content) | of_rows) - set(builtin_scenes()) if not name[-1].isdigit()}
