"""The generated parts of the reference contain every command, key and name."""

import re

import camopt
from camopt.cli.parser import parser
from camopt.scene.design import Design, Operation, Piston
from camopt.scene.element import Element
from camopt.scene.geometry import Geometry
from camopt.scene.schema import Force, Grinding, Mass, Scene, Tolerance
from docs.generators.commands import commands
from docs.generators.python_names import python_names
from docs.generators.questions import PAGES as QUESTIONS
from docs.generators.questions import questions
from docs.generators.scene_keys import KEYS, scene_keys


def test_every_command_with_every_option():
    text = commands("")
    top = parser()
    assert set(re.findall(r"^## `camopt ([\w-]+)`$", text, re.MULTILINE)) == set(top.verbs)
    assert "| `--speeds {band,nominal}` | speeds the cam must hold at (band) |" in text
    assert "| `--no-compare` |" in text and "(`runs/<scene>-<UTC time>`)" in text


def test_every_key_of_a_scene():
    text = scene_keys("")
    for model in (Scene, Mass, Element, Operation, Design, Geometry, Tolerance, Grinding):
        for key in model.model_fields:
            assert f"`{key}`" in text or f"`[{key}]`" in text or f"`[[{key}]]`" in text, key
    assert '| `kind` | what it is | `"spring"`, `"contact"`, `"adjuster"`, `"friction"` | required |' in text
    assert "to angle zero | number | – |" in text and "must reach max_lift_mm | true or false | `false` |" in text
    assert "of the crankshaft | list of numbers | required | 100 to 20000 |" in text


def test_every_key_of_a_scene_has_a_meaning():
    rows = [line.split(" | ") for line in scene_keys("").splitlines() if line.startswith("| `")]
    assert len(rows) > 80 and not [row[0] for row in rows if not row[1].strip()]


def test_every_meaning_belongs_to_an_existing_key():
    tables = {"mass": Mass, "element": Element, "operation": Operation, "design": Design, "geometry": Geometry}
    tables |= {"scene": Scene, "force": Force, "tolerance": Tolerance, "grinding": Grinding, "piston": Piston}
    for table, keys in KEYS.items():
        assert keys.keys() <= tables[table].model_fields.keys(), table


def test_the_index_of_results_has_every_question_once():
    index = (QUESTIONS / "index.md").read_text(encoding="utf-8")
    shown = [
        line
        for block in re.findall(r"```\{generated\} questions\n(.*?)```", index, re.DOTALL)
        for line in block.split()
    ]
    assert sorted(shown) == sorted(page.stem for page in QUESTIONS.glob("*.md") if page.stem != "index")
    assert all(line.endswith("? |") for line in questions("\n".join(shown)).splitlines()[2:])


def test_every_public_name():
    text = python_names("")
    assert re.findall(r"camopt\.(\w+)\(", "\n".join(re.findall(r"^````\{py:\w+\} (.*)$", text, re.MULTILINE))) == list(
        camopt.__all__
    )
    assert "<function" not in text.replace("<function>", "") and " at 0x" not in text
