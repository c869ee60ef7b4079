"""One mutant in a copy of the tree: the tests that run its line, in a fork of a process that has imported the rest.

Mutants of compiled programs are tried without compiling them, by tests that are small enough for plain Python. What
Python itself runs beside these programs is tried with the programs that are kept for the sources without the fault.
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
"""Processor time after which a mutant counts as caught: the tests of the sources as they are need less."""
WATCHED = 120.0
"""Processor time after which a test is not asked: a trial is to be cheap."""
ALTOGETHER = 300.0
"""Processor time for a file of tests."""
HEAVY = (
    *("jax", "diffrax", "scipy.optimize", "scipy.stats", "numba", "pydantic", "matplotlib.figure", "xarray", "pytest"),
    *("hypothesis", "_hypothesis_pytestplugin", "xdist.plugin", "pytest_timeout", "beartype", "jaxtyping"),
)
QUIET = "-n 0 -q -x --timeout=0 -p no:cacheprovider -W ignore::pytest.PytestAssertRewriteWarning".split()
"""Processor time is limited, and not that of the clock; what is imported already cannot be rewritten, which costs a
message only."""


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
    """Imports what is no mutant, once for all trials; no collection of garbage looks at it again."""
    for name in HEAVY:
        importlib.import_module(name)
    gc.freeze()


def warmed(folder: Path) -> None:
    """Imports the copy once, so that what Python makes of its sources is kept."""
    _asked(folder, (f"{DIGITS}::test_all_of_them_are_kept",), True, None)


def outcome(file: str, changed: str, stages: Iterable[tuple[bool, list[Timed]]], folder: Path) -> tuple[str, float]:
    """("survived", or by which test the text of a file was caught; processor time of the tests [s]). The stages are
    (whether compiled programs run as plain Python, tests); the first test that fails is the last that is asked."""
    target, spent = folder / file, 0.0
    known, times = target.read_text(encoding="utf-8"), target.stat()
    for plain, tests in stages:
        names = tuple(test.name for test in tests)
        while names:
            target.write_text(changed, encoding="utf-8")
            os.utime(target, (times.st_atime, times.st_mtime + 10))  # not what was compiled from the known text
            found, seconds = _asked(folder, names, plain, file)
            spent += seconds
            target.write_text(known, encoding="utf-8")
            os.utime(target, (times.st_atime, times.st_mtime))
            if found is None:
                break
            if found in names and not passes(folder, found, plain):
                names = tuple(name for name in names if name != found)
                continue
            return f"caught by {found}{' as plain Python' if plain else ''}", spent
    return "survived", spent


@cache
def passes(folder: Path, test: str, plain: bool) -> bool:
    """Whether a test passes alone, without a fault."""
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
    """A plugin of pytest that writes down the first test that fails."""

    def __init__(self, file: Path):
        self.file = file

    def pytest_runtest_logreport(self, report):
        """Any part of a test can fail."""
        if report.failed:
            self.file.write_text(report.nodeid, encoding="utf-8")


class Watch:
    """A plugin of pytest that keeps lines and processor time [s] of every test that passes."""

    def __init__(self, folder: Path):
        self.folder, self.seconds, self.passed, self.wrong = folder, {}, set(), set()
        source = [str(folder / "camopt")]
        self.coverage = coverage.Coverage(data_file=None, config_file=False, source=source, messages=False)
        signal.signal(signal.SIGPROF, lambda *_: pytest.fail("takes too long to be asked"))
        self.coverage.start()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item):
        """Lines that run from here on are this test's."""
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
        """A test that is skipped, fails or takes too long is not asked."""
        if report.when == "call" and report.passed:
            self.passed.add(report.nodeid)
        elif not report.passed:
            self.wrong.add(report.nodeid)

    def found(self) -> dict[str, dict]:
        """For each test its seconds and the lines by file."""
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
    """(the first of the tests that fails, else what ended them, None where all pass; processor time [s])."""
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
    """Status and processor time [s] of a fork that works in the folder; compiled programs as plain Python if asked."""
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
    """Compiled programs are those of the sources without the fault, which is not in them."""
    programs = importlib.import_module("camopt.programs")
    sources = programs.sources
    programs.sources = lambda file: [known if path == faulty else path for path in sources(file)]
