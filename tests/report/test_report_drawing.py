import numpy as np
import pytest

from camopt.report.drawing import BASE_MM, LENGTH, SCALE, drawing, drawn_follower, room_for
from camopt.scene import build_train, load_scene
from camopt.scene.load import parse_scene, scene_text
from camopt.scene.train import GROUND

LIFT_MM = np.linspace(0.0, 9.4, 24)


def moved(train) -> np.ndarray:
    """Positions (k, n) [mm] of an opening: masses off the way to the valve follow it the less the later they come."""
    share = np.ones(len(train.mass))
    coils = [i for i in range(len(share)) if "spring" in train.mass_names[i]]
    share[coils] = 1 - np.arange(1, len(coils) + 1) / (len(coils) + 1)
    share[[int(train.a[e]) for e in np.flatnonzero(train.cam_driven) if train.a[e] != GROUND]] = 0.0
    return np.outer(LIFT_MM, share)


def drawn(scene):
    train = build_train(scene)
    x = moved(train)
    return x, drawing(train, x, room_for(drawn_follower(scene.geometry), BASE_MM + 9.4))


def edges(picture, x_mm):
    """(left, right, top, bottom) of every mass at positions x (n) [mm]."""
    return [
        (m["left"], m["right"], m["y"] - m["height"] / 2 + SCALE * s, m["y"] + m["height"] / 2 + SCALE * s)
        for m, s in zip(picture["masses"], x_mm, strict=True)
    ]


@pytest.mark.parametrize("name", ["kodama", "motori-1", "motori-2", "pushrod-5mass"])
def test_nothing_collides_while_the_valve_opens(name):
    x, picture = drawn(load_scene(name))
    for row in x:
        boxes = edges(picture, row)
        for i, a in enumerate(boxes):
            for b in boxes[:i]:
                assert a[0] > b[1] or a[1] < b[0] or a[2] > b[3] or a[3] < b[2]
            assert 0 <= a[0] and a[1] <= picture["width"] and 0 <= a[2] and a[3] <= picture["height"]
        for e in picture["elements"]:
            top = e["top"] if e["a"] == GROUND else boxes[e["a"]][3]
            bottom = e["bottom"] if e["b"] == GROUND else boxes[e["b"]][2]
            assert bottom - top >= LENGTH["rod"] - 1e-9, e["name"]


@pytest.mark.parametrize("name", ["kodama", "motori-1", "pushrod-5mass"])
def test_elements_meet_their_masses(name):
    scene = load_scene(name)
    _, picture = drawn(scene)
    arm = drawn_follower(scene.geometry)["arm"]
    for e in picture["elements"]:
        reach = SCALE * arm["valve"][0] if arm and e["look"] == "cam" else 0.0  # a finger bridges it
        for end, x in ((e["a"], e["x"]), (e["b"], e["x"] + reach)):
            if end != GROUND:
                assert picture["masses"][end]["left"] <= x <= picture["masses"][end]["right"]


def test_kodama_reads_as_an_engine_does():
    _, picture = drawn(load_scene("kodama"))
    masses = {m["name"]: m for m in picture["masses"]}
    elements = {e["name"]: e for e in picture["elements"]}
    way = ["camshaft", "follower", "valve_tip", "valve_stem", "valve_head"]
    assert [masses[n]["y"] for n in way] == sorted(masses[n]["y"] for n in way)
    assert len({masses[n]["x"] for n in way[1:]}) == 1  # one axis, and the spring beside it
    valve_mm = drawn_follower(load_scene("kodama").geometry)["arm"]["valve"][0]
    assert masses["follower"]["x"] - masses["camshaft"]["x"] == pytest.approx(SCALE * valve_mm)
    assert elements["cam_follower"]["x"] == masses["camshaft"]["x"]
    assert masses["spring_1"]["x"] > masses["valve_tip"]["x"]
    assert elements["seat"]["top"] < masses["valve_head"]["y"]
    assert elements["coil_6"]["bottom"] > masses["spring_5"]["y"]
    looks = {n: e["look"] for n, e in elements.items()}
    assert looks["cam_follower"] == "cam" and looks["stem_lower"] == "rod" and looks["seat"] == "rod"
    assert {looks[f"coil_{i}"] for i in range(1, 7)} == {"coil"}
    assert [m["kind"] for m in picture["masses"]] == ["hub", "mass", "mass", "mass", "valve"] + ["small"] * 5


def test_a_valve_spring_that_is_a_contact_is_still_a_coil():
    _, picture = drawn(load_scene("motori-1"))
    looks = {e["name"]: (e["look"], e["contact"]) for e in picture["elements"]}
    assert looks["spring"] == ("coil", True) and looks["seat"] == ("rod", True) and looks["train"] == ("cam", True)


def test_masses_in_a_circle_are_drawn_too():
    more = (
        '\n[[element]]\nname = "strap"\nkind = "spring"\nbetween = ["spring_5", "spring_1"]\nstiffness_N_per_m = 10.0\n'
    )
    _, picture = drawn(parse_scene(scene_text("kodama") + more, "circle"))
    strap = picture["elements"][-1]
    assert strap["x"] != picture["masses"][5]["x"]  # beside the coils, not through them
    assert np.isfinite(picture["height"])
