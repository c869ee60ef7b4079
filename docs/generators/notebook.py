"""The notebooks of the repository, which are percent scripts, for Sphinx: with their stored outputs."""

import re
from pathlib import Path

import jupytext
import nbformat

NOTEBOOKS = Path(__file__).parents[2] / "notebooks"
"""Folder of the percent scripts and of the notebooks that `python -m docs.record_notebooks` makes from them."""


def notebook(text: str) -> nbformat.NotebookNode:
    """A percent script as a notebook with the stored outputs of its cells, and with links to pages as on the site.

    Raises ValueError if there are no stored outputs of its code.
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
    """A percent script as a Python notebook."""
    found = jupytext.reads(text, fmt="py:percent")
    found.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    found.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    return found


def code_cells(found: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """The code cells."""
    return [cell for cell in found.cells if cell.cell_type == "code"]


def code(found: nbformat.NotebookNode) -> tuple[str, ...]:
    """The code of a notebook, cell by cell, which identifies its stored outputs."""
    return tuple(cell.source for cell in code_cells(found))


def stored_outputs() -> dict[tuple[str, ...], list]:
    """The outputs of every stored notebook, cell by cell, by its code."""
    stored = [nbformat.read(path, as_version=4) for path in NOTEBOOKS.glob("*.ipynb")]
    return {code(one): [cell.outputs for cell in code_cells(one)] for one in stored}
