"""Tables that a ball probe felt on the cam itself: the follower's lift comes out of them."""

import numpy as np
import pytest

from camopt.cam.conversion import converted
from camopt.cam.geometry import contact
from camopt.cam.read import read_cam
from camopt.cam.tables.lift_table import read_lift_table
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM
from tests.cam.cams import KODAMA, THETA, WIDE, difference
from tests.cam.cams import POLYDYNE as CAM
from tests.command_line import run

ROLLS = KODAMA.model_copy(
    update={"geometry": Geometry(follower="roller", base_radius_mm=25, roller_radius_mm=9, rocker_ratio=1.4)}
)


def felt(scene, probe: Geometry, folder, noise_um: float = 0.0):
    """A table of what the probe feels on the cam that gives the scene's follower the lift of CAM."""
    lift = converted(CAM, scene.geometry, probe)
    degrees = np.arange(-180.0, 180.1, 0.5)
    height = lift(degrees * DEG) / MM + np.random.default_rng(3).normal(0, 1e-3 * noise_um, len(degrees))
    height[-1] = height[0]
    file = folder / "felt.dat"
    np.savetxt(file, np.column_stack([degrees, height]), fmt="%.10f", header="table-angle = cam\ntable-lift = mm")
    return file


@pytest.mark.parametrize("scene", [KODAMA, ROLLS], ids=["finger", "roller"])
@pytest.mark.parametrize("radius", [2.0, 10.0])
class TestBall:
    def test_the_valve_lift_comes_out(self, tmp_path, scene, radius):
        ball = Geometry(follower="roller", base_radius_mm=scene.geometry.base_radius_mm, roller_radius_mm=radius)
        file = felt(scene, ball, tmp_path)
        found = read_lift_table(file, scene, table_probe_mm=radius)
        assert difference(found, CAM) < 2e-4 * MM
        assert found.half_duration == pytest.approx(CAM.half_duration, abs=0.01 * DEG)
        assert difference(read_lift_table(file, scene), CAM) > 0.2 * MM

    def test_noise_passes_through(self, tmp_path, scene, radius):
        ball = Geometry(follower="roller", base_radius_mm=scene.geometry.base_radius_mm, roller_radius_mm=radius)
        found = read_lift_table(felt(scene, ball, tmp_path, 2.0), scene, table_probe_mm=radius)
        # 2 um on a ramp of 11 um/deg move the middle of the duration by a tenth of a degree, on flanks of 0.26 mm/deg
        assert difference(found, CAM) < 0.05 * MM

    def test_height_of_the_point_of_contact_is_the_field_s_correction(self, scene, radius):
        """lift + r (1 - cos alpha), tan alpha = s' / r: the point's height along the probe, not the follower's lift."""
        ball = Geometry(follower="roller", base_radius_mm=scene.geometry.base_radius_mm, roller_radius_mm=radius)
        lift = converted(CAM, scene.geometry, ball)
        points = contact(lift, ball, THETA)
        along = np.sum(points.contour * np.stack([np.cos(THETA), np.sin(THETA)], axis=1), axis=1)
        base = ball.base_radius_mm * MM
        alpha = np.arctan(lift(THETA, 1) / (base + radius * MM + lift(THETA)))
        assert along - base == pytest.approx(lift(THETA) + radius * MM * (1 - np.cos(alpha)), abs=1e-12)


def test_a_flat_probe_and_the_command(tmp_path, capsys):
    scene = ROLLS.model_copy(update={"geometry": WIDE})
    file = felt(scene, WIDE, tmp_path)
    assert difference(read_lift_table(file, scene, table_probe_mm=np.inf), CAM) < 1e-5 * MM
    ball = Geometry(follower="roller", base_radius_mm=18, roller_radius_mm=5)
    file = felt(KODAMA, ball, tmp_path)
    code, out, err = run(capsys, "cam", "kodama", "--cam", str(file), "--table-probe-mm", "5")
    assert (code, "probe_mm = 5" in out) == (0, True)
    assert "maximum lift   9.4000" in out
    assert "--table-probe-mm 5.0" in err
    file.write_text("# table-probe = 5\n" + file.read_text())
    assert read_cam(file, KODAMA).max_lift == pytest.approx(9.4 * MM, abs=2e-4 * MM)


@pytest.mark.parametrize(
    ("scene", "keys", "says"),
    [
        (KODAMA.model_copy(update={"geometry": None}), {"table_probe_mm": 5.0}, "add it to the scene"),
        (KODAMA, {"table_probe_mm": -5.0}, "the probe is '-5.0'; expected the radius"),
        (KODAMA, {"table_probe_mm": 5.0, "table_ratio": 1.2}, "and no ratio beside it"),
    ],
)
def test_refusals(tmp_path, scene, keys, says):
    file = felt(KODAMA, Geometry(follower="roller", base_radius_mm=18, roller_radius_mm=5), tmp_path)
    with pytest.raises(InputError, match=says) as error:
        read_lift_table(file, scene, "cam", "mm", **keys)
    assert str(file) in str(error.value) and "\n" not in str(error.value)
