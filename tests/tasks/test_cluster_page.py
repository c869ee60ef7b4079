"""The experiment of docs/how-to/cluster.md: its function here, and its script with a local cluster of dask."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import camopt

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "cluster.md"
ARGUMENTS = {"scene": "motori-1", "start": "calmest", "optimiser": "adam", "rate": 1e-3, "width_um": 1.0, "steps": 1}


@pytest.fixture
def files(tmp_path):
    """The page's two files in a folder of their own."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    for name, text in zip(("climbs.py", "sweep_climbs.py"), blocks, strict=True):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_a_row_of_the_function(files, monkeypatch):
    monkeypatch.syspath_prepend(files)
    task = {"verb": "call", "function": "climbs:climb", "arguments": ARGUMENTS}
    found = camopt.sweep([task], files / "one.sqlite", workers=0).dataset()
    assert 0.1 < float(found["area_ratio"][0]) < 0.6  # about the calmest cam's; the largest known is 0.58
    assert float(found["contact_force_N"][0]) > -250.0  # its tied motion is tame


@pytest.mark.long
@pytest.mark.timeout(900)
def test_the_script_with_a_local_cluster(files):
    pytest.importorskip("distributed")
    done = subprocess.run(
        [sys.executable, "sweep_climbs.py"], cwd=files, capture_output=True, text=True, check=True, timeout=800
    )
    assert "4 done" in done.stdout, done.stdout + done.stderr
    areas = [float(word) for word in re.findall(r"0\.\d+", done.stdout.splitlines()[-1])]
    assert len(areas) == 4 and len(set(areas)) == 4  # each start and rate has its own
