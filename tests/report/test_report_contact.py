import numpy as np
import pytest

from camopt.cam.geometry import contact
from camopt.cam.read import read_cam
from camopt.report.cams import geometry, tightest
from camopt.report.motion import RunCams
from camopt.scene import load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM

SCENE = load_scene("kodama")
LIFT = read_cam("polydyne", SCENE)


def test_without_geometry_there_is_no_section():
    assert geometry(RunCams(SCENE.model_copy(update={"geometry": None}), {"design": LIFT}, [])) is None
    assert geometry(RunCams(None, {}, [])) is None


@pytest.mark.parametrize("follower", [Geometry(follower="flat", base_radius_mm=40, face_width_mm=10),
                                      Geometry(follower="roller", base_radius_mm=18, roller_radius_mm=8)])  # fmt: skip
def test_the_spot_lies_where_the_radius_is_smallest(follower):
    scene = SCENE.model_copy(update={"geometry": follower})
    found = geometry(RunCams(scene, {"design": LIFT, "polydyne": LIFT}, []))
    assert found is not None and [row["cam"] for row in found["rows"]] == ["design", "polydyne"]
    c = contact(LIFT, follower)
    i = tightest(c)
    assert abs(c.radius_of_curvature[i]) == np.min(np.abs(c.radius_of_curvature))
    drawn = found["drawing"]
    # the drawing's scale from the base circle; nose up, the angle growing to the right
    scale = drawn["base"] / follower.base_radius_mm
    x, y = c.contour[i] / MM
    assert drawn["spot"][0] - drawn["centre"][0] == pytest.approx(scale * y, abs=0.2)
    assert drawn["centre"][1] - drawn["spot"][1] == pytest.approx(scale * x, abs=0.2)
    assert f"{c.theta[i] / DEG:.3g}".replace("-", "−") in drawn["sentence"]
    if follower.follower == "flat":
        assert "face" in found["rows"][0]["faults"] and "face_width_needed_mm" in found["columns"]
    else:
        assert found["rows"][0]["faults"] == "none"


def test_a_follower_that_cannot_follow_is_said():
    short = SCENE.geometry.model_copy(update={"valve_arm_mm": 8.0})
    found = geometry(RunCams(SCENE.model_copy(update={"geometry": short}), {"design": LIFT}, []))
    assert found is not None and "drawing" not in found
    assert found["none"][0].startswith("design: [geometry]: a valve arm of 8 mm does not lift the valve")
