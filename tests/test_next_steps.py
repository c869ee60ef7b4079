"""The last line of a command: the next step, and after a failure or an interruption the files that remain."""

import errno
import os
import re
import shlex

import pytest

from camopt.cli import parser as cli
from camopt.cli import verbs
from camopt.report.tables import comparison_lines
from camopt.scene import InputError, scene_text
from camopt.storage import write_csv
from tests.command_line import VERBS, refused, run

CAM = ("--cam", "polydyne")
COMMANDS = {
    "optimize": ("optimize", "kodama", "--out", "run"),
    "design": ("design", "kodama"),
    "verify": ("verify", "kodama", *CAM),
    "simulate": ("simulate", "kodama", *CAM, "--speed", "6000"),
    "compare": ("compare", "kodama", "--out", "run"),
    "cam": ("cam", "kodama", *CAM, "--csv", "lift.csv"),
    "modes": ("modes", "kodama"),
    "bound": ("bound", "kodama"),
    "rise": ("rise", "--rise-mm", "10", "--over-deg", "60"),
    "yield": ("yield", "kodama", *CAM, "--out", "run"),
    "what-if": ("what-if", "kodama", *CAM, "--set", "stem.mass_kg=*0.9"),
    "sweep": ("sweep", "plan.toml", "--store", "x.sqlite"),
    "gradient": ("gradient", "kodama", *CAM, "--speed", "6000"),
    "tradeoff": ("tradeoff", "kodama", "--out", "run"),
    "extremes": ("extremes", "kodama", "--out", "run"),
    "reduce": ("reduce", "kodama"),
    "report": ("report", "runs/first"),
    "scenes": ("scenes",),
}


def test_every_command_is_tested():
    assert COMMANDS.keys() == set(VERBS)


def stand_in(monkeypatch, tmp_path, verb: str, outcome) -> None:
    """Replaces a verb by one that only creates its folder and ends with `outcome`."""
    monkeypatch.chdir(tmp_path)

    def act(args):
        if "run" in COMMANDS[verb]:
            verbs.folder_of(args, "kodama")
        return outcome(args)

    monkeypatch.setattr(verbs, cli.verb_named(verb), act)


@pytest.mark.parametrize("code", [0, 3])
@pytest.mark.parametrize("verb", COMMANDS)
def test_the_last_line_is_a_command_that_parses(capsys, monkeypatch, tmp_path, verb, code):
    stand_in(monkeypatch, tmp_path, verb, lambda args: code)
    got, _, err = run(capsys, *COMMANDS[verb])
    assert got == code
    (line,) = err.splitlines()
    assert line.startswith("next: ")
    if (verb, code) == ("extremes", 3):
        assert "run/extremes.csv" in line
        return
    commands = re.findall("`(.*?)`", line)
    assert commands
    for command in commands:
        words = shlex.split(command.split(" > ")[0])
        assert words[0] == "camopt" and cli.parser().parse_args(words[1:]).command == words[1]


@pytest.mark.parametrize("verb", COMMANDS)
def test_quiet_prints_nothing(capsys, monkeypatch, tmp_path, verb):
    stand_in(monkeypatch, tmp_path, verb, lambda args: 0)
    assert run(capsys, *COMMANDS[verb], "--quiet") == (0, "", "")


def test_the_next_step_repeats_the_units_of_a_table(capsys, monkeypatch, tmp_path):
    stand_in(monkeypatch, tmp_path, "cam", lambda args: 0)
    words = ("cam", "kodama", "--cam", "my table.csv", "--table-angle", "crank", "--table-lift", "mm")
    assert "--cam 'my table.csv' --table-angle crank --table-lift mm --csv" in run(capsys, *words)[2]


@pytest.mark.parametrize("verb", ["verify", "cam"])
def test_the_next_step_does_not_overwrite_the_given_table(capsys, monkeypatch, tmp_path, verb):
    stand_in(monkeypatch, tmp_path, verb, lambda args: 0)
    (tmp_path / "lift.csv").write_text("0,0")
    assert "--csv" not in run(capsys, verb, "kodama", "--cam", "lift.csv")[2]
    assert "--csv lift.csv --digits 5" in run(capsys, verb, "kodama", *CAM)[2]


def test_the_next_steps_do_not_lead_back(capsys, monkeypatch, tmp_path):
    """The suggested steps lead from a design to its table, the table's verdict, its yield, the effect of each
    tolerance, and a design for a yield."""
    (tmp_path / "lift.csv").write_text("0,0")
    for words, follows in (
        (("verify", "kodama", "--cam", "runs/first"), "cam kodama --cam runs/first --csv lift.csv"),
        (("cam", "kodama", "--cam", "runs/first", "--csv", "lift.csv"), "verify kodama --cam lift.csv`"),
        (("verify", "kodama", "--cam", "lift.csv"), "yield kodama --cam lift.csv --trains 200"),
        (("yield", "kodama", "--cam", "lift.csv", "--out", "run"), "yield kodama --cam lift.csv --trains 1000"),
        (("yield", "kodama", "--cam", "lift.csv", "--out", "run", "--halve"), "optimize kodama --yield 0.95`"),
    ):
        stand_in(monkeypatch, tmp_path, words[0], lambda args: 0)
        assert f"`camopt {follows}" in run(capsys, *words)[2]


@pytest.mark.parametrize("option", ["--csv", "--contour", "--dxf", "--card-csv"])
def test_a_command_does_not_overwrite_its_input(capsys, monkeypatch, tmp_path, option):
    stand_in(monkeypatch, tmp_path, "cam", lambda args: 0)
    (tmp_path / "lift.csv").write_text("0,0")
    said = refused(capsys, "cam", "kodama", "--cam", "lift.csv", option, str(tmp_path / "lift.csv"))
    assert said.count("\n") == 1
    assert "reads that file as its cam, and would overwrite it: name another file" in said


def test_a_command_does_not_write_two_outputs_to_one_file(capsys, monkeypatch, tmp_path):
    stand_in(monkeypatch, tmp_path, "cam", lambda args: 0)
    words = ("cam", "kodama", "--cam", "polydyne", "--csv", "lift.csv", "--contour")
    assert "--csv and --contour name the same file, ./lift.csv" in refused(capsys, *words, "./lift.csv")
    assert run(capsys, *words, "contour.csv")[0] == 0
    assert run(capsys, *words[:5], os.devnull, "--contour", os.devnull)[0] == 0


class TestLeftBehind:
    def interrupted(self, tmp_path, error, files):
        def outcome(args):
            args.folder.mkdir(exist_ok=True)
            for name in files:
                (args.folder / name).write_text("")
            raise error

        return outcome

    @pytest.mark.parametrize(
        ("error", "code"),
        [
            (InputError("contradictory limits"), 2),
            (KeyboardInterrupt(), 130),
            (ZeroDivisionError("division by zero"), 1),
            (OSError(errno.ENOSPC, "No space left on device", "run/lift.csv"), 2),
        ],
    )
    def test_remaining_files_and_the_resuming_command_are_reported(self, capsys, monkeypatch, tmp_path, error, code):
        outcome = self.interrupted(tmp_path, error, ["scene.toml", "history.jsonl"])
        stand_in(monkeypatch, tmp_path, "optimize", outcome)
        got, out, err = run(capsys, *COMMANDS["optimize"])
        assert (got, out) == (code, "")
        assert "run is left, with history.jsonl, scene.toml" in err
        assert "`camopt optimize kodama --out run --resume` with the same options" in err
        assert ("defect" in err) == (code == 1)

    def test_without_resume_the_remedy_is_another_folder(self, capsys, monkeypatch, tmp_path):
        stand_in(monkeypatch, tmp_path, "compare", self.interrupted(tmp_path, KeyboardInterrupt(), ["comparison.csv"]))
        _, _, err = run(capsys, *COMMANDS["compare"])
        assert "run is left, with comparison.csv: delete it or name another --out" in err

    def test_an_empty_folder_is_removed(self, capsys, monkeypatch, tmp_path):
        stand_in(monkeypatch, tmp_path, "optimize", self.interrupted(tmp_path, InputError("no cam"), []))
        assert run(capsys, *COMMANDS["optimize"]) == (2, "", "camopt: no cam\n")
        assert not (tmp_path / "run").exists()

    def test_a_foreign_folder_is_not_changed(self, capsys, monkeypatch, tmp_path):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "run").mkdir()
        said = refused(capsys, *COMMANDS["optimize"])
        assert "exists already" in said and "is left" not in said
        assert (tmp_path / "run").is_dir()

    def test_a_folder_to_resume_is_kept(self, capsys, monkeypatch, tmp_path):
        (tmp_path / "run").mkdir()
        stand_in(monkeypatch, tmp_path, "optimize", self.interrupted(tmp_path, InputError("other settings"), ["a"]))
        _, _, err = run(capsys, *COMMANDS["optimize"], "--resume")
        assert err == "camopt: other settings; run is kept, with a\n"


class TestNotes:
    def test_an_unusual_value_causes_a_note_and_runs(self, capsys, tmp_path):
        file = tmp_path / "heavy.toml"
        file.write_text(scene_text("motori-1").replace("mass_kg = 0.24", "mass_kg = 125"))
        code, out, err = run(capsys, "modes", str(file))
        assert code == 0 and "Hz" in out
        note, following = err.splitlines()
        assert note.startswith(f"camopt: note: {file}: mass.mass_kg: 125 of 'valve' is outside the usual")
        assert following.startswith("next: ")

    @pytest.mark.parametrize(("verb", "option"), [("simulate", "--speed"), ("verify", "--speeds")])
    def test_speeds_of_the_command_line(self, capsys, monkeypatch, verb, option):
        monkeypatch.setattr(verbs, verb, lambda args: verbs.scene_of(args) and 0)
        _, _, err = run(capsys, verb, "kodama", *CAM, option, "60000", "--quiet")
        assert err.startswith(f"camopt: note: {option}: 60000 is outside the usual 100 to 20000")


def test_the_table_printed_by_compare(tmp_path):
    rows = [
        ("design", 5000, 0.58, 0.01, 0.02, 0.001, "confirmed", ""),
        ("design", 6000, 0.58, 0.03, 0.04, 0.002, "sensitive", "jump_mm at 6000 r/min; jump_mm at 6500 r/min"),
        ("multi-pol (no jerk limit)", 5000, 0.6, None, None, 0.1, "rejected", "jerk_max_mm_per_deg3; bounce_mm"),
        ("multi-pol (no jerk limit)", 6000, 0.6, 0.5, 0.5, 0.3, "rejected", "jerk_max_mm_per_deg3; jump_mm"),
        ("new-design", *[None] * 5, "rejected", "none meets the limits " + "x" * 99),
    ]
    names = ("cam", "speed_rpm", "area_ratio", "bounce_mm", "bounce_high_mm", "jump_mm", "verdict", "broken")
    write_csv(tmp_path / "comparison.csv", dict(zip(names, map(list, zip(*rows, strict=True)), strict=True)))
    head, *lines = comparison_lines(tmp_path)
    assert head.split() == ["cam", "area", "ratio", "bounce", "mm", "jump", "mm", "verdict", "broken"]
    assert lines[0].split() == ["design", "0.5800", "0.0400", "0.0020", "sensitive", "jump_mm"]
    assert lines[1].split("  ")[0] == "multi-pol (no jerk limit)"
    assert lines[1].endswith("0.6000     0.5000   0.3000  rejected   jerk_max_mm_per_deg3, bounce_mm, jump_mm")
    assert lines[2].split()[:5] == ["new-design", "none", "none", "none", "rejected"]
    assert len(lines) == 3 and max(map(len, lines)) <= 120 and lines[2].endswith("...")
