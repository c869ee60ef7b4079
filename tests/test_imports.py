"""A name is imported from the module that defines it, not from one that happens to import it too."""

import ast
from functools import cache
from pathlib import Path

import pytest

import camopt

ROOT = Path(camopt.__file__).parent


@cache
def named(source: Path) -> set[str]:
    """Names that a module defines, or imports under a name of its own to hand them on."""
    found = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {part.id for t in targets for part in ast.walk(t) if isinstance(part, ast.Name)}
        elif isinstance(node, ast.Import | ast.ImportFrom):
            found |= {alias.asname for alias in node.names if alias.asname}
    return found


@pytest.mark.parametrize("path", sorted(ROOT.rglob("*.py")), ids=lambda p: p.relative_to(ROOT).as_posix())
def test_names_come_from_where_they_are_defined(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("camopt."):
            source = (ROOT.parent / str(node.module).replace(".", "/")).with_suffix(".py")
            if source.exists():  # not a package, which may gather names
                assert {alias.name for alias in node.names} <= named(source), (path.name, node.module)
