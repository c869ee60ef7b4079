"""The generated parts of the reference have every command, key and name."""

import re

import camopt
from camopt.cli.parser import parser
from camopt.scene.element import Element
from camopt.scene.schema import Design, Geometry, Mass, Operation, Scene
from camopt.scene.tolerances import Grinding, Tolerance
from docs.generators.commands import commands
from docs.generators.python_names import python_names
from docs.generators.scene_keys import scene_keys


def test_every_command_with_every_option():
    text = commands("")
    top = parser()
    assert set(re.findall(r"^## `camopt (\w+)`$", text, re.MULTILINE)) == set(top.verbs)
    assert "| `--speeds {band,nominal}` | speeds the cam must hold at (band) |" in text
    assert "| `--no-compare` |" in text and "(runs/`<scene>`-`<UTC time>`)" in text


def test_every_key_of_a_scene():
    text = scene_keys("")
    for model in (Scene, Mass, Element, Operation, Design, Geometry, Tolerance, Grinding):
        for key in model.model_fields:
            assert f"`{key}`" in text or f"`[{key}]`" in text or f"`[[{key}]]`" in text, key
    assert '| `kind` | `"spring"`, `"contact"`, `"adjuster"`, `"friction"` | required |' in text
    assert "| `nose_deg` | number | – |" in text and "| `reach_max_lift` | true or false | `false` |" in text
    assert "| `speeds_rpm` | list of numbers | required | 100 to 20000 |" in text


def test_every_public_name():
    text = python_names("")
    assert re.findall(r"camopt\.(\w+)\(", "\n".join(re.findall(r"^````\{py:\w+\} (.*)$", text, re.MULTILINE))) == list(
        camopt.__all__
    )
    assert "<function" not in text.replace("<function>", "")
