"""Built-in trains of other kinds by `camopt optimize --yield`: five masses, and an adjuster with springs by tables."""

import json

import pytest

from camopt.cli.parser import main


@pytest.mark.long
@pytest.mark.parametrize("scene", ["pushrod-5mass", "finger-hydraulic"])
def test_a_yield_is_confirmed(scene, tmp_path):
    folder = tmp_path / "run"
    words = ["optimize", scene, "--yield", "0.99", "--accuracy", "draft", "--no-compare", "--out", str(folder)]
    assert main(words) == 0
    found = json.loads((folder / "verification.json").read_text())["yield"]
    assert found["confirmed"] and found["share"] >= 0.99 and found["low"] >= 0.98
    assert all(entry["agrees"] for entry in found["independent"])
