"""What the README prints works as printed."""

import re
import shlex
from pathlib import Path

import pytest

from camopt.cli import parser

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", README, re.DOTALL)
COMMANDS = [line for kind, text in BLOCKS if kind == "sh" for line in text.splitlines() if line.startswith("camopt ")]


def test_there_are_two_set_up_lines():
    lines = [text for kind, text in BLOCKS if kind == "sh" and text.startswith("python3 -m venv")]
    assert len(lines) == 2 and all(text.count("\n") == 1 for text in lines)


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_parse(command):
    assert parser().parse_args(shlex.split(command)[1:]).command


def test_python_example_runs(capsys):
    (code,) = [text for kind, text in BLOCKS if kind == "python"]
    exec(compile(code, "README.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "revolution" in printed and "rejected" in printed


def test_pictures_exist():
    for path in re.findall(r"!\[.*?\]\((.*?)\)", README, re.DOTALL):
        assert (Path(__file__).parents[1] / path).stat().st_size > 0
