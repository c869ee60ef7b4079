"""Tasks as plain data: their permitted content, and their keys."""

import json

import pytest

import camopt
from camopt.cam.design_file import as_written
from camopt.scene import InputError, load_scene, scene_text
from camopt.scene.load import scene_with
from camopt.scene.text_file import scene_toml
from camopt.tasks.task import SettledTask, stored_task

SCENE = load_scene("motori-1")
SETTLED = {"verb": "settled", "scene": "motori-1", "cam": "polydyne", "speed_rpm": 4000}


def test_the_key_depends_on_the_content_and_on_the_version():
    task = stored_task(SETTLED, "1")
    assert task.key == stored_task(dict(reversed(SETTLED.items())) | {"speed_rpm": 4000.0, "vary": {}}, "1").key
    assert len(task.key) == 64
    others = [stored_task(SETTLED | more, "1") for more in ({"speed_rpm": 4001}, {"vary": {"spring.preload_N": 251}})]
    assert len({task.key, stored_task(SETTLED, "2").key, *(other.key for other in others)}) == 4


def test_a_scene_is_identified_by_its_content(tmp_path):
    (tmp_path / "mine.toml").write_text(scene_text("motori-1"), encoding="utf-8")
    by_file = stored_task(SETTLED | {"scene": tmp_path / "mine.toml"}, "1")
    by_text = stored_task(SETTLED | {"scene": scene_text("motori-1")}, "1")
    by_scene, again = (stored_task(SETTLED | {"scene": SCENE}, "1") for _ in range(2))
    assert by_file == by_text and by_scene == again
    assert by_scene.parts[json.loads(by_scene.text)["scene"]] == scene_toml(SCENE)
    assert by_scene.task().scene == scene_toml(SCENE)


def test_a_cam_is_identified_by_the_content_of_its_design(tmp_path):
    cam = camopt.polydyne(SCENE)
    task = stored_task(SETTLED | {"cam": cam}, "1")
    (text,) = task.parts.values()
    (tmp_path / "design.json").write_text(text, encoding="utf-8")
    assert stored_task(SETTLED | {"cam": tmp_path / "design.json"}, "1").task().cam.startswith('{"family"')
    read, written = camopt.read_cam(tmp_path, SCENE), as_written(cam)
    assert (read.coefficients == written.coefficients).all() and (read.borders == written.borders).all()
    assert isinstance(task.task(), SettledTask)


@pytest.mark.parametrize(
    ("task", "words"),
    [
        ({}, "verb: expected one of settled, simulate, yield, rehearse"),
        ({"verb": "settle"}, "verb: expected one of"),
        ({"verb": "rehearse", "number": -1}, "number: must be greater than or equal to 0 (given: '-1')"),
        ({"verb": "rehearse", "number": 1, "speed": 3}, "speed: unknown key"),
        (SETTLED | {"speed_rpm": "fast"}, "speed_rpm: must be a valid number"),
        (SETTLED | {"scene": "motori-9"}, "did you mean 'motori-"),
        (SETTLED | {"scene": 3}, "scene: int given, expected a name, a file, a TOML text or a Scene"),
        (SETTLED | {"cam": "polydine"}, "did you mean 'polydyne'?"),
        (SETTLED | {"vary": {"spring.preload_N": float("nan")}}, "vary.spring.preload_N: "),
        ({"verb": "settled", "scene": "motori-1"}, "task 7: cam: Field required; task 7: speed_rpm: Field required"),
    ],
)
def test_an_invalid_task_is_reported_with_a_sentence(task, words):
    with pytest.raises(InputError) as refused:
        stored_task(task, "1", "task 7")
    assert str(refused.value).startswith("task 7: ") and words in str(refused.value)


def test_numbers_of_a_scene_are_replaced_and_checked():
    changed = scene_with(SCENE, {"spring.preload_N": 300.0, "valve.mass_kg": 0.3, "design.max_lift_mm": 9.0})
    assert (changed.element[1].preload_N, changed.mass[0].mass_kg) == (300.0, 0.3)
    assert changed.design is not None and changed.design.max_lift_mm == 9.0
    assert changed == scene_with(changed, {"valve.mass_kg": 0.3}) and scene_with(SCENE, {}) is SCENE


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ({"sprng.preload_N": 1.0}, "'sprng.preload_N': motori-1 has no such number"),
        ({"spring.preload": 1.0}, "'spring.preload': motori-1 has no such number"),
        ({"spring.stiffness_N_per_m": -1.0}, "scene motori-1 with spring.stiffness_N_per_m = -1: element.2"),
        ({"design.max_lift": 1.0}, "'design.max_lift': motori-1 has no such number"),
    ],
)
def test_a_number_that_a_scene_does_not_have_is_refused(numbers, words):
    with pytest.raises(InputError) as refused:
        scene_with(SCENE, numbers)
    assert words in str(refused.value)
