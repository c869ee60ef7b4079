"""Invalid or extreme paths, numbers and files: exit code 2 and one sentence, never an internal error."""

import ast
import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

import camopt
from camopt.cam.design_file import design_record
from camopt.cam.families.polydyne import polydyne
from camopt.cam.read import read_cam
from camopt.scene import InputError, load_scene
from camopt.storage import plain, write_text
from tests.command_line import refused

PATHS = {"too long": "a" * 5000, "too long a folder": "a" * 300 + "/b", "with a NUL": "a\0b", "surrogate": "a\ud800b"}
CAM = ("cam", "kodama", "--cam", "polydyne")


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
@pytest.mark.parametrize(
    "words",
    [
        ("modes", "PATH"),
        ("cam", "kodama", "--cam", "PATH"),
        ("compare", "kodama", "--design", "PATH"),
        ("modes", "kodama", "--json", "PATH"),
        (*CAM, "--csv", "PATH"),
        ("optimize", "kodama", "--out", "PATH"),
        ("optimize", "kodama", "--out", "PATH", "--resume"),
        ("tradeoff", "kodama", "--out", "PATH"),
        ("extremes", "kodama", "--out", "PATH"),
        ("compare", "kodama", "--out", "PATH"),
    ],
)
def test_invalid_paths(capsys, tmp_path, monkeypatch, words, path):
    monkeypatch.chdir(tmp_path)
    said = refused(capsys, *(path if word == "PATH" else word for word in words))
    assert "the system does not accept this path" in said and len(said) < 400
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "options",
    [
        "--speeds=1:1e308:1e-308",
        "--speeds=1:1e15:1e-12",
        "--speeds=1e308",
        "--speeds=5e-324",
        "--speeds=" + "9" * 5000,
        "--accuracy=1e-300",
        "--speed=6000 --revolutions=" + "9" * 5000,
        "--speed=6000 --step-deg=" + "9" * 5000,
    ],
)
def test_extreme_numbers(capsys, options):
    verb = "simulate" if "--speed=" in options else "verify"
    said = refused(capsys, verb, "kodama", *CAM[2:], *options.split())
    assert "expected" in said or "more than 10000 speeds" in said
    assert len(said.splitlines()[-1]) < 400


def changed(record: dict, case: str) -> str:
    """The text of a design file with one fault."""
    pieces = record["pieces"]
    if case == "integer beyond floats":
        pieces["coefficients_mm"][3][0] = 10**400
    if case == "duration beyond floats":
        record["duration_deg"] = 10**400
    if case == "overflow inside":
        pieces["coefficients_mm"][3][-1] = 1e308
    text = json.dumps(record)
    if case == "5,000 digits":
        return text.replace('"duration_deg": ', '"x": 1' + "0" * 5000 + ', "duration_deg": ')
    if case == "nested":
        return '{"pieces": ' + "[" * 100_000
    return text


@pytest.mark.parametrize(
    "case", ["integer beyond floats", "duration beyond floats", "overflow inside", "5,000 digits", "nested"]
)
def test_invalid_design_files(tmp_path, case):
    scene = load_scene("kodama")
    record = plain(design_record(polydyne(scene), 9.4e-3))
    file = tmp_path / "design.json"
    file.write_text(json.dumps(record))
    assert read_cam(file, scene).area > 0
    file.write_text(changed(record, case))
    with pytest.raises(InputError, match=r"design\.json: ") as error:
        read_cam(file, scene)
    assert len(str(error.value)) < 600


def test_a_name_that_is_not_utf8_is_written_with_an_escape(tmp_path):
    write_text(tmp_path / "names.csv", "cam\nd\udcff\n")  # Python's representation of the byte 255 in a file's name
    assert (tmp_path / "names.csv").read_text() == "cam\nd\\udcff\n"


REMEDY = re.compile(
    r"\b(add|ask|change|check|choose|correct|count|cut|design|enlarge|expected|give|install|join|leave|lengthen|let|lists|"
    r"loosen|lower|make|measure|merge|move|must|name|need|needed|needs|one of|raise|relax|run|set|shorten|simulate|"
    r"start|state|sweep|take|try|use|verify|would have to|write)\b"
)
"""Words with which a sentence states a remedy or the expected input."""
SAID_ELSEWHERE = (
    "cannot be read",  # followed by the system's reason
    "not valid JSON",  # followed by the parser's reason and the position
    "not valid TOML",
    "not UTF-8 text",
    "no scheduler answers",
    "not built in",  # followed by the built-in ones
    "no common solution",  # part of a longer sentence
    "no confirmed cam was found",
    "is refused",  # of a motion, after the method's reason
    "the reference refuses",
    "no grid of permitted steps",  # of studies that continue with the next case
    "pulls with more than",
    "as it was told to",
    "no such number",  # followed by the existing ones
    "the scene has no ",
)


RAISED = ("InputError", "MotionRefused", "NoCamFound", "NoCamHoldsContact")


def refusals() -> Iterator[tuple[str, str]]:
    """Place and literal text of every error message in the sources."""
    root = Path(camopt.__file__).parent
    for path in sorted(root.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in RAISED:
                words = " ".join(literals(node.args))
                if len(re.findall(r"[a-z]{2,}", words)) > 3:
                    yield f"{path.relative_to(root)}:{node.lineno}", words


def literals(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """The string literals within expressions, without format specifications."""
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        inner = [node.value] if isinstance(node, ast.FormattedValue) else ast.iter_child_nodes(node)
        yield from literals(inner)


def test_every_error_message_has_a_remedy():
    messages = list(refusals())
    assert len(messages) > 200
    mute = [f"{where}: {words}" for where, words in messages if not REMEDY.search(words)]
    mute = [message for message in mute if not any(part in message for part in SAID_ELSEWHERE)]
    assert not mute, "\n".join(mute)


def test_a_message_without_a_remedy_is_detected():
    assert not REMEDY.search("polydyne: the cam is symmetric, but the closing ramp differs from the opening ramp")
    assert REMEDY.search("the closing ramp differs: leave closing_ramp_height_mm out")
