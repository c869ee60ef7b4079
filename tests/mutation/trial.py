"""One mutant in a copy of the tree: the tests that name its module, in a fork of a process that has imported the rest.

Mutants of compiled programs are tried without compiling them, by tests that are small enough for plain Python.
"""

import importlib
import os
import resource
import shutil
import sys
import traceback
from functools import cache
from pathlib import Path

from tests.mutation.mutants import ROOT, Mutant

SECONDS = 120
"""Processor time after which a mutant counts as caught: the tests of the sources as they are need less."""
COMPILED = ("camopt/exact/", "camopt/verifier/methods/")
DIGITS = "tests/test_kept_digits.py"
SEARCHED = ("exact", "measure", "verifier", "optimizer")
HEAVY = ("jax", "diffrax", "scipy.optimize", "numba", "pydantic", "matplotlib.figure", "xarray", "pytest")


def copied(folder: Path) -> Path:
    """A copy of the package and its tests."""
    for name in ("camopt", "tests", "experiments", "pyproject.toml"):
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder / name)
    return folder


def chosen(file: str) -> list[str]:
    """Files of tests for a file, the shortest first; the first that fails ends the trial."""
    if file.startswith(COMPILED):
        return [DIGITS]
    module = file.removesuffix(".py").replace("/", ".")
    tests = [p for folder in SEARCHED for p in sorted((ROOT / "tests" / folder).rglob("test_*.py"))]
    naming = [p for p in tests if module in p.read_text(encoding="utf-8")]
    return [*(str(p.relative_to(ROOT)) for p in sorted(naming, key=lambda p: p.stat().st_size)), DIGITS]


def prepared() -> None:
    """Imports what is no mutant, once for all trials."""
    for name in HEAVY:
        importlib.import_module(name)


def outcome(mutant: Mutant, changed: str, folder: Path) -> str:
    """ "survived", or by which tests it was caught; tests that fail in the copy without a fault are not asked."""
    target, plain = folder / mutant.file, mutant.file.startswith(COMPILED)
    known = target.read_text(encoding="utf-8")
    for test in chosen(mutant.file):
        if not passes(test, folder, plain):
            continue
        target.write_text(changed, encoding="utf-8")
        status = _forked(test, folder, plain)
        target.write_text(known, encoding="utf-8")
        if os.WIFSIGNALED(status):
            return f"caught by time or a crash in {test}"
        if os.WEXITSTATUS(status) != 0:
            return f"caught by {test}"
    return "survived"


@cache
def passes(test: str, folder: Path, plain: bool) -> bool:
    """Whether the tests of a file pass in the copy as it is."""
    return _forked(test, folder, plain) == 0


def _forked(test: str, folder: Path, plain: bool) -> int:
    """Status of a fork that runs a file of tests in the folder; compiled programs as plain Python where asked."""
    child = os.fork()
    if child:
        return os.waitpid(child, 0)[1]
    code = 99
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        said = os.open(folder / "said.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(said, 1)
        os.dup2(said, 2)
        os.chdir(folder)
        sys.path[:] = [str(folder), *(p for p in sys.path if p and Path(p).resolve() != ROOT)]
        sys.dont_write_bytecode = True
        for name in [n for n in sys.modules if n.split(".")[0] in ("tests", "camopt", "experiments")]:
            del sys.modules[name]
        if plain:
            os.environ["NUMBA_DISABLE_JIT"] = "1"
            importlib.import_module("numba").config.DISABLE_JIT = 1
        import pytest

        # what is imported already cannot be rewritten, which costs a message only
        quiet = ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
        code = int(pytest.main(["-n", "0", "-q", "-x", "-p", "no:cacheprovider", *quiet, test]))
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)
