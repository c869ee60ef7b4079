"""The experiment on the limits of a drawing: every cam would break its limit without it, and holds it with it."""

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import load_scene
from camopt.scene.units import DEG, MM
from experiments import drawing_limits


def test_every_limit_is_broken_without_and_held_with(tmp_path):
    rows = drawing_limits.main("small", tmp_path)["rows"]
    assert [row["limit"] for row in rows] == [*drawing_limits.LIMITS, "nose_radius_min_mm"]
    assert [row["follower"] for row in rows] == ["flat"] * len(drawing_limits.LIMITS) + ["finger"]
    for row in rows:
        assert row["broken_without"] == [row["limit"]] and row["broken_with"] == []
        if row["limit"] == "waves_max":  # a count leaps by pairs of sign changes, so that it need not reach its limit
            assert row["value_with"] <= row["value_asked"] and (row["value_asked"] - row["value_with"]) % 2 == 0
        else:
            near = 1e-6 if row["limit"].startswith("snap") else 3e-3
            assert row["value_with"] == pytest.approx(row["value_asked"], abs=near)
        assert row["area_ratio_with"] < row["area_ratio_without"]
        assert row["area_ratio_with"] < row["bound"] < 0.62
        assert row["price_percent"] > 0
        searched = ["duration_at", "waves_max", "snap_max_mm_per_deg4"]
        searched += ["nose_radius_min_mm"] * (row["follower"] != "flat")
        assert row["bound_leaves_out"] == [key for key in searched if key == row["limit"]]


def test_the_values_are_those_of_formulas_written_again():
    scene = load_scene("kodama").model_copy(update={"geometry": drawing_limits.GEOMETRY["kodama"]})
    lift = kinematic_optimum(scene.design, free_cam(scene.design, 4.0)).lift
    t = np.arange(-72.0, 72.0005, 0.001)
    s, v, a = (lift(t * DEG, k) / MM for k in range(3))
    phi = np.deg2rad(108.0 + 2.0 * t)
    piston = 43.0 * (1 - np.cos(phi)) + 143.0 - np.sqrt(143.0**2 - (43.0 * np.sin(phi)) ** 2)
    open_at = t[s >= 5.0]
    expected = {
        "lift_at": s[18_000],
        "duration_at": open_at[-1] - open_at[0],
        "piston": (4.0 + piston - s).min(),
        "nose_radius_min_mm": (22.0 + s + a).min(),
        "face_width_mm": 2 * np.abs(v).max(),
        "entrainment_min_m_per_s": 5000 * np.pi / 60 * ((22.0 + s) / 2 + a).min() * 1e-3,
    }
    jerk = np.diff(a)
    expected["snap_max_mm_per_deg4"] = np.abs(np.diff(jerk)[1:-1]).max() / 0.001**2 * DEG**2
    expected["waves_max"] = np.count_nonzero(np.diff(np.sign(jerk[np.abs(jerk) > 1e-5 * np.abs(jerk).max()])))
    found = {key: drawing_limits.value_of(key, lift, scene) for key in drawing_limits.LIMITS}
    assert found == pytest.approx(expected, rel=3e-5)
