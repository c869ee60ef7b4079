"""What the animation is told of a follower: a swinging arm stands on the base circle, and the train to its right."""

import numpy as np
import pytest

from camopt.cam.followers import Arm
from camopt.report.drawing import drawn_follower, room_for
from camopt.scene import load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM

FINGER = load_scene("kodama").geometry
ROCKER = Geometry(
    follower="rocker", base_radius_mm=20, roller_radius_mm=10, pivot_mm=(30, -24), arm_mm=32, valve_arm_mm=40
)


@pytest.mark.parametrize("geometry", [FINGER, ROCKER], ids=["finger", "rocker"])
class TestSwinging:
    def test_stands_on_the_base_circle(self, geometry):
        arm = drawn_follower(geometry)["arm"]
        assert np.hypot(*arm["centre"]) == pytest.approx(geometry.base_radius_mm + geometry.contact_radius_mm, abs=1e-3)
        for end, length in (("centre", geometry.arm_mm), ("valve", geometry.valve_arm_mm)):
            assert np.hypot(*np.subtract(arm[end], arm["pivot"])) == pytest.approx(length, abs=1e-3)
        assert arm["valve"][0] > 0

    def test_the_page_s_turning_opens_the_valve_by_the_lift(self, geometry):
        """What animation.js does: turn about the pivot by side (asin(sin shut + lift / length) - shut)."""
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
