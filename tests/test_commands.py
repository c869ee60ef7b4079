"""The verbs of the command line: files of the contract, what is printed, and the exit codes of the outcomes."""

import csv
import json
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cam.read import read_cam
from camopt.cli import parser as cli
from camopt.scene import builtin_scenes, load_scene, scene_text
from camopt.storage import create_run_folder, write_csv


def run(capsys, *arguments: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of one command; argparse's own exits count too."""
    try:
        code = cli.main(arguments)
    except SystemExit as stop:
        code = stop.code
    out = capsys.readouterr()
    return code, out.out, out.err


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


class TestCam:
    def test_lift_table(self, capsys, tmp_path):
        file = tmp_path / "lift.csv"
        code, out, _ = run(capsys, "cam", "kodama", "--cam", "polydyne", "--csv", str(file))
        scene = load_scene("kodama")
        lift = polydyne(scene)
        assert code == 0
        assert "9.400000 mm" in out
        assert f"{lift.area_ratio(9.4e-3):.6f}" in out
        assert len(file.read_text().splitlines()) == 3602
        assert read_cam(str(file), scene).area == pytest.approx(lift.area, rel=1e-10)

    def test_step(self, capsys, tmp_path):
        file = tmp_path / "lift.csv"
        assert run(capsys, "cam", "kodama", "--cam", "polydyne", "--csv", str(file), "--step-deg", "0.5")[0] == 0
        assert len(file.read_text().splitlines()) == 722
        assert run(capsys, "cam", "kodama", "--cam", "polydyne", "--csv", str(file), "--step-deg", "0.7")[0] == 2

    def test_foreign_table_with_units(self, capsys, tmp_path):
        file = tmp_path / "cam.dat"
        degrees = np.arange(-180.0, 180.1)
        lift = polydyne(load_scene("kodama"))(np.radians(degrees)) * 1e3
        np.savetxt(file, np.column_stack([2 * degrees, lift]))
        code, _, err = run(capsys, "cam", "kodama", "--cam", str(file))
        assert (code, "--table-angle" in err) == (2, True)
        options = ("--table-angle", "crank", "--table-lift", "mm")
        code, out, _ = run(capsys, "cam", "kodama", "--cam", str(file), *options)
        assert code == 0
        assert "maximum lift   9.400000 mm" in out

    def raw_table(self, tmp_path):
        """A table in crank angles of another cam than the scene's: longer, higher."""
        file = tmp_path / "raw.dat"
        degrees = np.arange(-180.0, 180.1)
        lift = 1.4 * polydyne(load_scene("kodama"))(np.radians(degrees / 1.2)) * 1e3
        np.savetxt(file, np.column_stack([2 * degrees, lift * (np.abs(degrees) < 122)]), fmt="%.6f")
        return str(file), ("--table-angle", "crank", "--table-lift", "mm")

    def test_another_duration_and_lift_are_said(self, capsys, tmp_path):
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

    def test_errors_and_added_lift_are_said(self, capsys, tmp_path):
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
        code, _, err = run(capsys, "cam", "kodama", "--cam", "polydyne", "--figure", str(tmp_path / "cam.bmp"))
        assert (code, "ends in .png or .svg" in err) == (2, True)
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("name", ["x" * 5000, "a/" * 3000, "a\0b", "\udcff.dat"])
    def test_names_that_no_system_has(self, capsys, name):
        code, out, err = run(capsys, "cam", "kodama", "--cam", name)
        assert (code, out) == (2, "")
        taken = name.endswith(".dat")  # a lone surrogate may name a file, which just is not there
        assert ("neither a family" if taken else "the system does not take this path") in err
        assert len(err) < 400 and err.count("\n") == 1

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
        assert seen[file].max_lift == pytest.approx(1.4 * 9.4e-3, rel=1e-4)


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


class TestVerbsThatSearch:
    """What the command line hands on and makes of the answer; the verbs themselves are tested where they live."""

    @pytest.mark.parametrize(
        ("verdict", "code"), [("confirmed", 0), ("rejected", 3), ("sensitive", 3), ("not converged", 3)]
    )
    def test_verify(self, capsys, tmp_path, monkeypatch, verdict, code):
        asked = {}
        content = {"verdict": verdict, "broken": ["bounce_mm"]}

        class Shown(SimpleNamespace):
            def __str__(self):
                return "the verdict in words"

        def verify(scene, lift, **options):
            asked.update(options, scene=scene.name, family=lift.family)
            return Shown(verdict=verdict, as_dict=lambda: content)

        monkeypatch.setattr("camopt.verifier.accuracy.verify", verify)
        file = tmp_path / "v.json"
        words = [
            "verify",
            "kodama",
            "--cam",
            "polydyne",
            "--speeds",
            "5000,6000",
            "--method",
            "rkg",
            "--json",
            str(file),
        ]
        got, out, _ = run(capsys, *words)
        assert got == code
        assert asked == {
            "scene": "kodama",
            "family": "polydyne",
            "speeds_rpm": (5000.0, 6000.0),
            "methods": "rkg",
            "accuracy": "standard",
        }
        assert json.loads(file.read_text()) == content
        assert out == "the verdict in words\n"  # what it says: tests of `Verdict`

    @pytest.mark.parametrize("code", [0, 3])
    def test_optimize(self, capsys, tmp_path, monkeypatch, code):
        asked = {}

        def optimize(scene, **options):
            designed = options.pop("designed")
            asked.update(options, scene=scene.name)
            folder = create_run_folder(options["out"])
            step = {"stage": "margin", "area_ratio": 0.55, "confirmed": True}
            (folder / "history.jsonl").write_text(json.dumps(step) + "\n")
            record = {"area_ratio": 0.56, "area_ratio_bound": 0.6, "area_gap_percent": 6.67}
            record |= {"area_ratio_no_jump": 0.555, "gradient_gain": 0.005}
            (folder / "design.json").write_text(json.dumps(record))
            word = {"verdict": "sensitive" if code else "confirmed", "broken": []}
            (folder / "verification.json").write_text(json.dumps(word))
            designed(folder)  # before the comparison: the outcome is printed, and the report written, by then
            said.append(capsys.readouterr().out)
            assert (folder / "report.html").exists()
            return SimpleNamespace(exit_code=code, folder=folder)

        said = []
        stand_in(monkeypatch, "camopt.optimizer.run", optimize=optimize)
        words = ["optimize", "motori-1", "--speeds", "nominal", "--accuracy", "draft", "--gradient", "none"]
        got, folder, _ = run(capsys, *words, "--seed", "7", "--no-compare", "--out", str(tmp_path / "run"))
        assert got == code
        assert asked == {
            "scene": "motori-1",
            "speeds": "nominal",
            "accuracy": "draft",
            "gradient": "none",
            "out": tmp_path / "run",
            "seed": 7,
            "wanted_yield": None,
            "resume": False,
            "progress": True,
            "compare": False,
        }
        start_to_end, areas, gain, verdict = said[0].splitlines()[1:]
        assert gain == "The gradient stage gained 0.005 of area ratio."
        assert start_to_end.split() == ["area", "ratio", "–", "0.55", "->", "0.56"]
        assert "0.56000, certified bound 0.60000 (gap 6.67 %), no-jump program 0.55500" in areas
        assert verdict == f"verdict: {'sensitive' if code else 'confirmed'}"
        assert folder == f"run folder: {tmp_path / 'run'}, report: {tmp_path / 'run' / 'report.html'}\n"
        assert (tmp_path / "run" / "report.html").exists()

    def test_compare(self, capsys, tmp_path, monkeypatch):
        from camopt.cam.design_file import write_design

        asked = []
        row = {"cam": "design", "area_ratio": 0.58, "bounce_mm": 0.02, "bounce_high_mm": 0.03, "jump_mm": 0.01}
        row |= {"verdict": "confirmed", "broken": ""}

        def compare(*given, **named):
            asked.append((*given, named))
            write_csv(create_run_folder(given[2]) / "comparison.csv", {key: [value] for key, value in row.items()})

        stand_in(monkeypatch, "camopt.optimizer.baselines.comparison", compare=compare)
        folder = create_run_folder(tmp_path / "first")
        lift = polydyne(load_scene("kodama"))
        write_design(folder / "design.json", lift, 9.4e-3)
        code, printed, _ = run(capsys, "compare", "kodama", "--design", str(folder), "--out", str(tmp_path / "second"))
        ((scene, designs, out, named),) = asked
        assert named == {"baselines": "plain", "progress": True}
        assert (code, scene.name, out) == (0, "kodama", tmp_path / "second")
        assert list(designs) == [str(folder)]
        assert designs[str(folder)].area == pytest.approx(lift.area)
        assert printed.splitlines()[1].split() == ["design", "0.5800", "0.0300", "0.0100", "confirmed", "nothing"]
        code, _, err = run(capsys, "compare", "kodama", "--design", "polydyne")
        assert (code, "neither" in err) == (2, True)

    def test_bound(self, capsys, tmp_path, monkeypatch):
        content = {
            "area_ratio_bound": 0.5984321,
            "bound_leaves_out": ["waves_max"],
            "area_ratio_feasible": float("nan"),
            "area_ratio_no_jump": 0.5,
            "area_ratio_no_jump_bound": None,
            "no_jump_says": "a train that is not linear",
            "speeds_rpm": [5000],
            "margins_N": 20.0,
            "seat_margin_N": 20.0,
            "worth_percent": {"max_lift_mm": 0.56743219, "jerk_max_mm_per_deg3": 0.0},
        }
        stand_in(monkeypatch, "camopt.optimizer.bound.summary", area_bound=lambda scene: content)
        code, out, _ = run(capsys, "bound", "kodama", "--json", str(tmp_path / "b.json"))
        assert code == 0
        for words in (
            "no cam has more (certified)                0.59843\n",
            "the bound does not count on waves_max",
            "by 20 N or more at 5000 r/min",
            "a cam has                                  0.50000\n  a train that is not linear\n",
            "max_lift_mm   0.5674 %\n  nothing: jerk_max_mm_per_deg3\n",
        ):
            assert words in out
        assert json.loads((tmp_path / "b.json").read_text()) == content | {"area_ratio_feasible": None}


def stand_in(monkeypatch, name: str, **functions) -> None:
    module = ModuleType(name)
    for key, function in functions.items():
        setattr(module, key, function)
    monkeypatch.setitem(sys.modules, name, module)
