"""Source code of the package for a page, read from its file, so that the page always shows the current code."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]


def source(content: str) -> str:
    """A file of the repository as a code block; names after the path select functions, classes and constants."""
    path, *names = content.split()
    text = (ROOT / path).read_text(encoding="utf-8")
    if names:
        text = "\n\n".join(_named(text, name) for name in names)
    return f"`{path}`:\n\n```python\n{text.strip()}\n```\n"


def _named(text: str, name: str) -> str:
    """The definition of a name in a file, at any depth, with its decorators; KeyError if there is none."""
    lines = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        names = [t.id for t in node.targets if isinstance(t, ast.Name)] if isinstance(node, ast.Assign) else []
        if name in (*names, getattr(node, "name", None)) and isinstance(node, ast.stmt):
            first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", []))])
            return "\n".join(lines[first - 1 : node.end_lineno])
    raise KeyError(name)
