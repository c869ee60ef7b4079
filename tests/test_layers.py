"""The layers of the design, read from the imports: imports point one way, and names come from the defining module."""

import ast
import re
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import camopt
from tests.fresh_processes import LIBRARIES, run_each

ROOT = Path(camopt.__file__).parent
SUPPORT = {"scene", "storage", "plots"}
MAY_IMPORT = {
    "cache": set(),
    "memory": set(),
    "programs": {"cache"},
    "highs": set(),
    "storage": {"scene"},
    "scene": set(),
    "plots": {"scene", "cam", "storage"},  # the colours of cam families; other arguments are arrays
    "cam": {"highs", "scene", "storage"},
    "measure": {"cam", "programs"} | SUPPORT,
    "smooth": {"cam", "exact", "scene", "cache"},
    "exact": {"cam", "programs", "memory"} | SUPPORT,
    "verifier": {"cam", "measure", "programs"} | SUPPORT,
    "optimizer": {"highs", "cam", "measure", "smooth", "exact", "verifier", "programs"} | SUPPORT,
    "tasks": {"cam", "optimizer", "scene", "storage"},
    "study": {"highs", "cam", "measure", "smooth", "exact", "verifier", "optimizer", "programs", "tasks"} | SUPPORT,
    "report": {"cam", "measure", "smooth", "exact", "verifier", "optimizer", "study"} | SUPPORT,
    "designer": {"highs", "cam", "measure", "exact", "verifier", "optimizer", "report"} | SUPPORT,
}
TOP = {"__init__", "__main__", "cli"}
WITHOUT_JAX = ("scene", "cam", "measure", "exact", "verifier", "plots", "storage")
JAX = {"jax", "jaxlib", "diffrax", "equinox", "optax"}
VERDICT = "verifier/verdict.py"
"""The one file of the verifier that may compare with `exact`."""
UPWARD = {
    VERDICT: {"exact"},
    "cam/lift.py": {"plots"},
    "tasks/compute.py": {"study"},
}
"""The three files that may import a higher layer: the verdict, the lift law (for its plot method), and the computation
of tasks, which loads the function of a verb."""


def modules() -> list[Path]:
    return sorted(p for p in ROOT.rglob("*.py"))


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """All syntax nodes of a file."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def layer(path: Path) -> str:
    first = path.relative_to(ROOT).parts[0]
    return first.removesuffix(".py")


@cache
def imported(path: Path) -> set[str]:
    """Every dotted name that a file imports, at any depth; relative imports are resolved."""
    names = set()
    package = ["camopt", *path.relative_to(ROOT).parent.parts]
    for node in nodes(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            stem = ".".join([*base, *([node.module] if node.module else [])])
            names |= {stem} | {f"{stem}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("camopt."):
            names.add(node.value)  # names of modules for lazy imports
    return names


def layers_imported(path: Path) -> set[str]:
    parts = (name.split(".") for name in imported(path))
    return {p[1] for p in parts if p[0] == "camopt" and len(p) > 1} & {*MAY_IMPORT, *TOP}


def test_imports_point_downward():
    """Imports point downward, except those of UPWARD; layers without JAX do not import it."""
    wrong = {}
    for path in modules():
        own = layer(path)
        assert own in MAY_IMPORT or own in TOP, f"a new layer {own}: place it in MAY_IMPORT"
        beyond = {name.split(".")[0] for name in imported(path)} & JAX if own in WITHOUT_JAX else set()
        if own in MAY_IMPORT:
            upward = UPWARD.get(path.relative_to(ROOT).as_posix(), set())
            beyond |= layers_imported(path) - MAY_IMPORT[own] - {own} - upward
        if beyond:
            wrong[dotted(path)] = beyond
    assert not wrong


def test_the_table_of_layers_for_contributors_is_complete():
    """The table in CONTRIBUTING.md has the layers of MAY_IMPORT and their permitted imports, and no others."""
    text = (ROOT.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `camopt/(\w+)` \|.*\| ([^|]+) \|$", text, re.MULTILINE)
    table = {layer: set() if names == "\u2013" else set(names.split(", ")) for layer, names in rows}
    assert table == MAY_IMPORT


def test_the_import_reader_sees_every_kind_of_import(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    (tmp_path / "scene").mkdir()
    file = tmp_path / "scene" / "a.py"
    file.write_text(
        "import camopt.exact.engine\nfrom camopt import smooth\nfrom ..verifier.methods import rkg\n"
        "def f():\n    from camopt.cam.lift import Lift\n    import_module('camopt.report.page')\n"
    )
    assert layers_imported(file) == {"exact", "smooth", "verifier", "cam", "report"}


JOB = (
    "camopt.optimizer.run", "camopt.optimizer.search.search", "camopt.optimizer.baselines.comparison",
    "camopt.report",
)  # fmt: skip
"""Modules that `camopt optimize --gradient exact` loads."""


METHODS = tuple(f"camopt.verifier.methods.{name}" for name in ("dop853", "houbolt", "rkg", "tmm"))
VERIFIER = ("camopt.verifier", "camopt.verifier.verdict", "camopt.verifier.accuracy", *METHODS)
"""Modules whose import loads neither JAX nor jaxtyping nor `camopt.exact`."""
LEAN = (*VERIFIER, "camopt", "camopt.scene", "camopt.cam.read", "camopt.exact", "camopt.cli", *JOB)
"""Modules whose import loads neither JAX nor jaxtyping."""


def test_imports_do_not_load_unneeded_libraries():
    """Every module of LEAN, and one that needs JAX as a counter-example, is the first import of a new process."""
    snippet = "import sys, {}; assert not {} & {{*sys.modules}}"
    lean = {module: {"jax", "jaxtyping"} for module in (*LEAN, "camopt.smooth")}
    heavy = lean | {module: {"jax", "jaxtyping", "camopt.exact"} for module in VERIFIER}
    ended = run_each({module: snippet.format(module, names) for module, names in heavy.items()})
    assert {module for module, code in ended.codes.items() if code} == {"camopt.smooth"}, ended.said


def test_double_precision_is_switched_on_in_one_place():
    """JAX has one such switch for the whole process, and importing `camopt.smooth` sets it."""
    assert [p for p in modules() if 'jax_enable_x64"' in p.read_text()] == [ROOT / "smooth" / "__init__.py"]
    switched = "import jax; assert jax.config.jax_enable_x64"
    ended = run_each({"none": switched, "smooth": f"import camopt.smooth; {switched}"}, ("jax",))
    assert ended.codes == {"none": 1, "smooth": 0}, ended.said


def dotted(path: Path) -> str:
    return ".".join(("camopt", *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__")


def modules_imported(path: Path, names: set[str]) -> set[str]:
    """The modules out of `names` that a file imports, including imports inside functions, under `if TYPE_CHECKING`
    and by a string with the name of a module."""
    imports = set()
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom):
            full = {f"{node.module}.{alias.name}" for alias in node.names}
            imports |= {name if name in names else node.module for name in full}
        elif isinstance(node, ast.Import):
            imports |= {alias.name for alias in node.names}
        elif isinstance(node, ast.Constant) and not dotted(path).startswith(f"{node.value}."):
            imports.add(node.value)
    return imports & names - {dotted(path)}


def test_there_is_no_cycle_of_imports():
    """All imports count, also lazy ones and those that only a type checker evaluates."""
    names = {dotted(path) for path in modules()}
    imports = {dotted(path): modules_imported(path, names) for path in modules()}
    TopologicalSorter(imports).prepare()  # raises CycleError, which names the modules of a cycle


def test_no_two_classes_share_a_name():
    """The name of a class is unique in the whole package, with or without a leading underscore."""
    places: dict[str, list[str]] = {}
    for path in modules():
        for node in nodes(path):
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name.lstrip("_"), []).append(dotted(path))
    assert not {name: homes for name, homes in places.items() if len(homes) > 1}


@pytest.mark.long
def test_every_module_can_be_imported_first():
    """Each module is the first import of camopt in its process; this must work, since there are no cycles."""
    names = [dotted(path) for path in modules() if path.stem != "__main__"]
    ended = run_each({name: f"import {name}" for name in names}, (*LIBRARIES, "jax", "diffrax"))
    assert not any(ended.codes.values()), ended.said


def defined(path: Path) -> set[str]:
    """Names that a module defines, or imports under a new name in order to re-export them."""
    names = set()
    for node in nodes(path):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {part.id for t in targets for part in ast.walk(t) if isinstance(part, ast.Name)}
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names |= {alias.asname for alias in node.names if alias.asname}
    return names


def test_a_name_is_imported_from_the_module_that_defines_it():
    """A name is not imported from a module that only imports it; packages may re-export names."""
    definitions = {dotted(path): defined(path) for path in modules() if path.stem != "__init__"}
    wrong = [
        (dotted(path), node.module, alias.name)
        for path in modules()
        for node in nodes(path)
        if isinstance(node, ast.ImportFrom) and node.module in definitions
        for alias in node.names
        if alias.name not in definitions[node.module]
    ]
    assert not wrong


def test_files_have_at_most_300_lines_and_telling_names():
    assert not [p for p in modules() if len(p.read_text(encoding="utf-8").splitlines()) > 300]
    assert not {path.stem for path in modules()} & {"utils", "helpers", "common", "misc"}
