"""Each notebook agrees with its script, its outputs come from its code, and they contain no machine-specific paths."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("jupytext", reason="the extra `docs` is not installed; .ci/run installs it")
import nbformat

from docs.generators.notebook import NOTEBOOKS, code_cells, notebook, read_script

SCRIPTS = sorted(NOTEBOOKS.glob("*.py"))


def stored(path: Path) -> nbformat.NotebookNode:
    """The stored notebook of a script."""
    return nbformat.read(path.with_suffix(".ipynb"), as_version=4)


def test_every_script_has_one_notebook():
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == {path.stem for path in SCRIPTS}


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda p: p.stem)
def test_the_notebook_agrees_with_its_script(path):
    """Compares text and code cell by cell; `python -m docs.record_notebooks NAME` updates a notebook."""
    made, kept = read_script(path.read_text(encoding="utf-8")), stored(path)
    contents = [[(cell.cell_type, cell.source) for cell in document.cells] for document in (kept, made)]
    assert contents[0] == contents[1]
    assert kept.metadata["kernelspec"] == made.metadata["kernelspec"]
    nbformat.validate(kept)


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda p: p.stem)
def test_the_stored_outputs_belong_to_the_code(path):
    cells = code_cells(notebook(path.read_text(encoding="utf-8")))
    kinds = {kind for cell in cells for output in cell.outputs for kind in output.get("data", {})}
    assert "image/png" in kinds and "application/vnd.jupyter.widget-view+json" not in kinds
    for cell in cells:
        pictures = [output["data"]["image/png"] for output in cell.outputs if "image/png" in output.get("data", {})]
        assert len(pictures) == len(set(pictures)), f"a figure is shown twice: {cell.source}"
    text = str([cell.outputs for cell in cells])
    assert "/tmp/" not in text and "/root/" not in text and "Traceback" not in text


def test_changed_code_has_no_outputs():
    with pytest.raises(ValueError, match=r"docs\.record_notebooks"):
        notebook(SCRIPTS[0].read_text(encoding="utf-8") + "\n# %%\n1 + 1\n")


@pytest.mark.long
@pytest.mark.timeout(900)
@pytest.mark.parametrize("path", SCRIPTS, ids=lambda p: p.stem)
def test_nbconvert_executes_it(path, tmp_path):
    pytest.importorskip("nbconvert")
    command = [sys.executable, "-m", "nbconvert", "--to", "notebook", "--execute", "--output-dir", str(tmp_path)]
    environment = os.environ | {"CAMOPT_NOTEBOOK_SIZE": "small", "PYTHONPATH": str(NOTEBOOKS.parent)}
    subprocess.run([*command, str(path.with_suffix(".ipynb"))], cwd=tmp_path, env=environment, check=True)
    cells = code_cells(nbformat.read(tmp_path / f"{path.stem}.ipynb", as_version=4))
    assert all(cell.execution_count for cell in cells)
    assert not any(output.output_type == "error" for cell in cells for output in cell.outputs)
