"""The drawing of a train, the animation's data on its follower, and the drawing of a contour's tightest spot."""

import numpy as np
import pytest

from camopt.cam.followers import Arm
from camopt.cam.geometry import contact
from camopt.cam.read import read_cam
from camopt.report.cams import geometry, tightest
from camopt.report.drawing import BASE_MM, LENGTH, SCALE, drawing, drawn_follower, room_for
from camopt.report.motion import RunCams
from camopt.scene import build_train, load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.load import parse_scene, scene_text
from camopt.scene.train import GROUND
from camopt.scene.units import DEG, MM

KODAMA = load_scene("kodama")
LIFT = read_cam("polydyne", KODAMA)
ROCKER = Geometry(
    follower="rocker", base_radius_mm=20, roller_radius_mm=10, pivot_mm=(30, -24), arm_mm=32, valve_arm_mm=40
)
LIFT_MM = np.linspace(0.0, 9.4, 24)


def moved(train) -> np.ndarray:
    """Positions (k, n) [mm] of an opening: the coils of the spring follow the valve the less the closer to its foot."""
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
        reach = SCALE * arm["valve"][0] if arm and e["look"] == "cam" else 0.0  # the length of a finger
        for end, x in ((e["a"], e["x"]), (e["b"], e["x"] + reach)):
            if end != GROUND:
                assert picture["masses"][end]["left"] <= x <= picture["masses"][end]["right"]


def test_kodama_is_drawn_like_an_engine():
    _, picture = drawn(KODAMA)
    masses = {m["name"]: m for m in picture["masses"]}
    elements = {e["name"]: e for e in picture["elements"]}
    way = ["camshaft", "follower", "valve_tip", "valve_stem", "valve_head"]
    assert [masses[n]["y"] for n in way] == sorted(masses[n]["y"] for n in way)
    assert len({masses[n]["x"] for n in way[1:]}) == 1  # one axis, and the spring beside it
    valve_mm = drawn_follower(KODAMA.geometry)["arm"]["valve"][0]
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


@pytest.mark.parametrize("geometry", [KODAMA.geometry, ROCKER], ids=["finger", "rocker"])
class TestSwinging:
    def test_stands_on_the_base_circle(self, geometry):
        arm = drawn_follower(geometry)["arm"]
        assert np.hypot(*arm["centre"]) == pytest.approx(geometry.base_radius_mm + geometry.contact_radius_mm, abs=1e-3)
        for end, length in (("centre", geometry.arm_mm), ("valve", geometry.valve_arm_mm)):
            assert np.hypot(*np.subtract(arm[end], arm["pivot"])) == pytest.approx(length, abs=1e-3)
        assert arm["valve"][0] > 0

    def test_the_rotation_on_the_page_opens_the_valve_by_the_lift(self, geometry):
        """As in animation.js, the body turns about the pivot by side (asin(sin shut + lift / length) - shut)."""
        arm, lift = drawn_follower(geometry)["arm"], 7.0
        shut = arm["shut_deg"] * DEG
        by = arm["side"] * (np.arcsin(np.sin(shut) + lift / arm["valve_arm_mm"]) - shut)
        x, y = np.subtract(arm["valve"], arm["pivot"])
        assert y * np.cos(by) + x * np.sin(by) - y == pytest.approx(lift, abs=1e-3)
        swing = Arm(geometry).swing(np.array([[lift * MM], [0.0], [0.0]]))[0, 0]
        assert abs(by) == pytest.approx(abs(swing))

    def test_room_holds_every_part(self, geometry):
        drawn = drawn_follower(geometry)
        room = room_for(drawn, 27.0)
        assert min(room.left, room.right, room.above, room.below) >= 27.0
        for x, y in (drawn["arm"]["pivot"], drawn["arm"]["valve"], drawn["arm"]["centre"]):
            assert -room.left < x < room.right and -room.above < y < room.below


def test_other_followers_have_no_arm():
    assert drawn_follower(None)["follower"] == "point"
    flat = drawn_follower(Geometry(follower="flat", base_radius_mm=30))
    assert (flat["arm"], flat["base_radius_mm"], room_for(flat, 40.0).train) == (None, 30.0, 0.0)


def test_without_geometry_there_is_no_section():
    assert geometry(RunCams(KODAMA.model_copy(update={"geometry": None}), {"design": LIFT}, [])) is None
    assert geometry(RunCams(None, {}, [])) is None


@pytest.mark.parametrize("follower", [Geometry(follower="flat", base_radius_mm=40, face_width_mm=10),
                                      Geometry(follower="roller", base_radius_mm=18, roller_radius_mm=8)])  # fmt: skip
def test_the_spot_lies_where_the_radius_is_smallest(follower):
    scene = KODAMA.model_copy(update={"geometry": follower})
    content = geometry(RunCams(scene, {"design": LIFT, "polydyne": LIFT}, []))
    assert content is not None and [row["cam"] for row in content["rows"]] == ["design", "polydyne"]
    c = contact(LIFT, follower)
    i = tightest(c)
    assert abs(c.radius_of_curvature[i]) == np.min(np.abs(c.radius_of_curvature))
    drawn = content["drawing"]
    # the drawing's scale from the base circle; nose up, the angle growing to the right
    scale = drawn["base"] / follower.base_radius_mm
    x, y = c.contour[i] / MM
    assert drawn["spot"][0] - drawn["centre"][0] == pytest.approx(scale * y, abs=0.2)
    assert drawn["centre"][1] - drawn["spot"][1] == pytest.approx(scale * x, abs=0.2)
    assert f"{c.theta[i] / DEG:.3g}".replace("-", "−") in drawn["sentence"]
    if follower.follower == "flat":
        assert "face" in content["rows"][0]["faults"] and "face_width_needed_mm" in content["columns"]
    else:
        assert content["rows"][0]["faults"] == "none"


def test_a_follower_that_cannot_run_on_the_cam_is_reported():
    short = KODAMA.geometry.model_copy(update={"valve_arm_mm": 8.0})
    content = geometry(RunCams(KODAMA.model_copy(update={"geometry": short}), {"design": LIFT}, []))
    assert content is not None and "drawing" not in content
    assert content["none"][0].startswith("design: [geometry]: a valve arm of 8 mm does not lift the valve")
