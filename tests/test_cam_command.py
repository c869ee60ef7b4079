"""The verb `cam` of the command line, and the lift tables that it and `compare` read."""

from pathlib import Path

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.scene import load_scene
from camopt.storage import create_run_folder, write_csv
from tests.command_line import refused, run


class TestCam:
    def test_foreign_table_with_units(self, capsys, tmp_path):
        file = tmp_path / "cam.dat"
        degrees = np.arange(-180.0, 180.1)
        lift = polydyne(load_scene("kodama"))(np.radians(degrees)) * 1e3
        np.savetxt(file, np.column_stack([2 * degrees, lift]))
        assert "--table-angle" in refused(capsys, "cam", "kodama", "--cam", str(file))
        options = ("--table-angle", "crank", "--table-lift", "mm")
        code, out, _ = run(capsys, "cam", "kodama", "--cam", str(file), *options)
        assert code == 0
        assert "maximum lift   9.400000 mm" in out

    def raw_table(self, tmp_path):
        """A table in crank angles of a cam with a longer duration and a higher lift than those of the scene."""
        file = tmp_path / "raw.dat"
        degrees = np.arange(-180.0, 180.1)
        lift = 1.4 * polydyne(load_scene("kodama"))(np.radians(degrees / 1.2)) * 1e3
        np.savetxt(file, np.column_stack([2 * degrees, lift * (np.abs(degrees) < 122)]), fmt="%.6f")
        return str(file), ("--table-angle", "crank", "--table-lift", "mm")

    def test_a_different_duration_and_lift_are_reported(self, capsys, tmp_path):
        file, options = self.raw_table(tmp_path)
        code, out, _ = run(capsys, "cam", "kodama", "--cam", file, *options)
        own = float(out.split("duration")[1].split()[0])
        assert code == 0
        assert own > 172
        assert (
            f"The cam is {own - 144:.4g} deg longer between its ramp tops than the scene's duration_deg of 144" in out
        )
        assert "Its lift exceeds the scene's max_lift_mm of 9.4" in out
        quiet = run(capsys, "cam", "kodama", "--cam", "polydyne")[1]
        assert "longer" not in quiet and "exceeds" not in quiet and "confidence" not in quiet

    def test_errors_and_added_lift_are_reported(self, capsys, tmp_path):
        file = tmp_path / "cut.dat"
        degrees = np.arange(-180.0, 180.1)
        lift = polydyne(load_scene("kodama"))(np.radians(degrees)) * 1e3 * (np.abs(degrees) < 75)
        np.savetxt(file, np.column_stack([degrees, lift]))
        code, out, _ = run(capsys, "cam", "kodama", "--cam", str(file), "--table-angle", "cam", "--table-lift", "mm")
        assert code == 0
        assert "With 95 % confidence the acceleration is within" in out
        assert "up to 0.243 mm of lift that were not measured" in out

    @pytest.mark.parametrize(("suffix", "starts"), [("png", b"\x89PNG"), ("svg", b"<?xml")])
    def test_figure(self, capsys, tmp_path, suffix, starts):
        file = tmp_path / f"cam.{suffix}"
        assert run(capsys, "cam", "kodama", "--cam", "polydyne", "--figure", str(file))[0] == 0
        content = file.read_bytes()
        assert content.startswith(starts)
        if suffix == "svg":  # a curve in each of four axes, and the scene's limits by their numbers
            text = content.decode()
            assert text.count('id="axes_') == 4
            assert all(f"<!-- {limit}" in text for limit in ("9.4 mm", "0.015", "0.003"))

    def test_figure_of_an_unknown_kind(self, capsys, tmp_path):
        said = refused(capsys, "cam", "kodama", "--cam", "polydyne", "--figure", str(tmp_path / "cam.bmp"))
        assert "ends in .png or .svg" in said
        assert list(tmp_path.iterdir()) == []

    def test_a_name_that_is_not_utf8_is_reported_as_a_missing_file(self, capsys):
        """Names that no system accepts are in tests/test_hostile_input.py."""
        said = refused(capsys, "cam", "kodama", "--cam", "\udcff.dat")
        assert "there is no such file" in said and said.count("\n") == 1

    def test_compare_reads_a_raw_table(self, capsys, tmp_path, monkeypatch):
        file, options = self.raw_table(tmp_path)
        seen = {}

        def compare(scene, designs, out, **_):
            seen.update(designs)
            names = ("cam", "area_ratio", "bounce_mm", "bounce_high_mm", "jump_mm", "verdict", "broken")
            write_csv(create_run_folder(out) / "comparison.csv", {name: ["1"] for name in names})

        monkeypatch.setattr("camopt.optimizer.baselines.comparison.compare", compare)
        folder = str(tmp_path / "comparison")
        assert run(capsys, "compare", "kodama", "--design", file, "--out", folder)[0] == 2
        assert run(capsys, "compare", "kodama", "--design", file, *options, "--out", folder)[0] == 0
        assert seen[Path(file).name].max_lift == pytest.approx(1.4 * 9.4e-3, rel=1e-4)
