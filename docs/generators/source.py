"""Code of the package on a page, read from its file, so that the page shows what runs."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]


def source(content: str) -> str:
    """A file of the repository as a block of code or, where names follow it, those functions, classes and numbers."""
    path, *names = content.split()
    text = (ROOT / path).read_text(encoding="utf-8")
    if names:
        text = "\n\n".join(_named(text, name) for name in names)
    return f"`{path}`:\n\n```python\n{text.strip()}\n```\n"


def _named(text: str, name: str) -> str:
    """What a file says under a name, at any depth, with its decorators; KeyError where it says nothing."""
    lines = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        names = [t.id for t in node.targets if isinstance(t, ast.Name)] if isinstance(node, ast.Assign) else []
        if name in (*names, getattr(node, "name", None)) and isinstance(node, ast.stmt):
            first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", []))])
            return "\n".join(lines[first - 1 : node.end_lineno])
    raise KeyError(name)
