"""The notebooks of the repository, plain percent scripts, as Sphinx reads them: with the outputs that are stored."""

import re
from pathlib import Path

import jupytext
import nbformat

NOTEBOOKS = Path(__file__).parents[2] / "notebooks"
"""Percent scripts, and beside each the notebook that `python -m docs.record_notebooks` made of it."""


def notebook(text: str) -> nbformat.NotebookNode:
    """A percent script with the outputs of its cells, which stand where a run would have put them, and with its links
    to pages as they are within the site.

    ValueError where its code is not that whose outputs are stored.
    """
    found = read_script(re.sub(r"\]\(\.\./docs/", "](../", text))
    outputs = stored_outputs().get(code(found))
    if outputs is None:
        raise ValueError(
            "the code of a notebook has changed since its outputs were stored: python -m docs.record_notebooks"
        )
    for cell, shown in zip(code_cells(found), outputs, strict=True):
        cell.outputs = shown
    return found


def read_script(text: str) -> nbformat.NotebookNode:
    """A percent script as a notebook of Python."""
    found = jupytext.reads(text, fmt="py:percent")
    found.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    found.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    return found


def code_cells(found: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """The cells that run."""
    return [cell for cell in found.cells if cell.cell_type == "code"]


def code(found: nbformat.NotebookNode) -> tuple[str, ...]:
    """The code of a notebook, to which its outputs belong, cell by cell."""
    return tuple(cell.source for cell in code_cells(found))


def stored_outputs() -> dict[tuple[str, ...], list]:
    """Outputs cell by cell, by the code that made them."""
    stored = [nbformat.read(path, as_version=4) for path in NOTEBOOKS.glob("*.ipynb")]
    return {code(one): [cell.outputs for cell in code_cells(one)] for one in stored}
