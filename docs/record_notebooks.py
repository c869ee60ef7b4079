"""Runs the notebooks at their small size and stores each with its outputs: `notebooks/NAME.ipynb` beside `NAME.py`.

`python -m docs.record_notebooks [NAME ...]` runs the named notebooks, or all.

The percent script is edited, by hand or through jupytext; the notebook is made for reading. The site shows its outputs
and runs no notebook, so that it builds in a new environment without compiling anything. `tests/test_notebooks.py` runs
the scripts themselves, and `tests/site/test_notebook_outputs.py` compares the notebooks with them.
"""

import os
import sys
import tempfile
from pathlib import Path

import nbclient
import nbformat
from nbformat.v4 import new_code_cell

from camopt.storage import write_text
from docs.generators.notebook import NOTEBOOKS, code_cells, read_script
from experiments.support.record import provenance

FIRST = """
import sys
sys.modules["ipywidgets"] = None  # a page has no kernel that a slider could ask
import matplotlib.pyplot as plt
plt.rcParams["figure.dpi"] = 72
"""
SHOWN = ("image/png", "text/html", "text/markdown", "text/plain")
"""Kinds of output that a page can show, in order of preference; only the first available one is stored."""


def recorded(path: Path) -> nbformat.NotebookNode:
    """The notebook of a percent script, with the outputs of its cells."""
    notebook = read_script(path.read_text(encoding="utf-8"))
    notebook.cells.insert(0, new_code_cell(FIRST))
    with tempfile.TemporaryDirectory() as folder:
        nbclient.NotebookClient(notebook, timeout=None, resources={"metadata": {"path": folder}}).execute()
    notebook.cells.pop(0)
    for number, cell in enumerate(notebook.cells):
        cell.id = f"{path.stem}-{number}".replace("_", "-")[:64]  # the same ids in every recording
        cell.metadata = {}
    for number, cell in enumerate(code_cells(notebook)):
        cell.execution_count = number + 1
        cell.outputs = [kept(one) for one in cell.outputs if one.get("name") != "stderr"]
    notebook.metadata["camopt"] = {"provenance": provenance("python -m docs.record_notebooks")}
    return notebook


def kept(output: dict) -> nbformat.NotebookNode:
    """An output in nbformat, reduced to the representation that the page shows."""
    if output["output_type"] == "stream":
        return nbformat.from_dict({key: output[key] for key in ("output_type", "name", "text")})
    kind = next(kind for kind in SHOWN if kind in output["data"])
    data = {kind: output["data"][kind]}
    return nbformat.from_dict({"output_type": "display_data", "metadata": {}, "data": data})


def main() -> None:
    """Records the named notebooks, or all."""
    os.environ["CAMOPT_NOTEBOOK_SIZE"] = "small"
    os.environ["PYTHONPATH"] = str(NOTEBOOKS.parent)  # the camopt of this checkout
    for path in sorted(NOTEBOOKS.glob("*.py")):
        if path.stem in sys.argv[1:] or not sys.argv[1:]:
            write_text(path.with_suffix(".ipynb"), nbformat.writes(recorded(path)) + "\n")
            print(path.stem, flush=True)


if __name__ == "__main__":
    main()
