"""The stored outputs of the notebooks are those of the notebooks' code, and nothing in them is of one machine."""

from pathlib import Path

import pytest

pytest.importorskip("jupytext", reason="the extra `docs` is not installed; .ci/run installs it")
from docs.generators.notebook import OUTPUTS, code_cells, notebook

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.py"))


def test_every_notebook_has_one_file_of_outputs():
    assert {path.stem for path in OUTPUTS.glob("*.json")} == {path.stem for path in NOTEBOOKS}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_the_outputs_are_those_of_its_code(path):
    cells = code_cells(notebook(path.read_text(encoding="utf-8")))
    kinds = {kind for cell in cells for output in cell.outputs for kind in output.get("data", {})}
    assert "image/png" in kinds and "application/vnd.jupyter.widget-view+json" not in kinds
    for cell in cells:
        pictures = [output["data"]["image/png"] for output in cell.outputs if "image/png" in output.get("data", {})]
        assert len(pictures) == len(set(pictures)), f"a figure is shown twice: {cell.source}"
    text = str([cell.outputs for cell in cells])
    assert "/tmp/" not in text and "/root/" not in text and "Traceback" not in text


def test_other_code_has_no_outputs():
    with pytest.raises(ValueError, match=r"docs\.record_notebooks"):
        notebook(NOTEBOOKS[0].read_text(encoding="utf-8") + "\n# %%\n1 + 1\n")
