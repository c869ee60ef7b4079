"""Selection of the tests for a mutant: those that run its line, the quickest first, from a map that is made once."""

import ast
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.mutation.mutants import ROOT

SECONDS = 60.0
"""Limit on the summed processor time of the tests of one mutant [s], as measured with coverage, which slows them."""
DIGITS = "tests/test_kept_digits.py"
COMPILED = ("camopt/exact/", "camopt/verifier/methods/", "camopt/measure/cubics.py")
"""Files whose constants are compiled into programs: their import-time code is only tried as plain Python."""
FOLDERS = ("tests/measure", "tests/optimizer", "tests/verifier", "tests/exact", "tests/study")


@dataclass(frozen=True)
class Timed:
    """A test and its processor time [s] in the unchanged sources."""

    name: str
    seconds: float


class Choice:
    """The tests that run a line: first the stored results of small motions, as plain Python, then the tests that name
    the module, then the others of its folder. The lines that a test file runs are determined by `watched(file, plain)`
    when they are first needed, and stored in a file of JSON lines."""

    def __init__(self, file: Path, watched: Callable[[str, bool], dict[str, dict]]):
        self.file, self.watched = file, watched
        rows = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()] if file.exists() else []
        self.known = {(row["file"], row["plain"]): row["tests"] for row in rows}

    def stages(self, source: str, lines: range) -> Iterator[tuple[bool, list[Timed]]]:
        """(whether as plain Python, tests) in the order in which they are run."""
        asked = statement(ROOT / source, lines)
        yield True, self.running([DIGITS], True, source, asked)
        if source.startswith(COMPILED) and on_import(ROOT / source, lines):
            return
        for files in tests_of(source):
            yield False, self.running(files, False, source, asked)

    def running(self, files: list[str], plain: bool, source: str, lines: range) -> list[Timed]:
        """The tests of files that run one of the lines; for import-time lines, any line of the source."""
        whole, found = on_import(ROOT / source, lines), []
        for file in files:
            for name, one in self._tests(file, plain).items():
                ran = one["lines"].get(source, [])
                if ran if whole else not set(lines).isdisjoint(ran):
                    found.append(Timed(name, one["seconds"]))
        return within(SECONDS, sorted(found, key=lambda test: (test.seconds, test.name)))

    def _tests(self, file: str, plain: bool) -> dict[str, dict]:
        if (file, plain) not in self.known:
            self.known[file, plain] = self.watched(file, plain)
            row = {"file": file, "plain": plain, "tests": self.known[file, plain]}
            with self.file.open("a", encoding="utf-8") as out:
                print(json.dumps(row), file=out, flush=True)
        return self.known[file, plain]


def within(seconds: float, tests: list[Timed]) -> list[Timed]:
    """The first tests, at least one, whose summed time is within the limit."""
    chosen, spent = [], 0.0
    for test in tests:
        spent += test.seconds
        if spent > seconds and chosen:
            break
        chosen.append(test)
    return chosen


def tests_of(source: str) -> tuple[list[str], list[str]]:
    """Files of tests that name a module, and the others of the folder of its layer."""
    module, layer = source.removesuffix(".py").replace("/", "."), source.split("/")[1]
    files = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("test_*.py"))]
    naming = [path for path in files if module in path.read_text(encoding="utf-8")]
    own = [path for path in files if path not in naming and ROOT / "tests" / layer in path.parents]
    names = [[path.relative_to(ROOT).as_posix() for path in part] for part in (naming, own)]
    return names[0], names[1]


def statement(path: Path, lines: range) -> range:
    """The lines of the smallest statement that contains these lines; for a compound statement, its head."""
    spans = [span for span, _ in _statements(path) if span.start <= lines.start and lines.stop <= span.stop]
    return min(spans, key=len, default=lines)


def on_import(path: Path, lines: range) -> bool:
    """Whether lines are outside of functions, so that they run when the module is imported."""
    spans = [(span, inside) for span, inside in _statements(path) if lines.start in span]
    return not min(spans, key=lambda one: len(one[0]), default=(lines, False))[1]


@cache
def _statements(path: Path) -> list[tuple[range, bool]]:
    """(lines of a statement, whether it is inside a function); for a compound statement, its head."""
    found: list[tuple[range, bool]] = []

    def walk(node: ast.AST, inside: bool) -> None:
        if isinstance(node, ast.stmt):
            end = node.body[0].lineno if getattr(node, "body", None) else (node.end_lineno or node.lineno) + 1
            found.append((range(node.lineno, max(end, node.lineno + 1)), inside))
        for child in ast.iter_child_nodes(node):
            walk(child, inside or isinstance(node, ast.FunctionDef))

    walk(ast.parse(path.read_text(encoding="utf-8")), False)
    return found
