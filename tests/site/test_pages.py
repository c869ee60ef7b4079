"""Commands, scenes and Python code of the pages work as printed, including the example of a wrong gradient."""

import doctest
import json
import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import pytest

import camopt
from camopt.cli.parser import parser
from docs.generators.terminal import RECORDED
from docs.record import commands_of, furnish, printed

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [
    DOCS.parent / "README.md",
    DOCS / "index.md",
    DOCS / "reference" / "commands.md",
    *(p for part in ("tutorials", "how-to", "explanation") for p in sorted((DOCS / part).glob("*.md"))),
]
BLOCKS = {
    (p.stem, i): block
    for p in PAGES
    for i, block in enumerate(re.findall(r"```(\w+)\n(.*?)```", p.read_text(), re.DOTALL))
}
COMMANDS = sorted(
    {line for kind, text in BLOCKS.values() if kind == "sh" for line in text.splitlines() if line.startswith("camopt ")}
)
TERMINAL = [command for page in PAGES for command in commands_of(page)]
PYTHON = {f"{page}-{i}": text for (page, i), (kind, text) in BLOCKS.items() if kind == "python"}
SLOW = {"certificates-0"}
GRADIENTS = [name for name in PYTHON if name.startswith("gradients")]


@pytest.mark.parametrize("command", [*COMMANDS, *TERMINAL])
def test_commands_parse(command):
    assert parser().parse_args(shlex.split(command.partition(" > ")[0])[1:]).command


def test_every_command_with_its_output_is_recorded():
    recorded = json.loads(RECORDED.read_text(encoding="utf-8"))["printed"]
    assert sorted(recorded) == sorted(TERMINAL)
    for command, record in recorded.items():
        assert record["exit_code"] in (0, 3) and record["output"], command
    assert "verdict: confirmed" in recorded["camopt verify tappet.toml --cam lift.csv"]["output"]


@pytest.mark.long
@pytest.mark.timeout(1200)
def test_the_recorded_commands_still_have_their_results(tmp_path):
    """Digits may differ from machine to machine, but not exit codes, verdicts and the words of the output."""
    recorded = json.loads(RECORDED.read_text(encoding="utf-8"))["printed"]
    for page in PAGES:
        folder = tmp_path / page.stem
        folder.mkdir()
        furnish(folder)
        for command in commands_of(page):
            if "--dxf" in command and not find_spec("ezdxf"):
                continue  # needs an optional package
            again = printed(command, folder)
            before = recorded[command]
            verdicts = [[li for li in run["output"] if li.startswith("verdict: con")] for run in (again, before)]
            assert again["exit_code"] == before["exit_code"] and verdicts[0] == verdicts[1], command
            if command.split()[1] in ("modes", "bound", "cam"):
                assert words(again["output"]) == words(before["output"]), f"{command}: python -m docs.record"


def test_the_first_command_of_an_engineers_day_prints_what_is_recorded(tmp_path):
    """The old cam is read from a file with decimal commas, a header and a superfluous column."""
    furnish(tmp_path)
    command = commands_of(DOCS / "tutorials" / "an-engineers-day.md")[0]
    recorded = json.loads(RECORDED.read_text(encoding="utf-8"))["printed"][command]
    again = printed(command, tmp_path)
    assert again["exit_code"] == recorded["exit_code"] == 0 and words(again["output"]) == words(recorded["output"])
    assert any("opens 18.00 deg before TDC" in line for line in again["output"])
    assert (tmp_path / "old-cam.png").stat().st_size > 10_000


def words(lines: list[str]) -> set[str]:
    """The words of an output, without its digits."""
    return set(re.findall(r"[a-z_]{3,}", " ".join(lines)))


def test_the_scene_of_the_tutorial_is_a_scene():
    scene = camopt.load_scene(DOCS / "tutorials" / "tappet.toml", need=("operation", "design"))
    assert scene.geometry is not None and scene.mass[0].mass_kg == 0.125


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=[pytest.mark.long] * (n in SLOW))
        for n in sorted(PYTHON.keys() - {*GRADIENTS})
        if not n.startswith("cluster-")  # two files of one experiment, run by tests/tasks/test_cluster.py
    ],
)
def test_python_runs(name, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(PYTHON[name], name, "exec"), {})
    assert capsys.readouterr().out


def test_the_wrong_gradient_of_a_switching_time_and_the_exact_one(capsys):
    """The example of diffrax #729, and a similar derivative with event-exact."""
    lying, exact = GRADIENTS
    names: dict = {}
    exec(compile(PYTHON[lying], lying, "exec"), names)
    value, slope = names["distance"](0.98), names["jax"].grad(names["distance"])(0.98)
    assert value == pytest.approx(0.98, abs=1e-6) and slope == 0.0  # the truth is 1
    names = {}
    exec(compile(PYTHON[exact], exact, "exec"), names)
    slope, difference = float(names["slope"]), float(names["difference"])
    assert slope == pytest.approx(difference, rel=1e-5)  # the difference's own error at this step
    assert f"{slope:.0f} 1/s" in PYTHON[exact]


def test_doctests():
    shown = re.findall(
        r"```\{doctest\}\n(.*?)```", (DOCS / "reference" / "python.md").read_text(encoding="utf-8"), re.DOTALL
    )
    assert shown
    for text in shown:
        runner = doctest.DocTestRunner(verbose=False)
        runner.run(doctest.DocTestParser().get_doctest(text, {}, "python.md", None, None))
        assert runner.summarize(verbose=False).failed == 0
