"""The cache of compiled programs: programs of other sources are never used, and a cached one is found again."""

import ast
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest

import camopt
from camopt import programs
from camopt.cache import cache_folder
from camopt.programs import CONSTANTS, PACKAGE, TOGETHER, compiled, digest, inner, pass_by_pointer, sources
from tests.campaign.starved import mounted

CODE = "import numpy as np; from camopt.measure.hermite import with_stationary_points as f; "
CODE += "f(*np.ones((2, 1)), np.ones(0), np.ones((4, 0))); "
SAY = "print(sum(f.stats.cache_hits.values()), sum(f.stats.cache_misses.values()), f.stats.cache_path)"


def fresh(code: str, folder: Path) -> list[str]:
    """The words that a new process prints, with `folder` as the user's cache."""
    environment = os.environ | {"XDG_CACHE_HOME": str(folder)}
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True, timeout=120)
    return run.stdout.decode().split()


def files_that_compile() -> list[Path]:
    imported = re.compile("from camopt.programs import .*(compiled|inner|njit_no_refcount)")
    return [p for p in sorted(PACKAGE.rglob("*.py")) if imported.search(p.read_text())]


def test_a_second_process_finds_the_program_of_the_first(tmp_path):
    assert fresh(CODE + SAY, tmp_path)[:2] == ["0", "1"]
    hits, misses, folder = fresh(CODE + SAY, tmp_path)
    assert (hits, misses) == ("1", "0")
    assert Path(folder).is_relative_to(tmp_path) and Path(folder).stat().st_mode & 0o077 == 0


@pytest.mark.parametrize(("kind", "left"), [pytest.param("*.nbi", 0, marks=pytest.mark.long), ("*.nbc", 20)])
def test_damaged_files_are_replaced(tmp_path, kind, left):
    fresh(CODE, tmp_path)
    for file in tmp_path.rglob(kind):
        os.truncate(file, left)
    assert fresh(CODE + SAY, tmp_path)[:2] == ["0", "1"]
    assert fresh(CODE + SAY, tmp_path)[:2] == ["1", "0"]


@pytest.mark.parametrize("options", ["size=4k", pytest.param("nr_inodes=3", marks=pytest.mark.long)])
def test_nothing_is_cached_on_a_full_disk(tmp_path, options):
    with mounted(tmp_path / "disk", options) as folder:
        assert fresh(CODE + SAY, folder)[:2] == ["0", "1"]


def test_several_processes_fill_one_folder(tmp_path):
    with ThreadPoolExecutor(2) as pool:
        for hits, misses, _ in pool.map(fresh, [CODE + SAY] * 2, [tmp_path] * 2):
            assert int(hits) + int(misses) == 1
    assert fresh(CODE + SAY, tmp_path)[:2] == ["1", "0"]


def test_without_a_folder_every_process_compiles(tmp_path):
    (tmp_path / "camopt").write_text("no folder")
    assert fresh(CODE + "print(f.stats.cache_path)", tmp_path) == ["None"]


def test_a_change_of_any_source_is_another_program(tmp_path, monkeypatch):
    """The digest of a file changes if a called file or a constant is changed, or if a file is added to the folder."""
    monkeypatch.setattr(programs, "PACKAGE", tmp_path)
    monkeypatch.setattr(programs, "CONSTANTS", (tmp_path / "units.py",))
    caller, callee, alone = tmp_path / "exact/caller.py", tmp_path / "exact/kernel/callee.py", tmp_path / "study/one.py"
    for file in (caller, callee, alone, tmp_path / "units.py"):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("a = 1")
    seen = set()
    for changed in (None, callee, tmp_path / "units.py", caller.with_name("added.py")):
        if changed:
            changed.write_text("a = 2")
        digest.cache_clear()
        seen.add(digest(caller))
    assert len(seen) == 4
    before = digest(alone)
    callee.write_text("a = 3")
    digest.cache_clear()
    assert digest(alone) == before  # it does not depend on the changed file
    digest.cache_clear()


def test_old_programs_of_other_versions_are_removed(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    above = cache_folder(f"numba-{programs.numba.__version__}")
    assert above is not None
    (above / "exact-new").mkdir()
    (above / "exact-old").mkdir()
    old = time.time() - (programs.KEPT_DAYS + 1) * 86400
    os.utime(above / "exact-old", (old, old))
    programs._folder.cache_clear()
    file = PACKAGE / "exact/engine.py"
    folder = programs._folder(file)
    programs._folder.cache_clear()
    assert folder is not None and {p.name for p in above.iterdir()} == {"exact-new", folder.name}


def test_options_reach_numba():
    assert compiled(lambda x: x + 1)(1) == 2
    assert compiled(fastmath=True)(lambda x: x * 2.0).targetoptions["fastmath"]


def test_an_inner_function_is_compiled_within_the_program_that_calls_it_and_nowhere_else():
    @inner
    def root(x):
        if x < 0.0:
            raise ValueError("no root")
        return np.sqrt(x)

    @inner
    def twice(x):
        return 2.0 * root(x)

    @compiled
    def program(x):
        return twice(x) + root(x)

    assert program(4.0) == 6.0
    with pytest.raises(ValueError, match="no root"):
        program(-1.0)
    made = [next(iter(function.overloads.values())).library._compiled for function in (root, twice, program)]
    assert made == [False, False, True]


@pytest.mark.parametrize("path", files_that_compile(), ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_the_sources_of_a_program_include_all_its_constants_and_programs(path):
    """The sources of a file with programs include every camopt module from which it imports constants or programs."""
    listed = sources(path)
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("camopt."):
            continue
        file = (PACKAGE.parent / node.module.replace(".", "/")).with_suffix(".py")
        constants = [
            a.name for a in node.names if a.name.isupper() and a.name != "GROUND"
        ]  # part of the format, always -1
        if constants or (file.exists() and file in files_that_compile()):
            assert file in listed, f"{path.name} compiles in what {node.module} holds"


def compiled_as(node: ast.AST) -> tuple[str, bool] | None:
    """The decorator that compiles a function, and whether Python may call it; None for an uncompiled function."""
    for decorator in node.decorator_list if isinstance(node, ast.FunctionDef) else []:
        call = decorator if isinstance(decorator, ast.Call) else None
        name = ast.unparse(call.func if call else decorator)
        if name in ("compiled", "inner", "njit_no_refcount", "njit"):
            return name, name in ("compiled", "njit")
    return None


def uncompiled_names(node: ast.AST):
    """Names that are read outside compiled functions, with their line numbers."""
    for part in ast.iter_child_nodes(node):
        if compiled_as(part):
            continue
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Load):
            yield part.id, part.lineno
        yield from uncompiled_names(part)


def run_by_python(tree: ast.Module) -> bool:
    """Whether an autouse fixture runs a module's compiled functions as plain Python (tests/exact/interpreted)."""
    fixtures = (
        node
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and any("autouse=True" in ast.unparse(decorator) for decorator in node.decorator_list)
    )
    return any(ast.unparse(node.body[0]).startswith("interpret(monkeypatch, __name__") for node in fixtures)


def test_python_calls_no_function_without_a_python_entry_point():
    """Such a function has no entry point for Python: the call would crash the process."""
    root = PACKAGE.parent
    files = [file for folder in ("camopt", "tests", "experiments") for file in (root / folder).rglob("*.py")]
    texts = {".".join(file.relative_to(root).with_suffix("").parts): file.read_text() for file in files}
    without_entry = {
        (module, node.name)
        for module, text in texts.items()
        if re.search("^@(inner|compiled|njit)", text, re.MULTILINE)
        for node in ast.parse(text).body
        if (kind := compiled_as(node)) and not kind[1]
    }
    assert len(without_entry) > 50
    named = re.compile(rf"\b({'|'.join({name for _, name in without_entry})})\b")
    for module, text in texts.items():
        if not named.search(text):
            continue
        tree = ast.parse(text)
        if run_by_python(tree):
            continue
        imported = {
            alias.asname or alias.name: (node.module, alias.name)
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        own = {name: (module, name) for where, name in without_entry if where == module}
        for name, line in uncompiled_names(tree):
            assert (imported | own).get(name) not in without_entry, f"{module}, line {line}: {name}"


def test_the_listed_folders_and_files_exist():
    assert all((PACKAGE / folder).is_dir() for folder in TOGETHER) and all(path.is_file() for path in CONSTANTS)
    assert Path(camopt.__file__).parent == PACKAGE


@pytest.mark.parametrize("mode", [0o777, 0o722])
def test_a_folder_that_others_may_write_to_is_not_used(tmp_path, monkeypatch, mode):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = tmp_path / "camopt/jax"
    folder.mkdir(parents=True)
    folder.chmod(mode)
    assert cache_folder("jax") is None
    folder.chmod(0o700)
    assert cache_folder("jax") == folder


@pass_by_pointer
class Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


class Holding(NamedTuple):
    pair: Pair
    third: np.ndarray


@numba.njit
def of_record(pair):
    return pair.first[0] + pair.second[1]


@numba.njit
def of_tuple(holding):
    holding.pair.first[0] += 1.0
    return of_record(holding.pair) + holding.third[0]


def test_fields_are_read_and_written_without_reference_leaks():
    first, second, third = np.array([1.0, 2.0]), np.array([10.0, 20.0]), np.array([100.0])
    before = [sys.getrefcount(array) for array in (first, second, third)]
    for i in range(50):
        assert of_record(Pair(first, second)) == 21.0 + i
        assert of_tuple(Holding(Pair(first, second), third)) == 122.0 + i
    assert [sys.getrefcount(array) for array in (first, second, third)] == before
