"""The verbs of the command line that search: the arguments they pass on, their output and their exit codes."""

import json
import sys
from types import ModuleType, SimpleNamespace

import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.scene import load_scene
from camopt.storage import create_run_folder, write_csv
from tests.command_line import refused, run


class TestVerbsThatSearch:
    """Arguments that the command line passes on, and how it shows results; the functions have their own tests."""

    @pytest.mark.parametrize(
        ("verdict", "code"), [("confirmed", 0), ("rejected", 3), ("sensitive", 3), ("not converged", 3)]
    )
    def test_verify(self, capsys, tmp_path, monkeypatch, verdict, code):
        passed = {}
        content = {"verdict": verdict, "broken": ["bounce_mm"]}

        class Shown(SimpleNamespace):
            def __str__(self):
                return "the verdict in words"

        def verify(scene, lift, **options):
            passed.update(options, scene=scene.name, family=lift.family)
            return Shown(verdict=verdict, as_dict=lambda: content, outside=())

        monkeypatch.setattr("camopt.verifier.accuracy.verify", verify)
        file = tmp_path / "v.json"
        words = "verify kodama --cam polydyne --speeds 5000,6000 --method rkg --json".split()
        got, out, _ = run(capsys, *words, str(file))
        assert got == code
        assert passed == {
            "scene": "kodama",
            "family": "polydyne",
            "speeds_rpm": (5000.0, 6000.0),
            "methods": "rkg",
            "accuracy": "standard",
            "progress": True,
            "outside": False,
        }
        assert json.loads(file.read_text()) == content
        assert out == "the verdict in words\n"  # its content is tested with `Verdict`

    @pytest.mark.parametrize(("code", "accuracy"), [(0, "standard"), (3, "standard"), (0, "draft")])
    def test_optimize(self, capsys, tmp_path, monkeypatch, code, accuracy):
        passed = {}

        def optimize(scene, **options):
            designed = options.pop("designed")
            passed.update(options, scene=scene.name)
            folder = create_run_folder(options["out"])
            step = {"stage": "margin", "area_ratio": 0.55, "confirmed": True}
            (folder / "history.jsonl").write_text(json.dumps(step) + "\n")
            record = {"area_ratio": 0.56, "area_ratio_bound": 0.6, "area_gap_percent": 6.67}
            record |= {"area_ratio_no_jump": 0.555, "gradient_gain": 0.005}
            (folder / "design.json").write_text(json.dumps(record))
            word = {"verdict": "sensitive" if code else "confirmed", "broken": []}
            (folder / "verification.json").write_text(json.dumps(word))
            designed(folder)  # called before the comparison: by then the result is printed and the report written
            printed.append(capsys.readouterr().out)
            early = accuracy != "draft"  # a draft's comparison is quick, and its report is written once
            assert (folder / "report.html").exists() == early
            return SimpleNamespace(exit_code=code, folder=folder)

        printed = []
        stand_in(monkeypatch, "camopt.optimizer.run", optimize=optimize)
        words = ["optimize", "motori-1", "--speeds", "nominal", "--accuracy", accuracy, "--gradient", "none"]
        got, folder, _ = run(capsys, *words, "--seed", "7", "--no-compare", "--out", str(tmp_path / "run"))
        assert got == code
        assert passed == {
            "scene": "motori-1",
            "speeds": "nominal",
            "accuracy": accuracy,
            "gradient": "none",
            "start": None,
            "out": tmp_path / "run",
            "seed": 7,
            "wanted_yield": None,
            "free": {},
            "resume": False,
            "progress": True,
            "compare": False,
        }
        start_to_end, areas, gain, verdict = printed[0].splitlines()[1:]
        assert gain == "Adapting the margins to the judged motion gained 0.005 of area ratio."
        assert start_to_end.split() == ["area", "ratio", "–", "0.55", "->", "0.56"]
        assert "0.56000, certified bound 0.60000 (gap 6.67 %), no-jump program 0.55500" in areas
        assert verdict == f"verdict: {'sensitive' if code else 'confirmed'}"
        assert folder == f"run folder: {tmp_path / 'run'}, report: {tmp_path / 'run' / 'report.html'}\n"
        assert (tmp_path / "run" / "report.html").exists()

    def test_compare(self, capsys, tmp_path, monkeypatch):
        from camopt.cam.design_file import write_design

        calls = []
        row = {"cam": "design", "area_ratio": 0.58, "bounce_mm": 0.02, "bounce_high_mm": 0.03, "jump_mm": 0.01}
        row |= {"verdict": "confirmed", "broken": ""}

        def compare(*arguments, note, **named):
            calls.append((*arguments, named))
            note("no member of it holds")
            write_csv(create_run_folder(arguments[2]) / "comparison.csv", {key: [value] for key, value in row.items()})

        stand_in(monkeypatch, "camopt.optimizer.baselines.comparison", compare=compare)
        folder = create_run_folder(tmp_path / "first")
        lift = polydyne(load_scene("kodama"))
        write_design(folder / "design.json", lift, 9.4e-3)
        code, printed, _ = run(capsys, "compare", "kodama", "--design", str(folder), "--out", str(tmp_path / "second"))
        ((scene, designs, out, named),) = calls
        assert printed.splitlines()[-2] == "note: no member of it holds"
        assert named == {"baselines": "plain", "progress": True}
        assert (code, scene.name, out) == (0, "kodama", tmp_path / "second")
        assert list(designs) == ["first"]
        assert designs["first"].area == pytest.approx(lift.area)
        assert printed.splitlines()[1].split() == ["design", "0.5800", "0.0300", "0.0100", "confirmed", "nothing"]
        calls.clear()
        twin = create_run_folder(tmp_path / "more") / "first"
        write_design(create_run_folder(twin) / "design.json", lift, 9.4e-3)
        names = ["--design", str(folder), "--design", str(twin)]
        run(capsys, "compare", "kodama", *names, "--no-literature", "--out", str(tmp_path / "third"))
        ((_, designs, _, named),) = calls
        assert list(designs) == [str(folder), str(twin)] and named["baselines"] == "none"
        assert "a family; expected a run folder" in refused(capsys, "compare", "kodama", "--design", "polydyne")

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
        monkeypatch.setattr("camopt.optimizer.bound.summary.area_bound", lambda scene: content)
        code, out, _ = run(capsys, "bound", "kodama", "--json", str(tmp_path / "b.json"))
        assert code == 0
        for words in (
            "certified upper bound                      0.59843\n",
            "the bound ignores waves_max, so that the true maximum may be lower",
            "by 20 N or more at 5000 r/min",
            "a cam has                                  0.50000\n  a train that is not linear\n",
            "max_lift_mm   0.5674 %\n  no effect: jerk_max_mm_per_deg3\n",
        ):
            assert words in out
        assert json.loads((tmp_path / "b.json").read_text()) == content | {"area_ratio_feasible": None}


def stand_in(monkeypatch, name: str, **functions) -> None:
    module = ModuleType(name)
    for key, function in functions.items():
        setattr(module, key, function)
    monkeypatch.setitem(sys.modules, name, module)
