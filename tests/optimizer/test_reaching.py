"""The maximum lift that a design wants reached: over peak angles, and what a contradiction names."""

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.highs import Infeasible
from camopt.optimizer.program.kinematic import (
    area_ratio_row,
    conflict,
    first_working,
    reach,
    spline_rows,
)
from camopt.optimizer.program.linear_program import maximise
from camopt.scene import load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM

KODAMA = load_scene("kodama")


def test_the_least_area_that_reaches_the_lift_is_the_least_over_all_peak_angles():
    """11 mm are reached within three degrees of the middle, and not at six."""
    design = KODAMA.design.model_copy(update={"max_lift_mm": 11.0, "reach_max_lift": True})
    cam = free_cam(design, 8.0)
    limits, (row, _) = cam.limits(design), area_ratio_row(design, cam)
    working, found = first_working(limits), {}
    for peak in (-6.0, -4.5, -3.0, -1.5, 0.0, 1.5, 3.0, 4.5, 6.0):
        lift, offset = cam.basis(np.array([peak * DEG]))
        matrix = np.vstack([limits.matrix, -lift @ cam.Z])
        bound = np.append(limits.bound, offset + lift @ cam.x_p - 11.0 * MM * (1 - 1e-5))
        try:
            found[peak] = maximise(-row, spline_rows(matrix), bound, np.append(working, len(bound) - 1)).value
        except Infeasible:
            continue
    assert len(found) == 5
    best = reach(cam, design, -row, spline_rows(limits.matrix), limits.bound, working)
    assert best.value == pytest.approx(max(found.values()), abs=1e-7)
    assert cam.lift(best.z).max_lift >= 11.0 * MM * (1 - 1.1e-5)


def test_a_limit_that_would_need_a_number_of_the_other_sign_is_no_remedy():
    """A base circle of 5 mm leaves the nose of a flat follower's cam no radius at all."""
    flat = Geometry(follower="flat", base_radius_mm=5.0)
    asked = {"nose_radius_min_mm": 4.0, "reach_max_lift": True}
    design = KODAMA.design.model_copy(update=asked).within(flat, KODAMA.operation)
    said = conflict(design, free_cam(design, 8.0))
    assert "max_lift_mm would have to fall" in said
    assert "nose_radius_min_mm would" not in said
