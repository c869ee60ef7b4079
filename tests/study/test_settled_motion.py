"""`camopt verify --energy --periodic`: what it adds to verification.json and prints."""

import json

import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cli import parser as cli
from camopt.scene import load_scene
from camopt.verifier.verdict import verdict_on
from tests.test_docs import documented, keys


def test_energy_and_periodic_solution_of_a_settled_motion(capsys, tmp_path, monkeypatch):
    scene = load_scene("motori-1")
    verdict = verdict_on(scene, polydyne(scene), (1500.0,), ("event",), None)
    monkeypatch.setattr("camopt.verifier.accuracy.verify", lambda *_, **__: verdict)
    file = tmp_path / "verification.json"
    words = ["verify", "motori-1", "--cam", "polydyne", "--energy", "--periodic", "--json", str(file)]
    assert cli.main(words) == 3  # one method alone confirms nothing
    (entry,) = json.loads(file.read_text())["speeds"]
    assert keys(entry) <= documented()
    balance, solution = entry["energy"], entry["periodic_solution"]
    parts = balance["dissipated_J"] + balance["left_in_contacts_J"] + balance["change_J"] + balance["residual_J"]
    assert balance["put_in_J"] == pytest.approx(parts)
    assert abs(balance["residual_relative"]) < 1e-8 < balance["put_in_J"]
    assert solution["stable"] and solution["distance_um"] < 1.0
    sizes = [abs(complex(*pair)) for pair in solution["multipliers"]]
    assert len(sizes) == 2 * len(scene.mass) and sizes == sorted(sizes, reverse=True)
    assert solution["largest_multiplier"] == pytest.approx(sizes[0]) and sizes[0] < 1.0
    lines = capsys.readouterr().out.splitlines()[-2:]
    assert all(line.startswith("1500 r/min: ") for line in lines)
    assert "put in" in lines[0] and "largest Floquet multiplier" in lines[1]
