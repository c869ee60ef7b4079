"""Trial of one mutant in a copy of the tree: the tests that run its line, in a fork of a process with all imports.

Mutants of compiled programs are tried without compiling them, by tests that are small enough for plain Python. Mutants
of other Python code are tried with the cached compiled programs of the unchanged sources.
"""

import gc
import importlib
import json
import os
import resource
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import coverage
import pytest

from tests.mutation.choice import DIGITS, Timed
from tests.mutation.mutants import ROOT

SECONDS = 120
"""Processor time [s] after which a mutant counts as caught; the tests need less for the unchanged sources."""
WATCHED = 120.0
"""Processor time [s] above which a test is not used, to keep trials short."""
ALTOGETHER = 300.0
"""Limit on the processor time of a test file [s]."""
HEAVY = (
    *("jax", "diffrax", "scipy.optimize", "scipy.stats", "numba", "pydantic", "matplotlib.figure", "xarray", "pytest"),
    *("hypothesis", "_hypothesis_pytestplugin", "xdist.plugin", "pytest_timeout", "beartype", "jaxtyping"),
)
QUIET = "-n 0 -q -x --timeout=0 -p no:cacheprovider -W ignore::pytest.PytestAssertRewriteWarning".split()
"""Options of pytest. Processor time is limited instead of elapsed time. Assertions of modules that are already imported
cannot be rewritten, which only affects messages."""


def copied(folder: Path) -> Path:
    """A copy of the package and its tests."""
    for name in ("camopt", "tests", "experiments", "pyproject.toml"):
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder / name)
    return folder


def prepared() -> None:
    """Imports all unmutated libraries once for all trials, and excludes them from garbage collection."""
    for name in HEAVY:
        importlib.import_module(name)
    gc.freeze()


def warmed(folder: Path) -> None:
    """Imports the copy once, so that Python's bytecode files exist."""
    _asked(folder, (f"{DIGITS}::test_all_of_them_are_kept",), True, None)


def outcome(file: str, changed: str, stages: Iterable[tuple[bool, list[Timed]]], folder: Path) -> tuple[str, float]:
    """("survived", or the test that caught the changed text of a file; processor time of the tests [s]). The stages are
    (whether compiled programs run as plain Python, tests); the first failing test ends the trial."""
    target, spent = folder / file, 0.0
    original, times = target.read_text(encoding="utf-8"), target.stat()
    for plain, tests in stages:
        names = tuple(test.name for test in tests)
        while names:
            target.write_text(changed, encoding="utf-8")
            os.utime(target, (times.st_atime, times.st_mtime + 10))  # invalidates the bytecode of the unchanged text
            failed, seconds = _asked(folder, names, plain, file)
            spent += seconds
            target.write_text(original, encoding="utf-8")
            os.utime(target, (times.st_atime, times.st_mtime))
            if failed is None:
                break
            if failed in names and not passes(folder, failed, plain):
                names = tuple(name for name in names if name != failed)
                continue
            return f"caught by {failed}{' as plain Python' if plain else ''}", spent
    return "survived", spent


@cache
def passes(folder: Path, test: str, plain: bool) -> bool:
    """Whether a test passes alone with the unchanged sources."""
    return _asked(folder, (test,), plain, None)[0] is None


def watched(folder: Path, tests: str, plain: bool) -> dict[str, dict]:
    """Lines and seconds of the tests of a file (`Watch.found`)."""
    result = folder / "watched.json"
    result.unlink(missing_ok=True)

    def watching() -> int:
        watch = Watch(folder)
        _pytest([argument for argument in QUIET if argument != "-x"], [tests], watch)
        result.write_text(json.dumps(watch.found()), encoding="utf-8")
        return 0

    _forked(folder, plain, None, watching, seconds=600)
    return json.loads(result.read_text(encoding="utf-8")) if result.exists() else {}


class First:
    """A pytest plugin that records the first failing test."""

    def __init__(self, file: Path):
        self.file = file

    def pytest_runtest_logreport(self, report):
        """Setup, call and teardown of a test can fail."""
        if report.failed:
            self.file.write_text(report.nodeid, encoding="utf-8")


class Watch:
    """A pytest plugin that records executed lines and processor time [s] of every passing test."""

    def __init__(self, folder: Path):
        self.folder, self.seconds, self.passed, self.wrong = folder, {}, set(), set()
        source = [str(folder / "camopt")]
        self.coverage = coverage.Coverage(data_file=None, config_file=False, source=source, messages=False)
        signal.signal(signal.SIGPROF, lambda *_: pytest.fail("takes too long to be asked"))
        self.coverage.start()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item):
        """Assigns the executed lines to this test."""
        if time.process_time() > ALTOGETHER:
            item.session.shouldstop = "enough tests of one file"
        self.coverage.switch_context(item.nodeid)
        start = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, WATCHED)
        yield
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        self.coverage.switch_context("")
        self.seconds[item.nodeid] = round(time.process_time() - start, 3)

    def pytest_runtest_logreport(self, report):
        """A test that is skipped, fails or takes too long is not used."""
        if report.when == "call" and report.passed:
            self.passed.add(report.nodeid)
        elif not report.passed:
            self.wrong.add(report.nodeid)

    def found(self) -> dict[str, dict]:
        """The seconds and the executed lines by file of each test."""
        self.coverage.stop()
        data = self.coverage.get_data()
        tests = {t: {"seconds": self.seconds[t], "lines": {}} for t in sorted(self.passed - self.wrong)}
        for path in sorted(data.measured_files()):
            name = Path(path).relative_to(self.folder).as_posix()
            for line, contexts in data.contexts_by_lineno(path).items():
                for test in tests.keys() & set(contexts):
                    tests[test]["lines"].setdefault(name, []).append(line)
        return tests


def _asked(folder: Path, tests: tuple[str, ...], plain: bool, faulty: str | None) -> tuple[str | None, float]:
    """(the first failing test or the reason why they ended, None if all pass; processor time [s])."""
    first = folder / "first.txt"
    first.write_text("", encoding="utf-8")
    status, spent = _forked(folder, plain, faulty, lambda: _pytest(QUIET, list(tests), First(first)), SECONDS)
    if status == 0:
        return None, spent
    said = first.read_text(encoding="utf-8")
    if os.WIFSIGNALED(status):
        return f"time or a crash in {said or tests[0]}", spent
    return said or f"its import in {tests[0]}", spent


def _pytest(options: list[str], tests: list[str], plugin: Any) -> int:
    return int(pytest.main([*options, *tests], plugins=[plugin]))


def _forked(folder: Path, plain: bool, faulty: str | None, work: Callable[[], int], seconds: int) -> tuple[int, float]:
    """Exit status and processor time [s] of `work` in a fork in the folder; `plain` runs compiled code as Python."""
    child = os.fork()
    if child:
        _, status, used = os.wait4(child, 0)
        return status, used.ru_utime + used.ru_stime
    code = 99
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        said = os.open(folder / "said.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(said, 1)
        os.dup2(said, 2)
        os.chdir(folder)
        sys.path[:] = [str(folder), *(p for p in sys.path if p and Path(p).resolve() != ROOT)]
        sys.dont_write_bytecode = faulty is not None
        for name in [n for n in sys.modules if n.split(".")[0] in ("tests", "camopt", "experiments")]:
            del sys.modules[name]
        if plain:
            os.environ["NUMBA_DISABLE_JIT"] = "1"
            importlib.import_module("numba").config.DISABLE_JIT = 1
        elif faulty is not None:
            _with_known_programs(folder / faulty, ROOT / faulty)
        code = work()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)


def _with_known_programs(faulty: Path, known: Path) -> None:
    """Makes the cache use the programs of the unchanged sources; the fault is in no compiled program."""
    programs = importlib.import_module("camopt.programs")
    sources = programs.sources
    programs.sources = lambda file: [known if path == faulty else path for path in sources(file)]
