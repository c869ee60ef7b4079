"""The verbs of the command line on scenes, modes and motions: what they write and print."""

import csv
import json

import numpy as np
import pytest

from camopt.scene import builtin_scenes, scene_text
from tests.test_cli import run


class TestScenes:
    def test_list(self, capsys):
        code, out, _ = run(capsys, "scenes")
        assert code == 0
        assert [line.split()[0] for line in out.splitlines()] == sorted(builtin_scenes())
        assert "Finger-follower valve train, ten masses" in out

    def test_print_one_to_edit(self, capsys):
        assert run(capsys, "scenes", "kodama", "--quiet") == (0, scene_text("kodama"), "")

    def test_unknown(self, capsys):
        code, out, err = run(capsys, "scenes", "kodamo")
        assert (code, out) == (2, "")
        assert "kodama" in err


class TestModes:
    def test_json_and_table(self, capsys, tmp_path):
        file = tmp_path / "modes.json"
        code, out, _ = run(capsys, "modes", "ohv-3dof", "--json", str(file))
        content = json.loads(file.read_text())
        assert code == 0
        assert [f"{f:.6g}" for f in content["frequency_Hz"]] == ["2832.25", "15642.9", "72247.8"]
        np.testing.assert_allclose(content["shape"][1], [-0.0217, 0.0745, 0.9970], atol=5e-5)
        assert all(number in out for number in ("2832.25", "17795.6", "453946", "-0.9997"))

    def test_state(self, capsys):
        assert "18622" in run(capsys, "modes", "kodama", "--state", "seated")[1]
        assert "18622" not in run(capsys, "modes", "kodama")[1]


class TestSimulate:
    def test_csv(self, capsys, tmp_path):
        file = tmp_path / "motion.csv"
        words = ["simulate", "kodama", "--cam", "polydyne", "--speed", "5000", "--step-deg", "1", "--csv", str(file)]
        code, out, _ = run(capsys, *words)
        with open(file, newline="") as text:
            rows = list(csv.DictReader(text))
        assert code == 0
        assert (len(rows), rows[0]["revolution"], rows[-1]["revolution"]) == (721, "1", "2")
        assert (float(rows[0]["cam_angle_deg"]), float(rows[-1]["cam_angle_deg"])) == (-180, 180)
        assert float(rows[-1]["time_s"]) == pytest.approx(2 * 60 / 2500)
        assert float(rows[0]["cam_follower_N"]) == pytest.approx(19.1)
        top = max(float(row["valve_head_mm"]) for row in rows[360:])
        assert f"{top:.4f} mm" in out.splitlines()[-4]
