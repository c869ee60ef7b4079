"""The notebooks of the repository, plain percent scripts, as Sphinx reads them: with the outputs that are stored."""

import hashlib
import json
import re
from pathlib import Path

import jupytext
import nbformat

OUTPUTS = Path(__file__).parents[1] / "outputs"
"""What `python -m docs.record_notebooks` wrote, a file for each notebook."""


def notebook(text: str) -> nbformat.NotebookNode:
    """A percent script with the outputs of its cells, which stand where a run would have put them.

    ValueError where its code is not that whose outputs are stored.
    """
    found = percent_script(text)
    outputs = stored_outputs().get(digest(found))
    if outputs is None:
        raise ValueError(
            "the code of a notebook has changed since its outputs were stored: python -m docs.record_notebooks"
        )
    for cell, shown in zip(code_cells(found), outputs, strict=True):
        cell.outputs = [nbformat.from_dict(one) for one in shown]
    return found


def percent_script(text: str) -> nbformat.NotebookNode:
    """A percent script as a notebook of Python, with its links to pages as they are within the site."""
    found = jupytext.reads(re.sub(r"\]\(\.\./docs/", "](../", text), fmt="py:percent")
    found.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    found.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    return found


def code_cells(found: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """The cells that run."""
    return [cell for cell in found.cells if cell.cell_type == "code"]


def digest(found: nbformat.NotebookNode) -> str:
    """SHA-256 of a notebook's code, to which its outputs belong."""
    return hashlib.sha256("\n".join(cell.source for cell in code_cells(found)).encode()).hexdigest()


def stored_outputs() -> dict[str, list]:
    """Outputs cell by cell, by the digest of the code that made them."""
    records = [json.loads(path.read_text(encoding="utf-8")) for path in OUTPUTS.glob("*.json")]
    return {one["code"]: one["cells"] for one in records}
