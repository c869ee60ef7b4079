"""The layers of the design, read from the imports: arrows point one way, and the verifier stands alone."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import camopt

ROOT = Path(camopt.__file__).parent
SUPPORT = {"scene", "storage", "plots"}  # plots is a leaf: its arguments are arrays
MAY_IMPORT = {
    "storage": {"scene"},
    "scene": set(),
    "plots": {"scene"},
    "cam": SUPPORT,
    "measure": {"cam"} | SUPPORT,
    "smooth": {"cam", "scene"},
    "exact": {"cam"} | SUPPORT,
    "verifier": {"cam", "measure"} | SUPPORT,
    "differentiable": {"cam", "smooth", "exact", "scene"},
    "optimizer": {"cam", "measure", "smooth", "exact", "verifier", "differentiable"} | SUPPORT,
    "study": {"cam", "measure", "smooth", "exact", "verifier", "differentiable", "optimizer"} | SUPPORT,
    "report": {"cam", "measure", "smooth", "exact", "verifier", "optimizer", "study"} | SUPPORT,
}
TOP = {"__init__", "__main__", "cli"}
WITHOUT_JAX = ("scene", "cam", "measure", "exact", "verifier", "plots", "storage")
JAX = {"jax", "jaxlib", "diffrax", "equinox", "optax", "jaxtyping"}
VERDICT = "verifier/verdict.py"
"""The one file of the verifier that may compare with `exact`."""


def modules() -> list[Path]:
    return sorted(p for p in ROOT.rglob("*.py"))


def layer(path: Path) -> str:
    first = path.relative_to(ROOT).parts[0]
    return first.removesuffix(".py")


def imported(path: Path) -> set[str]:
    """Every dotted name that a file imports, at any depth; relative imports are resolved."""
    names = set()
    package = ["camopt", *path.relative_to(ROOT).parent.parts]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            stem = ".".join([*base, *([node.module] if node.module else [])])
            names |= {stem} | {f"{stem}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("camopt."):
            names.add(node.value)  # modules named for a lazy import
    return names


def layers_imported(path: Path) -> set[str]:
    parts = (name.split(".") for name in imported(path))
    return {p[1] for p in parts if p[0] == "camopt" and len(p) > 1} & {*MAY_IMPORT, *TOP}


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_point_downward(path):
    own = layer(path)
    if own in TOP:
        return
    assert own in MAY_IMPORT, f"a new layer {own}: place it in MAY_IMPORT"
    allowed = MAY_IMPORT[own] | {own} | ({"exact"} if path == ROOT / VERDICT else set())
    assert layers_imported(path) <= allowed


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_verifier_is_independent(path):
    names = imported(path)
    roots = {n.split(".")[0] for n in names}
    if layer(path) in WITHOUT_JAX:
        assert not roots & JAX
    if layer(path) == "verifier" and path != ROOT / VERDICT:
        assert not {n for n in names if n.startswith("camopt.exact")}


def test_the_table_of_layers_for_contributors_is_this_one():
    """CONTRIBUTING.md tells every layer of MAY_IMPORT, with what it may import, and no other."""
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
    "camopt.optimizer.run", "camopt.optimizer.search.gradient_stage", "camopt.optimizer.baselines.comparison",
    "camopt.report",
)  # fmt: skip
"""What `camopt optimize` loads where gradients are exact."""


@pytest.mark.parametrize(
    "module",
    ["camopt", "camopt.verifier.verdict", "camopt.scene", "camopt.cam.read", "camopt.exact", "camopt.cli", *JOB],
)
def test_import_leaves_no_jax(module):
    code = f"import sys, {module}; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_files_stay_readable(path):
    assert len(path.read_text().splitlines()) <= 300
    assert path.stem not in {"utils", "helpers", "common", "misc"}
