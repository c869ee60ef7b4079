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
    made = read_script(re.sub(r"\]\(\.\./docs/", "](../", text))
    outputs = stored_outputs().get(code(made))
    if outputs is None:
        raise ValueError(
            "the code of a notebook has changed since its outputs were stored: python -m docs.record_notebooks"
        )
    for cell, shown in zip(code_cells(made), outputs, strict=True):
        cell.outputs = shown
    return made


def read_script(text: str) -> nbformat.NotebookNode:
    """A percent script as a Python notebook."""
    made = jupytext.reads(text, fmt="py:percent")
    made.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    made.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    return made


def code_cells(document: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """The code cells."""
    return [cell for cell in document.cells if cell.cell_type == "code"]


def code(document: nbformat.NotebookNode) -> tuple[str, ...]:
    """The code of a notebook, cell by cell, which identifies its stored outputs."""
    return tuple(cell.source for cell in code_cells(document))


def stored_outputs() -> dict[tuple[str, ...], list]:
    """The outputs of every stored notebook, cell by cell, by its code."""
    documents = [nbformat.read(path, as_version=4) for path in NOTEBOOKS.glob("*.ipynb")]
    return {code(document): [cell.outputs for cell in code_cells(document)] for document in documents}
