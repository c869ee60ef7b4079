"""A mutant is tried with the tests that run its line, and is caught if one of them fails."""

import json
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest

pytest.importorskip("cosmic_ray")
pytest.importorskip("coverage")

from tests.mutation import choice
from tests.mutation.choice import DIGITS, Choice, Timed, on_import, statement, within
from tests.mutation.summary import summary, table
from tests.mutation.trial import outcome, watched

SOURCE = '''"""A module."""

LIMIT = 3.0


def doubled(x):
    if x > LIMIT:
        return LIMIT
    return (
        2.0
        * x
    )


class Kept:
    size: int = 2

    def twice(self):
        return doubled(self.size)
'''
TESTS = """from camopt.measure.a import doubled

def test_limit():
    assert doubled(5.0) == 3.0

def test_double():
    assert doubled(1.0) == 2.0

def test_that_fails_without_a_fault():
    assert doubled(1.0) == 7.0
"""
FILE = "camopt/measure/a.py"


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """A source tree with one module and its tests."""
    for path, text in {FILE: SOURCE, "tests/measure/test_a.py": TESTS, "tests/measure/test_b.py": ""}.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    for name in ("camopt", "camopt/measure"):
        (tmp_path / name / "__init__.py").write_text("")
    monkeypatch.setattr(choice, "ROOT", tmp_path)
    return tmp_path


def test_a_line_belongs_to_the_smallest_statement(tree):
    assert statement(tree / FILE, range(11, 12)) == range(9, 13)
    assert statement(tree / FILE, range(7, 8)) == range(7, 8)  # the head of the condition


@pytest.mark.parametrize(("line", "expected"), [(3, True), (6, True), (7, False), (10, False), (16, True), (19, False)])
def test_code_outside_of_functions_runs_on_import(tree, line, expected):
    assert on_import(tree / FILE, range(line, line + 1)) is expected


def test_the_tests_that_run_a_line_are_ordered_by_time(tree):
    rows = {
        DIGITS: {"d": {"seconds": 9.0, "lines": {FILE: [8]}}},
        "tests/measure/test_a.py": {
            "slow": {"seconds": 5.0, "lines": {FILE: [7, 8]}},
            "quick": {"seconds": 1.0, "lines": {FILE: [7, 8]}},
            "other": {"seconds": 0.5, "lines": {FILE: [9]}},
            "elsewhere": {"seconds": 0.1, "lines": {"camopt/measure/b.py": [8]}},
        },
        "tests/measure/test_b.py": {"unnamed": {"seconds": 0.2, "lines": {FILE: [8]}}},
    }
    calls = []

    def watching(file, plain):
        calls.append((file, plain))
        return rows[file]

    chosen = Choice(tree / "map.jsonl", watching)
    names = [(plain, [test.name for test in tests]) for plain, tests in chosen.stages(FILE, range(8, 9))]
    assert names == [(True, ["d"]), (False, ["quick", "slow"]), (False, ["unnamed"])]
    assert calls == [(DIGITS, True), ("tests/measure/test_a.py", False), ("tests/measure/test_b.py", False)]
    again = Choice(tree / "map.jsonl", lambda file, plain: pytest.fail("is known"))
    assert [t.name for t in next(iter(again.stages(FILE, range(9, 10))))[1]] == []
    constant = dict(again.stages(FILE, range(3, 4)))
    assert [t.name for t in again.running(["tests/measure/test_a.py"], False, FILE, range(3, 4))] == [
        *("other", "quick", "slow")
    ]
    assert [t.name for t in constant[True]] == ["d"]


def test_the_summed_time_of_tests_is_limited():
    tests = [Timed("a", 3.0), Timed("b", 3.0), Timed("c", 3.0)]
    assert within(7.0, tests) == tests[:2] and within(1.0, tests) == tests[:1] and within(9.0, []) == []


@pytest.fixture
def alone():
    """Calls a function in a new process: trials fork, which is not allowed in a process that has started JAX."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
        yield lambda function, *arguments: process.submit(function, *arguments).result()


def test_a_fault_is_not_attributed_to_a_test_that_always_fails(tree, alone):
    lines = alone(watched, tree, "tests/measure/test_a.py", True)
    name = "tests/measure/test_a.py::test_"
    assert {test: one["lines"].get(FILE) for test, one in lines.items()} == {
        name + "limit": [7, 8],
        name + "double": [7, 9, 10, 11],
    }
    timed = [Timed(name + part, 1.0) for part in ("that_fails_without_a_fault", "limit", "double")]
    fault = SOURCE.replace("2.0\n", "5.0\n")
    result, seconds = alone(outcome, FILE, fault, [(True, timed)], tree)
    assert result == f"caught by {name}double as plain Python" and seconds > 0.0
    assert alone(outcome, FILE, fault, [(True, timed[1:2])], tree)[0] == "survived"
    for wrong, kind in (
        ("import nothing_of_the_kind\n", "its import"),
        (SOURCE.replace("return LIMIT", "import os; os.abort()"), "time or a crash"),
    ):
        assert alone(outcome, FILE, wrong, [(True, timed[1:2])], tree)[0].startswith(f"caught by {kind}")
    assert (tree / FILE).read_text() == SOURCE


def test_survivors_have_their_reasons_while_their_lines_are_unchanged():
    from tests.mutation.mutants import Mutant

    drawn = [Mutant(FILE, "op", i) for i in range(5)]
    rows = {
        m.key: {"mutant": m.key, "outcome": word, "seconds": 2.0, "difference": f"@@ -{i} +{i} @@\n-{i}\n+x"}
        for i, (m, word) in enumerate(zip(drawn, ["caught by t", "survived", "survived", "survived"], strict=False))
    }
    reasons = [
        (drawn[1].key, "equivalent", "-1\n+x"),
        (drawn[2].key, "equivalent", "-other\n+x"),
        (drawn[3].key, "harmless", "@@ -90 +90 @@\n-3\n+x"),
    ]
    known = {k: {"kind": kind, "reason": "so", "difference": d} for k, kind, d in reasons}
    stored = summary(rows, drawn, 0, known)
    assert [stored[name] for name in ("drawn", "tried", "caught", "equivalent")] == [5, 4, 1, 1]
    assert [one["kind"] for one in stored["survivors"]] == ["equivalent", "survived", "harmless"]
    assert stored["folders"] == {"camopt/measure": {"caught": 1, "equivalent": 1, "harmless": 1, "survived": 1}}
    assert "4 of 5 mutants tried, 1 caught, 1 equivalent, 2.0 s each" in table(stored)
    assert json.loads(json.dumps(stored)) == stored
