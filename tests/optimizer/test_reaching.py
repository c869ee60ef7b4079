"""The maximum lift that a design wants reached, what a contradiction names, and one slack for all that judge a cam."""

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.highs import Infeasible
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.ascent.projection import ShapeLimits
from camopt.optimizer.program.kinematic import (
    area_ratio_row,
    conflict,
    first_working,
    kinematic_optimum,
    solve_over_peak_angles,
    spline_rows,
)
from camopt.optimizer.program.linear_program import maximise
from camopt.optimizer.program.program_cam import program_cam
from camopt.scene import load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM
from experiments.linear_programs import drawn

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
    best = solve_over_peak_angles(cam, design, -row, spline_rows(limits.matrix), limits.bound, working)
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


def reaching(name: str):
    """A built-in design whose lift is to be reached, or the design of a drawn scene of that number."""
    if name.isdigit():
        return drawn(int(name)).design
    return load_scene(name).design.model_copy(update={"reach_max_lift": True})


@pytest.mark.parametrize("name", ["kodama", "motori-1", "exhaust-gas", "9", "13", "14", "15", "20", "34", "53"])
def test_what_programs_and_projections_give_the_judge_of_the_shape_keeps(name):
    design = reaching(name)
    cam = program_cam(design, design.duration_deg / 40)
    found = kinematic_optimum(design, cam, explain=False)
    assert broken_by_shape(found.lift, design) == []
    nearest = ShapeLimits(cam, design).nearest
    for z in (2 * found.z, found.z + np.random.default_rng(1).normal(size=len(found.z)) * np.abs(found.z).mean()):
        assert broken_by_shape(cam.lift(nearest(z)), design) == []


@pytest.mark.parametrize(("number", "key"), [(5, "jerk_max_mm_per_deg3"), (57, "acceleration_max_mm_per_deg2")])
def test_a_limit_that_the_given_ramps_break_is_a_contradiction_of_the_program_too(number, key):
    """The judge of the shape looks at the ramps, which no program moves."""
    design = drawn(number).design
    cam = program_cam(design, design.duration_deg / 40)
    with pytest.raises(Infeasible):
        kinematic_optimum(design, cam, explain=False)
    said = conflict(design, cam)
    assert f"{key} would have to rise" in said
    needed = float(said.partition(f"{key} would have to rise")[2].split(" to ")[1].split(",")[0])
    wider = design.model_copy(update={key: needed})
    assert broken_by_shape(kinematic_optimum(wider, cam, explain=False).lift, wider) == []


def test_a_lift_short_by_more_than_the_slack_is_not_reached():
    lift = kinematic_optimum(KODAMA.design, free_cam(KODAMA.design, 6.0), explain=False).lift
    asked = {"reach_max_lift": True, "max_lift_mm": lift.max_lift / MM * (1 + 1.1e-5)}
    assert "reach_max_lift" in broken_by_shape(lift, KODAMA.design.model_copy(update=asked))
