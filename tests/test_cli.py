"""The command line: exit codes, one clear sentence per fault, output files, and no early import of heavy libraries."""

import argparse
import subprocess
import sys
from dataclasses import fields

import pytest

import camopt
import camopt.verifier
from camopt.cli import parser as cli
from camopt.cli import values
from camopt.cli import verbs as commands
from camopt.exact.adjoint.slopes import ByTrain, ByTrainAndLaws
from camopt.optimizer.accuracy import ACCURACIES
from camopt.scene import scene_text
from camopt.scene.errors import brief
from camopt.scene.train import LAW_PARAMETERS, TRAIN_PARAMETERS
from camopt.verifier import ACCURACY_NAMES
from camopt.verifier.accuracy import EFFORTS
from camopt.verifier.methods import METHOD_NAMES, verdict_methods
from tests.command_line import VERBS, refused, run


class TestHelp:
    def test_version(self, capsys):
        assert run(capsys, "--version") == (0, f"camopt {camopt.__version__}\n", "")

    def test_help_lists_all_commands(self, capsys):
        code, out, _ = run(capsys, "--help")
        assert code == 0
        assert "example: camopt " in out
        assert all(f"\n    {verb} " in out for verb in VERBS)

    @pytest.mark.parametrize("verb", VERBS)
    def test_every_command_has_an_example_that_parses(self, capsys, verb):
        code, out, _ = run(capsys, verb, "--help")
        assert code == 0
        example = next(line for line in out.splitlines() if line.startswith("example: camopt "))
        words = example.removeprefix("example: camopt ").split(" > ")[0].split()
        assert cli.parser().parse_args(words).command == verb

    @pytest.mark.parametrize(
        "arguments",
        [(), ("optimise",), ("optimize", "--speed", "band"), ("simulate", "kodama"), ("modes",)],
    )
    def test_wrong_use_has_exit_code_two(self, capsys, arguments):
        assert "error:" in refused(capsys, *arguments)

    def test_verify_without_a_cam_says_what_to_add(self, capsys):
        assert run(capsys, "verify", "kodama") == (
            2, "", "camopt: verify 'kodama': no cam: add --cam CAM, or give a run folder in the scene's place\n"
        )  # fmt: skip

    def test_a_missing_external_program_is_reported_before_anything_runs(self, capsys, monkeypatch):
        monkeypatch.setattr("camopt.verifier.from_outside.find_spec", lambda name: None)
        said = refused(capsys, "verify", "kodama", "--cam", "polydyne", "--outside")
        assert said.startswith("camopt: the judge from outside needs Exudyn, which is not installed")


FRESH = """
import sys
from camopt.cli.parser import main
try:
    code = main(sys.argv[2:])
except SystemExit as stop:
    code = stop.code
heavy = {"jax", "numba", "matplotlib", "xarray", "diffrax"} & set(sys.modules)
sys.exit(f"code {code}, loaded {heavy}" if heavy or code != int(sys.argv[1]) else 0)
"""


@pytest.mark.parametrize(
    ("code", "arguments"),
    [
        (0, "--help"),
        (0, "optimize --help"),
        (0, "scenes"),
        (2, "verify none.toml --cam polydyne"),
        (2, "optimize none.toml"),
        (2, "sweep none.toml --store x.sqlite"),
        (2, "verify kodama --cam none.csv"),
        (2, "optimize kodama --out /"),
        (2, "simulate kodama --cam polydyne --speed -1"),
    ],
)
def test_help_and_faults_load_nothing_heavy(code, arguments, tmp_path):
    command = [sys.executable, "-c", FRESH, str(code), *arguments.split()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


def test_module_runs_as_the_command(tmp_path):
    command = [sys.executable, "-m", "camopt", "modes", "none.toml"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("camopt: scene 'none.toml': there is no such file")
    assert done.stderr.count("\n") == 1


def test_closed_pipe_is_no_error():
    command = [sys.executable, "-m", "camopt", "scenes", "kodama"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()  # long before the program has started
        assert process.stderr.read() == b""
    assert process.returncode == 0


class TestFaults:
    def test_faults_of_a_scene_are_reported_with_file_and_key(self, capsys, tmp_path):
        file = tmp_path / "bad.toml"
        file.write_text(scene_text("kodama").replace("mass_kg = 0.303", "mass_kg = -1.0").replace("nose_deg", "nose"))
        faults = refused(capsys, "verify", str(file), "--cam", "polydyne")
        assert f"{file}: mass.1.mass_kg: " in faults and f"{file}: design.nose: unknown key" in faults

    def test_scene_without_the_parts_a_command_needs(self, capsys):
        faults = refused(capsys, "simulate", "ohv-3dof", "--cam", "polydyne", "--speed", "6000")
        assert "ohv-3dof: valve: missing" in faults

    def test_an_internal_error_is_reported_and_debug_shows_its_place(self, capsys, monkeypatch):
        def broken(_):
            raise ZeroDivisionError("division by zero")

        monkeypatch.setattr(commands, "modes", broken)
        code, out, err = run(capsys, "modes", "kodama")
        assert (code, out) == (1, "")
        assert err == (
            "camopt: a defect of camopt, not of your input (ZeroDivisionError: division by zero); --debug shows where\n"
        )
        code, _, err = run(capsys, "modes", "kodama", "--debug")
        assert code == 1
        assert "Traceback" in err
        assert "in broken" in err

    @pytest.mark.parametrize(("verb", "remedy"), [("optimize", True), ("scenes", False)])
    def test_interrupt(self, capsys, monkeypatch, verb, remedy):
        def interrupted(_):
            raise KeyboardInterrupt

        monkeypatch.setattr(commands, verb, interrupted)
        code, _, err = run(capsys, verb)
        assert code == 130
        assert err.startswith("camopt: interrupted")
        assert ("--resume" in err) == remedy


SIMULATE = ("simulate", "kodama", "--cam", "polydyne", "--speed", "6000")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("optimise",), "no command 'optimise'; did you mean 'optimize'?"),
        (("simulate", "kodama", "--cam", "polydyne", "--sped", "6000"), "no option '--sped'; did you mean '--speed'?"),
        (("optimize", "--acuracy=draft"), "no option '--acuracy'; did you mean '--accuracy'?"),
        (("optimize", "--accuracy", "daft"), "'daft': expected draft, standard or fine; did you mean 'draft'?"),
        (("verify", "kodama", "--cam", "polydyne", "--accuracy", "fien"), "did you mean 'fine'?"),
        ((*SIMULATE, "--method", "rgk"), "did you mean 'rkg'?"),
        (("modes", "kodma"), "did you mean 'kodama'?"),
        (("scenes", "Motori1"), "did you mean 'motori-1'?"),
        (("cam", "kodama", "--cam", "polydine"), "did you mean 'polydyne'?"),
        (("cam", "kodama", "--cam", "polydin:exponents=2/4"), "did you mean 'polydyne'?"),
        (("cam", "kodama", "--cam", "polydyne:exponent=2/4"), "did you mean 'exponents'?"),
        (("cam", "kodama", "--cam", "cycloidal:x=1"), "this family has none"),
        (("modes", "--", "--state"), "neither a built-in scene"),  # a word after two dashes is not an option
        (("optimize", "kodama", "--resume"), "--out DIR"),
    ],
)
def test_the_remedy_is_in_the_last_line(capsys, words, says):
    assert says in refused(capsys, *words).splitlines()[-1]


def test_no_dissimilar_name_is_suggested(capsys):
    for words in (("zzz",), ("modes", "zzz"), ("optimize", "--zzz"), ("scenes", "zzz"), ("optimize", "--seed", "z")):
        assert "did you mean" not in refused(capsys, *words)


def test_an_empty_name_and_a_very_long_one_end_in_a_sentence(capsys):
    for name in ("", "k" * 100_000):
        assert len(refused(capsys, "modes", name)) < 400


class TestArguments:
    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            ("6000", (6000,)),
            ("6000,5000,6000", (5000, 6000)),
            ("300:8000:100", tuple(range(300, 8001, 100))),
            ("5000:5250:100", (5000, 5100, 5200)),
            ("1:2:0.1", tuple(1 + i * 0.1 for i in range(11))),
            ("5000:5000:1", (5000,)),
        ],
    )
    def test_speeds(self, text, expected):
        assert values.speeds(text) == pytest.approx(expected)
        assert len(values.speeds(text)) == len(expected)

    @pytest.mark.parametrize(
        "text",
        ["", "fast", "5000,", "-5000", "0", "nan", "inf", "1:2", "2:1:1", "1:2:0", "1:2:-1", "1:1e9:1", "1:2:3:4"],
    )
    def test_unusable_speeds(self, text):
        with pytest.raises(argparse.ArgumentTypeError):
            values.speeds(text)

    def test_accuracy_is_a_word_or_micrometres(self):
        words = ["verify", "kodama", "--cam", "polydyne", "--accuracy"]
        assert cli.parser().parse_args([*words, "fine"]).accuracy == "fine"
        assert cli.parser().parse_args([*words, "0.5"]).accuracy == 0.5

    @pytest.mark.parametrize(
        "option",
        ["--accuracy=rough", "--accuracy=0", "--seed=-1", "--seed=1.5", "--seed=4294967296", "--speeds=all"],
    )
    def test_unusable_options(self, capsys, option):
        assert option.split("=")[1] in refused(capsys, "optimize", "kodama", option)

    def test_defaults(self):
        args = cli.parser().parse_args(["optimize"])
        assert (args.scene, args.speeds, args.accuracy, args.gradient) == ("kodama", "band", "standard", "auto")
        assert (args.out, args.seed, args.resume) == (None, 0, False)
        args = cli.parser().parse_args(["simulate", "kodama", "--cam", "polydyne", "--speed", "6000"])
        assert (args.method, args.revolutions, args.step_deg, args.csv) == (None, 2, 0.1, None)  # event
        args = cli.parser().parse_args(["verify", "kodama", "--cam", "polydyne"])
        assert (args.speeds, args.method, args.accuracy) == (None, "all", "standard")


def test_every_accuracy_has_its_settings():
    assert ACCURACY_NAMES == tuple(EFFORTS) == tuple(ACCURACIES)


def test_the_parameters_of_a_train_are_those_of_its_gradient():
    assert TRAIN_PARAMETERS == tuple(field.name for field in fields(ByTrain))
    every = tuple(field.name for field in fields(ByTrainAndLaws))
    assert (*TRAIN_PARAMETERS, *LAW_PARAMETERS, "forcing") == every


def test_every_method_has_a_name_for_readers():
    assert set(METHOD_NAMES) == {*verdict_methods(), "smooth"}


def test_a_long_message_is_cut_in_its_middle(tmp_path, capsys):
    (tmp_path / "a.toml").write_text(f"name = '{'a' * 5000}")
    assert cli.main(["modes", str(tmp_path / "a.toml")]) == 2
    assert max(map(len, capsys.readouterr().err.splitlines())) < 1500
    assert brief("first\n" + "a" * 700 + "b" * 700) == f"first\n{'a' * 500} ... {'b' * 500}"
    assert brief("a" * 1000) == "a" * 1000
