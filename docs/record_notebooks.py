"""Runs the notebooks at their small size and writes what their cells show.

`python -m docs.record_notebooks [NAME ...]` runs those that are named, or all.

The site shows these outputs and runs nothing, so that it builds in a fresh environment without compiling anything.
`tests/test_notebooks.py` runs the notebooks themselves, and `tests/site/test_notebook_outputs.py` holds the stored
outputs against their code.
"""

import os
import sys
import tempfile
from pathlib import Path

import nbclient
from nbformat.v4 import new_code_cell

from camopt.storage import write_json
from docs.generators.notebook import OUTPUTS, code_cells, digest, percent_script
from experiments.support.provenance import provenance

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
FIRST = """
import sys
sys.modules["ipywidgets"] = None  # a page has no kernel that a slider could ask
import matplotlib.pyplot as plt
plt.rcParams["figure.dpi"] = 72
"""
SHOWN = ("image/png", "text/html", "text/markdown", "text/plain")
"""Kinds of output that a page can show; the first that an output has is kept."""


def recorded(path: Path) -> dict:
    """A notebook's outputs cell by cell, and its code, to which they belong."""
    notebook = percent_script(path.read_text(encoding="utf-8"))
    found = {
        "provenance": provenance(path.stem, "small") | {"command": "python -m docs.record_notebooks"},
        "code": digest(notebook),
    }
    notebook.cells.insert(0, new_code_cell(FIRST))
    with tempfile.TemporaryDirectory() as folder:
        nbclient.NotebookClient(notebook, timeout=None, resources={"metadata": {"path": folder}}).execute()
    cells = code_cells(notebook)[1:]
    return found | {"cells": [[kept(one) for one in cell.outputs if one.get("name") != "stderr"] for cell in cells]}


def kept(output: dict) -> dict:
    """An output as nbformat has it, with the one representation that the page shows."""
    if output["output_type"] == "stream":
        return {key: output[key] for key in ("output_type", "name", "text")}
    kind = next(kind for kind in SHOWN if kind in output["data"])
    return {"output_type": "display_data", "metadata": {}, "data": {kind: output["data"][kind]}}


def main() -> None:
    """Records the notebooks that are named, or all."""
    os.environ["CAMOPT_NOTEBOOK_SIZE"] = "small"
    os.environ["PYTHONPATH"] = str(NOTEBOOKS.parent)  # camopt as this checkout has it
    for path in sorted(NOTEBOOKS.glob("*.py")):
        if path.stem in sys.argv[1:] or not sys.argv[1:]:
            write_json(OUTPUTS / f"{path.stem}.json", recorded(path))
            print(path.stem, flush=True)


if __name__ == "__main__":
    main()
